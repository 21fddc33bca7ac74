"""Runs into a folder: files, refusals, interruption and going on."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.running.case import Case, load_case
from fcsim.running.fclib_series import write_step
from fcsim.running.run import RunOptions, run_case
from fcsim.timestep.step import Step

Rows = Callable[[Path], list[dict[str, str]]]
PLAIN = RunOptions(export_every=0, vtk_every=0, checkpoint_every=4)


def snapshot(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in sorted(directory.rglob("*")) if path.is_file()}


def checkpoint(directory: Path) -> dict[str, Any]:
    with h5py.File(directory / "checkpoint.h5") as file:
        names = ("x", "v", "memory/0/identity", "memory/0/frame", "memory/0/r")
        return {"step": file.attrs["step"], "t": file.attrs["t"], **{name: file[name][()] for name in names}}


def assert_same_end(one: Path, other: Path, rows: Rows) -> None:
    assert rows(one) == rows(other)
    first, second = checkpoint(one), checkpoint(other)
    for name in first:
        assert_array_equal(first[name], second[name], err_msg=name)


@pytest.fixture
def whole(case_folder: Path, tmp_path: Path) -> Path:
    """An uninterrupted run of 12 steps."""
    run_case(load_case(case_folder), {}, tmp_path / "whole", PLAIN)
    return tmp_path / "whole"


def test_files_of_a_run(case_folder: Path, tmp_path: Path, steps_without_seconds: Rows) -> None:
    out = tmp_path / "deep" / "out"
    seen: list[Step] = []
    options = RunOptions(export_every=5, export_forms=("global", "local"), vtk_every=4)
    summary = run_case(load_case(case_folder), {"steps": "10", "E": "2e7"}, out, options, watch=lambda case, step: seen.append(step))
    assert (summary.status, summary.steps, summary.computed, summary.converged) == ("finished", 10, 10, True)
    assert summary.iterations == sum(step.iterations for step in seen)
    assert sorted(entry.name for entry in out.iterdir()) == ["checkpoint.h5", "fclib", "run.json", "steps.csv", "steps.h5", "vtk"]
    about = json.loads((out / "run.json").read_text())
    assert (about["status"], about["steps_done"], about["parameters"]["E"]) == ("finished", 10, 2e7)
    assert about["plots"]["imposed"] == {"column": "x", "label": "displacement", "unit": "m"}
    assert about["plots"]["bound"] == {"value": 1.0, "label": "a bound"}
    rows = steps_without_seconds(out)
    assert [int(row["step"]) for row in rows] == list(range(1, 11))
    for row, step in zip(rows, seen, strict=True):
        assert int(row["nc"]) == len(step.contacts)
        assert float(row["error"]) == pytest.approx(step.result.error, rel=1e-9)
        assert float(row["lift"]) == pytest.approx(step.contact_force_on(1)[2], rel=1e-9, abs=1e-12)
        assert row["status"] == "SOLVED"
    assert float(rows[-1]["lift"]) > 0
    assert sorted(path.name for path in (out / "vtk").glob("blocks_*")) == ["blocks_00004.vtu", "blocks_00008.vtu", "blocks_00010.vtu"]
    for form in ("global", "local"):
        files = sorted((out / "fclib" / form).iterdir())
        assert sorted(int(path.stem[-5:]) for path in files) == [5, 10]
        content = read_fclib(next(path for path in files if path.stem.endswith("00010")))
        assert content.form == form and content.solution is not None
        assert_array_equal(content.solution.r, seen[-1].result.r)
        assert_array_equal(content.guesses[0].r, seen[-1].start)
    assert not list(out.rglob("*.partial"))


def test_files_of_a_run_are_those_of_its_steps_alone(case_folder: Path, tmp_path: Path) -> None:
    """What stays from step to step is compressed once for all files; none may hold a neighbour's numbers."""
    options = RunOptions(export_every=1, export_forms=("global", "local"), vtk_every=0)

    def write_alone(case: Case, step: Step) -> None:
        write_step(tmp_path / "alone", step, case.fclib_set, ("global", "local"))

    run_case(load_case(case_folder), {"steps": "6"}, tmp_path / "out", options, watch=write_alone)
    files = sorted((tmp_path / "alone").rglob("*.hdf5"))
    assert len(files) == 12
    for path in files:
        with h5py.File(path) as alone, h5py.File(tmp_path / "out" / "fclib" / path.relative_to(tmp_path / "alone")) as of_run:
            names: list[str] = []
            alone.visititems(lambda name, entry, names=names: names.append(name) if isinstance(entry, h5py.Dataset) else None)
            assert {"solution/r", "guesses/1/r", f"fclib_{path.parent.name}/vectors/mu"} < set(names)
            for name in names:
                assert "/info/" in name or alone[name][()].tobytes() == of_run[name][()].tobytes(), name


