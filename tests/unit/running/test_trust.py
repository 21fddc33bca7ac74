"""A run's folder in bad company: files of others, links, two writers, what has changed before --resume, damaged descriptions."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.files import alone_in
from fcsim.running import outputs
from fcsim.running.case import Case, CaseScript, load_case
from fcsim.running.description import SPARE, Description, read_description, write_description, write_end
from fcsim.running.folder import open_run
from fcsim.running.run import RunOptions, run_case
from fcsim.timestep.step import Step

Rows = Callable[[Path], list[dict[str, str]]]
PLAIN = RunOptions(export_every=0, vtk_every=0, checkpoint_every=2)


def content(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


@pytest.fixture
def run(case_folder: Path, tmp_path: Path) -> Path:
    """A run of four steps."""
    run_case(load_case(case_folder), {"steps": "4"}, tmp_path / "out", PLAIN)
    return tmp_path / "out"


def edit(run: Path, **changes: Any) -> None:
    about = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(about | changes))


def test_a_damaged_run_is_not_replaced_and_the_way_out_is_said(case_folder: Path, run: Path) -> None:
    (run / "run.json").write_text('{"format":')
    before = content(run)
    with pytest.raises(InputError, match=r"run\.json is damaged.*delete the folder yourself, or choose another --out"):
        run_case(load_case(case_folder), {"steps": "4"}, run, PLAIN, overwrite=True)
    assert content(run) == before


@pytest.mark.parametrize(
    "mine", ["plots/fig.svg", "vtk/blocks_00001.vtu", "steps.csv", "film.gif", "run.json", "fclib/global/S-i1-1-00001.hdf5"]
)
def test_overwrite_replaces_runs_alone(case_folder: Path, tmp_path: Path, mine: str) -> None:
    """Folders with names that runs have, and no run.json of fcsim that says so."""
    (tmp_path / "mine" / mine).parent.mkdir(parents=True)
    (tmp_path / "mine" / mine).write_text("{}")
    with pytest.raises(InputError, match="expected an empty or new folder, or a run's"):
        run_case(load_case(case_folder), {}, tmp_path / "mine", PLAIN, overwrite=True)
    assert content(tmp_path / "mine") == {mine: b"{}"}


def test_overwrite_removes_a_runs_files_alone(case_folder: Path, tmp_path: Path) -> None:
    script, out = load_case(case_folder), tmp_path / "out"
    run_case(script, {"steps": "4"}, out, RunOptions(export_every=1, vtk_every=1, checkpoint_every=1))
    for mine in ("notes.txt", "plots/fig.svg", "vtk/mine.vtu", "fclib/global/mine.hdf5", "deep/er/x"):
        (out / mine).parent.mkdir(parents=True, exist_ok=True)
        (out / mine).write_text("mine")
    for drawn in ("pictures/bodies.png", "pictures/stress.png", "plots/phases.svg", "film.gif"):  # by `fcsim render`
        (out / drawn).parent.mkdir(exist_ok=True)
        (out / drawn).write_text("drawn")
    run_case(script, {"steps": "1"}, out, PLAIN, overwrite=True)
    kept = {name for name, text in content(out).items() if text == b"mine"}
    assert kept == {"notes.txt", "plots/fig.svg", "vtk/mine.vtu", "fclib/global/mine.hdf5", "deep/er/x"}
    assert set(content(out)) - kept == {"run.json", "steps.csv", "steps.h5", "checkpoint.h5"}


@pytest.mark.parametrize("name", ["vtk", "fclib", "plots"])
def test_links_that_lead_out_are_refused(case_folder: Path, run: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "blocks.pvd").write_text("mine")
    (run / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=f"{name}: expected a place within .*, it leads to"):
        run_case(load_case(case_folder), {}, run, PLAIN, overwrite=True)
    with pytest.raises(InputError, match="it leads to"):
        run_case(load_case(case_folder), {"steps": "5"}, run, PLAIN, resume=True)
    assert content(tmp_path / "elsewhere") == {"blocks.pvd": b"mine"}


def test_a_link_to_what_is_not_there_is_named(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was "cannot be made: File exists"."""
    (tmp_path / "out").symlink_to("gone")
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out")]) == 2
    assert "out: expected a folder for the results, found a link to gone, which is not there" in capsys.readouterr().err


@pytest.mark.parametrize("options", [{"resume": True}, {"overwrite": True}])
def test_one_writer_at_a_time(case_folder: Path, run: Path, options: dict[str, bool]) -> None:
    before = content(run)
    with alone_in(run, "fcsim run"), pytest.raises(InputError, match="another fcsim run is writing there"):
        run_case(load_case(case_folder), {"steps": "5"}, run, PLAIN, **options)  # type: ignore[arg-type]
    assert content(run) == before
    run_case(load_case(case_folder), {"steps": "5"}, run, PLAIN, **options)  # type: ignore[arg-type]