def test_the_table_as_hdf5(case_folder: Path, tmp_path: Path, steps_without_seconds: Rows) -> None:
    """The same numbers as steps.csv, with units and the sensors' labels; what a case plots over time is in run.json."""
    script = case_folder / "two_blocks.py"
    text = script.read_text().replace("import Case, Sensor", "import Case, History, Sensor")
    script.write_text(text.replace('plots={"imposed"', 'plots={"histories": (History("lift", ("lift",)),), "imposed"'))
    run_case(load_case(case_folder), {"steps": "5"}, tmp_path / "out", PLAIN)
    rows = steps_without_seconds(tmp_path / "out")
    with h5py.File(tmp_path / "out" / "steps.h5") as file:
        assert set(file) >= set(rows[0])
        for name in ("t", "lift", "kinetic_energy", "load_work", "energy_residual"):
            assert_array_equal(file[name][()], [float(row[name]) for row in rows])
        assert file["status"].asstr()[0] == "SOLVED"
        assert (file["lift"].attrs["unit"], file["lift"].attrs["label"]) == ("N", "vertical force on the upper block")
        assert (file["t"].attrs["unit"], file["load_work"].attrs["unit"], file["nc"].attrs["unit"]) == ("s", "J", "")
    about = json.loads((tmp_path / "out" / "run.json").read_text())
    curve = {"column": "lift", "label": "vertical force on the upper block", "unit": "N"}
    assert about["plots"]["histories"] == [{"name": "lift", "against": {"column": "t", "label": "time", "unit": "s"}, "curves": [curve]}]
    assert about["scheme"].startswith("Theta(h=0.001, theta=0.5, law=Gap(")


def test_a_step_without_contacts_is_written(case_folder: Path, tmp_path: Path) -> None:
    """Lifted off: gravity points up."""
    script = (case_folder / "two_blocks.py").read_text().replace("(2.0, 0, -9.81)", "(0, 0, 5000.0)").replace("0.3, 1e-3", "0.3, 1e-6")
    (case_folder / "two_blocks.py").write_text(script)
    options = RunOptions(export_every=1, export_forms=("global", "local"), vtk_every=1)
    run_case(load_case(case_folder), {"steps": "2"}, tmp_path / "out", options)
    for form in ("global", "local"):
        last = next((tmp_path / "out" / "fclib" / form).glob("*-00002.hdf5"))
        assert read_fclib(last).problem.mu.shape == (0,)


def test_nothing_is_written_for_bad_input(case_folder: Path, tmp_path: Path) -> None:
    script = load_case(case_folder)
    for bad in ({"height": "1"}, {"E": "x"}, {"E": "-1"}, {"solver": "NSN-XX"}, {"tol": "0"}, {"steps": "-2"}, {"divisions": "0,1,1"}):
        with pytest.raises(InputError):
            run_case(script, bad, tmp_path / "out")
        assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="vtk-every"):
        run_case(script, {}, tmp_path / "out", RunOptions(vtk_every=-1))


def test_going_on_and_beginning_anew_are_not_done_at_once(case_folder: Path, whole: Path) -> None:
    before = snapshot(whole)
    with pytest.raises(InputError, match="--resume, --overwrite: expected one of them, got both"):
        run_case(load_case(case_folder), {}, whole, resume=True, overwrite=True)
    assert snapshot(whole) == before


def test_more_steps_of_a_time_that_they_divide_are_another_run(case_folder: Path, tmp_path: Path) -> None:
    """What a user who wants more steps is told: which h came of it, once, and that the run cannot go on; nor is it said to."""
    script = case_folder / "two_blocks.py"
    script.write_text(script.read_text().replace("Theta(1e-3)", "Theta(4e-3 / p.steps)"))
    run_case(load_case(case_folder), {"steps": "2"}, tmp_path / "out", PLAIN)
    with pytest.raises(InputError, match=r"h was 0.002, is 0.001 with 4 steps in place of 2: where the case divides its time") as raised:
        run_case(load_case(case_folder), {"steps": "4"}, tmp_path / "out", PLAIN, resume=True)
    assert "scheme" not in str(raised.value)
    said = run_case(load_case(case_folder), {}, tmp_path / "out", PLAIN, resume=True).message
    assert said.endswith("--resume --steps 4 goes on with it, unless the case divides its time by them")