def test_a_second_run_does_not_disturb_the_first(case_folder: Path, tmp_path: Path) -> None:
    """Started while the first is in its third step."""
    script, out, refused = load_case(case_folder), tmp_path / "out", []

    def start_another(case: Case, step: Step) -> None:
        if step.number == 3:
            for options in ({"overwrite": True}, {"resume": True}):
                with pytest.raises(InputError) as told:
                    run_case(script, {}, out, PLAIN, **options)  # type: ignore[arg-type]
                refused.append(str(told.value))

    summary = run_case(script, {}, out, PLAIN, watch=start_another)
    assert summary.status == "finished" and len(open_run(out).columns["step"]) == 12
    assert len(refused) == 2 and all("another fcsim run" in text for text in refused)


def change_script(folder: Path, run: Path) -> None:
    script = folder / "two_blocks.py"
    script.write_text(script.read_text().replace("-9.81", "-9.0"))


def change_mesh(folder: Path, run: Path) -> None:
    edit(run, model="0" * 64)


def change_version(folder: Path, run: Path) -> None:
    edit(run, versions=json.loads((run / "run.json").read_text())["versions"] | {"fcsim": "0.0.9"})


@pytest.mark.parametrize(
    ("change", "said"),
    [(change_script, "two_blocks.py has changed"), (change_mesh, "the model's mesh has changed"), (change_version, "fcsim was 0.0.9, is ")],
)
def test_resume_knows_what_has_changed(case_folder: Path, run: Path, change: Callable[[Path, Path], None], said: str) -> None:
    change(case_folder, run)
    before = content(run)
    with pytest.raises(InputError, match=f"{said}.*--accept-changes"):
        run_case(load_case(case_folder), {"steps": "6"}, run, PLAIN, resume=True)
    assert content(run) == before
    summary = run_case(load_case(case_folder), {"steps": "6"}, run, PLAIN, resume=True, accept_changes=True)
    assert summary.computed == 2 and any(said in note for note in summary.notes)
    assert any(said in note for note in read_description(run).notes)


def test_a_run_whose_checkpoint_is_lost_is_not_emptied_by_going_on(case_folder: Path, run: Path) -> None:
    """What is finished stays (its steps were computed again into its place); what stopped before a checkpoint says that it begins anew."""
    (run / "checkpoint.h5").unlink()
    before, script = content(run), load_case(case_folder)
    with pytest.raises(
        InputError, match=r"checkpoint\.h5: expected the checkpoint of the 4 steps that the run has, found none; --overwrite"
    ):
        run_case(script, {"steps": "6"}, run, PLAIN, resume=True)
    assert content(run) == before
    edit(run, status="failed")
    summary = run_case(script, {"steps": "6"}, run, PLAIN, resume=True)
    assert summary.computed == 6 and "no checkpoint was there to go on from: the run has begun anew" in summary.notes


def test_meshes_and_tables_are_noted(case_folder: Path, tmp_path: Path) -> None:
    """What a case reads by fcsim's readers, an acceleration record here, is compared when a run goes on."""
    record = tmp_path / "record.csv"
    record.write_text("t [s], a [m/s^2]\n0, 0\n1, 1\n")
    script = case_folder / "two_blocks.py"
    text = f'    from fcsim import read_acceleration_record\n    read_acceleration_record("{record}")\n    part = brick('
    script.write_text(script.read_text().replace("    part = brick(", text))
    run_case(load_case(case_folder), {"steps": "2"}, tmp_path / "out", PLAIN)
    assert set(read_description(tmp_path / "out").sources) == {"two_blocks.py", str(record)}
    record.write_text("t [s], a [m/s^2]\n0, 0\n1, 2\n")
    with pytest.raises(InputError, match=r"record\.csv has changed"):
        run_case(load_case(case_folder), {"steps": "3"}, tmp_path / "out", PLAIN, resume=True)


def test_other_sensors_are_not_mixed_with_the_table(case_folder: Path, run: Path) -> None:
    script = case_folder / "two_blocks.py"
    script.write_text(script.read_text().replace('Sensor("lift"', 'Sensor("lifted"').replace('("lift",)', '("lifted",)'))
    with pytest.raises(InputError, match="it differs in lift, lifted"):
        run_case(load_case(case_folder), {"steps": "6"}, run, PLAIN, resume=True, accept_changes=True)


def test_rows_that_are_missing(case_folder: Path, run: Path) -> None:
    lines = (run / "steps.csv").read_text().splitlines(keepends=True)
    (run / "steps.csv").write_text("".join(lines[:2] + lines[3:]))
    with pytest.raises(InputError, match="one row for each of the 4 steps to go on from, found 3"):
        run_case(load_case(case_folder), {"steps": "6"}, run, PLAIN, resume=True)