def test_a_run_of_no_steps_says_so(case_folder: Path, tmp_path: Path) -> None:
    assert "none was computed" in run_case(load_case(case_folder), {"steps": "0"}, tmp_path / "out", PLAIN).message


def test_an_earlier_run_is_kept_unless_told(case_folder: Path, whole: Path, steps_without_seconds: Rows) -> None:
    script, before = load_case(case_folder), snapshot(whole)
    with pytest.raises(InputError, match=r"go on with --resume, replace it with --overwrite"):
        run_case(script, {}, whole)
    with pytest.raises(InputError):  # an error in what should replace it
        run_case(script, {"E": "-1"}, whole, overwrite=True)
    with pytest.raises(InputError):
        run_case(script, {"solver": "NSN-XX"}, whole, overwrite=True)
    assert snapshot(whole) == before
    run_case(script, {"steps": "2"}, whole, PLAIN, overwrite=True)
    assert len(steps_without_seconds(whole)) == 2


def test_foreign_folders_are_never_touched(case_folder: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("x")
    for options in ({}, {"overwrite": True}):
        with pytest.raises(InputError, match=r"found thesis\.tex"):
            run_case(load_case(case_folder), {}, tmp_path / "mine", **options)  # type: ignore[arg-type]
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]
    with pytest.raises(InputError, match="found a file"):
        run_case(load_case(case_folder), {}, tmp_path / "mine" / "thesis.tex")


@pytest.mark.parametrize(
    ("out", "message"), [("/dev/null/x", "/dev/null, in which it would be, is a file"), ("/proc/x/y", "it cannot be made|nothing may be")]
)
def test_folders_that_cannot_be_made_are_refused_by_name(case_folder: Path, out: str, message: str) -> None:
    with pytest.raises(InputError, match=f"^{out}: expected a folder for the results, and .*({message})"):
        run_case(load_case(case_folder), {}, out)


@pytest.mark.parametrize("at", [1, 4, 7])
def test_interrupted_and_resumed(case_folder: Path, tmp_path: Path, whole: Path, steps_without_seconds: Rows, at: int) -> None:
    def interrupt(case: Case, step: Step) -> None:
        if step.number == at:
            raise KeyboardInterrupt

    script, out = load_case(case_folder), tmp_path / "out"
    summary = run_case(script, {}, out, PLAIN, watch=interrupt)
    assert (summary.status, summary.steps) == ("interrupted", at)
    assert json.loads((out / "run.json").read_text())["status"] == "interrupted"
    assert len(steps_without_seconds(out)) == at
    summary = run_case(script, {}, out, PLAIN, resume=True)
    assert (summary.status, summary.steps, summary.computed) == ("finished", 12, 12 - at)
    assert_same_end(out, whole, steps_without_seconds)


def test_interrupt_inside_compiled_code(case_folder: Path, tmp_path: Path) -> None:
    """A kernel that Ctrl-C strikes raises SystemError from KeyboardInterrupt; a SystemError of its own stays one."""

    def struck(case: Case, step: Step) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("CPUDispatcher returned a result with an exception set") from error

    def broken(case: Case, step: Step) -> None:
        raise SystemError("something else")

    script = load_case(case_folder)
    assert run_case(script, {}, tmp_path / "struck", PLAIN, watch=struck).status == "interrupted"
    with pytest.raises(SystemError, match="something else"):
        run_case(script, {}, tmp_path / "broken", PLAIN, watch=broken)
    assert json.loads((tmp_path / "broken" / "run.json").read_text())["status"] == "failed"