@pytest.mark.parametrize("other", ["parameters", "script"])
def test_a_checkpoint_of_another_run(case_folder: Path, run: Path, tmp_path: Path, other: str) -> None:
    """Of equal sizes and with a right checksum, it was gone on from as if it were this run's."""
    script = case_folder / "two_blocks.py"
    as_it_was = script.read_text()
    if other == "script":
        change_script(case_folder, run)
    given = {"steps": "4", **({"E": "2e7"} if other == "parameters" else {})}
    run_case(load_case(case_folder), given, tmp_path / "second", PLAIN)
    script.write_text(as_it_was)
    shutil.copy(tmp_path / "second" / "checkpoint.h5", run / "checkpoint.h5")
    before = content(run)
    for accept in (False, True):
        with pytest.raises(InputError, match=r"checkpoint\.h5: expected a checkpoint of the run that run\.json describes"):
            run_case(load_case(case_folder), {"steps": "6"}, run, PLAIN, resume=True, accept_changes=accept)
    assert content(run) == before


def test_accepted_changes_leave_the_run_the_same(case_folder: Path, run: Path) -> None:
    """Its checkpoints from before and from behind are both its own."""
    change_script(case_folder, run)
    for steps in ("5", "6"):
        assert run_case(load_case(case_folder), {"steps": steps}, run, PLAIN, resume=True, accept_changes=True).computed == 1


def damage_value(file: h5py.File) -> None:
    file["x"][3] += 1e-3


def damage_step(file: h5py.File) -> None:
    file.attrs["step"] = 2


def external_data(file: h5py.File) -> None:
    del file["x"]
    file.create_dataset("x", (8,), dtype="f8", external=[("/etc/passwd", 0, 64)])


def link_to_a_file(file: h5py.File) -> None:
    del file["v"]
    file["v"] = h5py.ExternalLink("elsewhere.h5", "/v")


@pytest.mark.parametrize("damage", [damage_value, damage_step, external_data, link_to_a_file])
def test_a_damaged_checkpoint(case_folder: Path, run: Path, damage: Callable[[h5py.File], None]) -> None:
    with h5py.File(run / "checkpoint.h5", "r+") as file:
        damage(file)
    before = content(run)
    with pytest.raises(InputError, match=r"checkpoint\.h5: expected "):
        run_case(load_case(case_folder), {"steps": "6"}, run, PLAIN, resume=True)
    assert content(run) == before


WRONG: dict[str, Any] = {
    "no object": [],
    "a text": "x",
    "a wrong case": {"case": 3},
    "parameters": {"case": "two_blocks", "parameters": [1]},
    "assignments": {"case": "two_blocks", "assignments": {"E": 3}},
    "plots": {"plots": {"imposed": "x"}},
    "a reaction": {"plots": {"reaction": [{"label": "no column"}]}},
    "a bound": {"plots": {"bound": {"value": "high"}}},
    "infinity": {"h": float("inf")},
    "not a number": {"tol": float("nan")},
    "a switch for a number": {"steps": True},
    "a path": {"plots": {"histories": [{"name": "../../../x", "against": {"column": "t"}, "curves": []}]}},
    "a dotted path": {"plots": {"histories": [{"name": "..", "against": {"column": "t"}, "curves": []}]}},
    "an absolute path": {"plots": {"histories": [{"name": "/tmp/x", "against": {"column": "t"}, "curves": []}]}},
    "deep": None,
}


@pytest.mark.parametrize("name", WRONG)
def test_run_json_of_another_shape_is_one_error(case_folder: Path, run: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "run.json").write_text("[" * 100_000 if name == "deep" else json.dumps(WRONG[name]))
    for command in (
        ["render", str(run)],
        ["run", str(case_folder), "--out", str(run), "--resume"],
        ["collection", "build", str(run), "--out", f"{run}2"],
    ):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert said.startswith("fcsim: ") and said.count("\n") == 1 and str(run) in said, said
    assert not run.with_name("out2").exists()


@pytest.mark.parametrize("table", [b"\xff\xfe\x00", b'step,t\n1,"a\nb', b"", b"step,step\n1,2\n", b"\x00"])
def test_steps_of_another_shape(case_folder: Path, run: Path, table: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "steps.csv").write_bytes(table)
    code = main(["run", str(case_folder), "--out", str(run), "--resume", "--steps", "5"])
    assert code == 2 and capsys.readouterr().err.startswith("fcsim: ")
    main(["render", str(run), "--film", "none"])  # draws what is there or says what is wrong
    assert "Traceback" not in capsys.readouterr().err