def test_steps_after_the_checkpoint_are_computed_again(case_folder: Path, tmp_path: Path, whole: Path, steps_without_seconds: Rows) -> None:
    """A machine that stopped dead: rows and files beyond the last checkpoint, the last row cut."""
    script, out = load_case(case_folder), tmp_path / "out"
    everything = RunOptions(export_every=1, vtk_every=1, checkpoint_every=4)
    run_case(script, {"steps": "4"}, out, everything)
    kept = (out / "checkpoint.h5").read_bytes()
    run_case(script, {"steps": "7"}, out, everything, resume=True)
    (out / "checkpoint.h5").write_bytes(kept)
    table = (out / "steps.csv").read_bytes()
    (out / "steps.csv").write_bytes(table[:-30])
    run_case(script, {"steps": "12"}, out, everything, resume=True)
    assert_same_end(out, whole, steps_without_seconds)
    assert len(list((out / "fclib" / "global").iterdir())) == 12
    straight = tmp_path / "straight"
    run_case(script, {}, straight, everything)
    collection = (out / "vtk" / "run.pvd").read_text()
    assert collection == (straight / "vtk" / "run.pvd").read_text()
    assert sorted(p.name for p in (out / "fclib" / "global").iterdir()) == sorted(p.name for p in (straight / "fclib" / "global").iterdir())


def test_a_run_can_be_made_longer(case_folder: Path, tmp_path: Path, whole: Path, steps_without_seconds: Rows) -> None:
    script, out = load_case(case_folder), tmp_path / "out"
    run_case(script, {"steps": "5"}, out, PLAIN)
    summary = run_case(script, {"steps": "12"}, out, PLAIN, resume=True)
    assert summary.computed == 7
    assert_same_end(out, whole, steps_without_seconds)
    before = snapshot(out)
    assert run_case(script, {}, out, PLAIN, resume=True).computed == 0  # nothing left to do
    assert snapshot(out)["steps.csv"] == before["steps.csv"] and snapshot(out)["checkpoint.h5"] == before["checkpoint.h5"]


def test_resuming_is_refused_where_it_would_be_another_run(case_folder: Path, whole: Path, tmp_path: Path) -> None:
    script, before = load_case(case_folder), snapshot(whole)
    with pytest.raises(InputError, match=r"first run's E = 10000000\.0, got 20000000\.0"):
        run_case(script, {"E": "2e7"}, whole, resume=True)
    with pytest.raises(InputError, match="at least the 12 steps"):
        run_case(script, {"steps": "3"}, whole, resume=True)
    with pytest.raises(InputError, match=r"found no run\.json"):
        run_case(script, {}, tmp_path / "nowhere", resume=True)
    other = tmp_path / "other.py"
    other.write_text((case_folder / "two_blocks.py").read_text())
    with pytest.raises(InputError, match=r"expected a run of case 'other'"):
        run_case(load_case(other), {}, whole, resume=True)
    edited = (case_folder / "two_blocks.py").read_text().replace("E: float = 1e7", "E: float = 3e7")
    (case_folder / "two_blocks.py").write_text(edited)
    with pytest.raises(InputError, match="first run's E"):
        run_case(load_case(case_folder), {}, whole, resume=True)
    assert snapshot(whole) == before


def test_resuming_takes_the_same_values_written_otherwise(case_folder: Path, whole: Path) -> None:
    summary = run_case(load_case(case_folder), {"E": "1.0e+7", "solver": "NSN-AC", "steps": "13"}, whole, PLAIN, resume=True)
    assert summary.computed == 1


def test_broken_files_of_an_earlier_run(case_folder: Path, whole: Path) -> None:
    script = load_case(case_folder)
    (whole / "checkpoint.h5").write_bytes(b"not HDF5")
    with pytest.raises(InputError, match=r"checkpoint\.h5: expected a checkpoint"):
        run_case(script, {}, whole, resume=True)
    (whole / "run.json").write_text("{")
    with pytest.raises(InputError, match=r"run\.json: expected JSON"):
        run_case(script, {}, whole, resume=True)


def test_unconverged_step_ends_the_run(case_folder: Path, tmp_path: Path, whole: Path, steps_without_seconds: Rows) -> None:
    """No iterations are allowed from step 6 on; what was computed before stays whole, and can be gone on with."""
    script, out = load_case(case_folder), tmp_path / "out"
    text = (case_folder / "two_blocks.py").read_text()
    stop = text.replace("    return Case(", '    settings.options["max_iterations"] = 200\n    return Case(', 1).replace(
        "    def lift(step):\n",
        '    def lift(step):\n        if step.number == 5:\n            settings.options["max_iterations"] = 0\n',
        1,
    )
    assert stop != text
    (case_folder / "two_blocks.py").write_text(stop)
    summary = run_case(load_case(case_folder), {"fallback": "off"}, out, PLAIN)
    assert (summary.status, summary.steps, summary.converged) == ("not converged", 5, False)
    assert "step 6 did not converge to 1e-08" in summary.message
    about = json.loads((out / "run.json").read_text())
    assert (about["status"], about["steps_done"], about["message"]) == ("not converged", 5, summary.message)
    assert steps_without_seconds(out) == steps_without_seconds(whole)[:5]
    assert checkpoint(out)["step"] == 5
    (case_folder / "two_blocks.py").write_text(text)
    with pytest.raises(InputError, match=r"two_blocks\.py has changed"):
        run_case(script, {}, out, PLAIN, resume=True)
    run_case(script, {}, out, PLAIN, resume=True, accept_changes=True)
    assert_same_end(out, whole, steps_without_seconds)
    assert json.loads((out / "run.json").read_text())["notes"] == ["resumed although two_blocks.py has changed"]


def test_an_error_inside_a_run_is_not_called_finished(case_folder: Path, tmp_path: Path) -> None:
    def fail(case: Case, step: Step) -> None:
        if step.number == 3:
            raise RuntimeError("no space left")

    with pytest.raises(RuntimeError, match="no space left"):
        run_case(load_case(case_folder), {}, tmp_path / "out", PLAIN, watch=fail)
    about = json.loads((tmp_path / "out" / "run.json").read_text())
    assert about["status"] == "failed" and "no space left" in about["message"]


@pytest.mark.parametrize(
    ("sent", "code", "by"),
    [
        ("SIGINT", 130, "the keyboard"),
        pytest.param("SIGTERM", 130, "SIGTERM", marks=pytest.mark.slow),  # taken as SIGHUP is, in command_line/test_terminal.py
        ("SIGKILL", -9, ""),
    ],
)
def test_signals(case_folder: Path, tmp_path: Path, whole: Path, steps_without_seconds: Rows, sent: str, code: int, by: str) -> None:
    """A real process is stopped in the middle, which its folder says; resuming gives the uninterrupted run, bit by bit."""
    out, hold = tmp_path / "out", case_folder / "hold"
    hold.touch()
    command = [sys.executable, "-m", "fcsim.command_line.main", "run", str(case_folder), "--out", str(out), "--set", "held=on"]
    arguments = ["--checkpoint-every", "3", "--export-every", "2", "--vtk-every", "2"]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    process = subprocess.Popen(
        [*command, *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        table, deadline = out / "steps.csv", time.monotonic() + 120
        while not (table.is_file() and table.read_text().count("\n") > 5) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(getattr(signal, sent))
        output, _ = process.communicate(timeout=120)
    finally:
        process.kill()
        hold.unlink()
    assert process.returncode == code, output
    about = json.loads((out / "run.json").read_text())
    assert (about["status"], about["message"]) == (("interrupted", f"interrupted by {by}; go on with --resume") if by else ("running", ""))
    done = len(steps_without_seconds(out))
    assert 4 <= done < 12
    summary = run_case(load_case(case_folder), {}, out, PLAIN, resume=True)
    assert summary.status == "finished" and summary.computed <= 12 - (done if sent != "SIGKILL" else 3)
    assert_same_end(out, whole, steps_without_seconds)
    assert np.isfinite(checkpoint(out)["x"]).all()


def test_the_witness_is_asked_for_by_the_command(case_folder: Path, tmp_path: Path) -> None:
    """Overlap is measured as often as the options say, whatever the case has; 0 = never; wrong numbers are refused by name."""
    measured = {}
    for every in (1, 3, 0):
        options = RunOptions(export_every=0, vtk_every=0, checkpoint_every=0, witness_every=every, witness_tolerance=0.1)
        run_case(load_case(case_folder), {"steps": "6"}, tmp_path / str(every), options)
        with (tmp_path / str(every) / "steps.csv").open(newline="") as file:
            measured[every] = [int(row["step"]) for row in csv.DictReader(file) if row["overlap"] != "nan"]
    assert measured == {1: [1, 2, 3, 4, 5, 6], 3: [3, 6], 0: []}
    for wrong, message in (({"witness_every": -1}, "Witness, every"), ({"witness_tolerance": 0.0}, "Witness, tolerance")):
        with pytest.raises(InputError, match=message):
            run_case(load_case(case_folder), {}, tmp_path / "wrong", RunOptions(**wrong))  # type: ignore[arg-type]