def test_the_end_is_told_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No new file fits: the room that run.json keeps is used."""
    from fcsim.running import description

    write_description(tmp_path, Description(case="c", status="running"))
    size = (tmp_path / "run.json").stat().st_size

    def full(*ignored: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(description, "write_record", full)
    write_end(tmp_path, Description(case="c", status="failed", message="OSError: no space" * 500, steps_done=7))
    assert (tmp_path / "run.json").stat().st_size == size > SPARE
    read = read_description(tmp_path)
    assert (read.status, read.steps_done) == ("failed", 7) and read.message.startswith("OSError: no space")


def test_a_run_is_said_to_have_finished_when_all_is_written(case_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed before that it goes on; a sweep would take it for whole."""
    said = []
    monkeypatch.setattr(outputs, "write_hdf5", lambda *ignored: said.append(read_description(tmp_path / "out").status))
    run_case(load_case(case_folder), {"steps": "1"}, tmp_path / "out", PLAIN)
    assert said == ["running"] and read_description(tmp_path / "out").status == "finished"


def test_vtk_files_from_elsewhere_are_not_read(run: Path, tmp_path: Path) -> None:
    (run / "vtk").mkdir()
    (tmp_path / "secret.vtu").write_text("x")
    entry = '<VTKFile><Collection><DataSet timestep="1.0" file="../../secret.vtu"/></Collection></VTKFile>'
    (run / "vtk" / "blocks.pvd").write_text(entry)
    with pytest.raises(InputError, match="expected a place within"):
        open_run(run)


def test_a_path_among_the_parameters(case_folder: Path, run: Path, tmp_path: Path) -> None:
    """It failed once the old run was deleted."""
    script = case_folder / "two_blocks.py"
    text = script.read_text().replace(
        "    E: float = 1e7", "    E: float = 1e7\n    mesh: Path = Path('a.msh')\n    limit: float | None = None"
    )
    script.write_text(text.replace("import numpy as np", "from pathlib import Path\n\nimport numpy as np"))
    run_case(load_case(case_folder), {"steps": "1", "mesh": "b.msh", "limit": "3"}, run, PLAIN, overwrite=True)
    assert read_description(run).parameters["mesh"] == "b.msh" and read_description(run).parameters["limit"] == 3.0
    assert run_case(load_case(case_folder), {"steps": "2"}, run, PLAIN, resume=True).computed == 1


def test_copies_go_on(case_folder: Path, run: Path, tmp_path: Path) -> None:
    """A run's folder is its own: moved or copied, it goes on."""
    shutil.copytree(run, tmp_path / "copy")
    assert run_case(load_case(case_folder), {"steps": "5"}, tmp_path / "copy", PLAIN, resume=True).computed == 1
    with h5py.File(tmp_path / "copy" / "checkpoint.h5") as file:
        assert np.isfinite(file["x"][()]).all() and len(file.attrs["sha256"]) == 64


def sensing(folder: Path, call: str) -> CaseScript:
    """The case with a call in its sensor, at each step."""
    script = folder / "two_blocks.py"
    text = script.read_text()
    assert text.count("lambda s: ") == 1
    text = text.replace("lambda s: ", f"lambda s: 0 * ({call}) + ").replace(
        "import numpy as np", "import os\nimport sys\n\nimport numpy as np"
    )
    script.write_text(text)
    return load_case(folder)


def test_a_script_that_goes_elsewhere(case_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """os.chdir in a script took the results along."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    script = sensing(case_folder, f"os.chdir({str(tmp_path / 'elsewhere')!r}) or 0")
    options = RunOptions(export_every=1, vtk_every=1, checkpoint_every=1)
    assert run_case(script, {"steps": "2"}, "out", options).status == "finished"
    assert not any((tmp_path / "elsewhere").iterdir()) and len(open_run(tmp_path / "out").columns["step"]) == 2


def test_a_sensor_that_forks(case_folder: Path, tmp_path: Path) -> None:
    """The copy of the program had the run's lock too and wrote every row again."""
    script = sensing(case_folder, "0 if s.number != 2 or (child := os.fork()) == 0 else os.waitpid(child, 0)[0] * 0")
    assert run_case(script, {"steps": "4"}, tmp_path / "out", PLAIN).status == "finished"
    assert open_run(tmp_path / "out").columns["step"].tolist() == [1, 2, 3, 4]


def test_a_sensor_that_leaves(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With sys.exit(0), which was the exit code."""
    sensing(case_folder, "0 if s.number < 2 else sys.exit(0)")
    assert main(["run", str(case_folder), "--out", str(tmp_path / "out"), "--vtk-every", "0", "--export-every", "0"]) == 2
    assert "a script ended the program (SystemExit: 0)" in capsys.readouterr().err
    found = read_description(tmp_path / "out")
    assert (found.status, found.message) == ("failed", "SystemExit: 0")
