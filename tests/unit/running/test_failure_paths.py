"""What `fcsim run` does with problems that have no answer: one clear message, the exit code, nothing or whole files on the disk."""

import csv
import json
import resource
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fcsim.command_line import run as run_command
from fcsim.command_line.main import main
from fcsim.mesh.blocks import brick
from fcsim.mesh.io import write_mesh
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part
from fcsim.running import description, outputs
from fcsim.running.checkpoint import read_checkpoint
from fcsim.timestep.step import Step

SCRIPT = """
from dataclasses import dataclass
from pathlib import Path

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.running.case import Case
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rigid_box
from fcsim.mesh.io import read_mesh
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation


@dataclass(frozen=True)
class Parameters:
    mesh: str = "block.msh"
    surface: str = "z-"
    held: bool = True
    twice: float = -0.01
    max_iterations: int = 200
    cuttings: int = 3
    steps: int = 4


def build(p):
    block = Body("block", read_mesh(Path(__file__).parent / p.mesh, Material(1e6, 0.3, 1000.0)))
    plane = rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)
    supports = [Support("plane", ("x", "y", "z", "rx", "ry", "rz"))]
    if p.held:
        supports += [
            Support("block", ("z",), "z+", velocity=-0.01),
            Support("block", ("z",), "z+", velocity=p.twice),
            Support("block", ("x",), "z+", velocity=lambda t: 0.02 * (t > 0.5)),
            Support("block", ("y",), "z+"),
        ]
    model = build_model([block, plane], supports=supports, gravity=lambda t: (0, 0, -9.81))
    pair = SurfacePair(contact_surface(model, [("block", p.surface)]), contact_surface(model, [("plane", "z+")]), 0.5, 1e-1)
    settings = SolverSettings(name="NSN-AC", options={"max_iterations": p.max_iterations}, fallback=())
    simulation = Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(0.25), p.steps, settings, cuttings=p.cuttings)
    return Case("press", "A pressed block", simulation)
"""
QUIET = ("--export-every", "0", "--vtk-every", "0")

pytestmark = pytest.mark.usefixtures("read_here")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A case that reads its mesh from a file beside it."""
    (tmp_path / "press").mkdir()
    (tmp_path / "press" / "press.py").write_text(SCRIPT)
    write_mesh(block(), tmp_path / "press" / "block.msh")
    return tmp_path / "press"


def block() -> Part:
    return brick("block", (1.0, 0.4, 0.3), (4, 3, 2), Material(1e6, 0.3, 1000.0))


def with_a_hole() -> Part:
    """One of the cells below which the contact surface is named is missing."""
    whole = block()
    lost = int(np.argmin(np.linalg.norm(whole.points[whole.cells].mean(axis=1) - [0.4, 0.2, 0.05], axis=1)))
    return Part("block", whole.points, np.delete(whole.cells, lost, axis=0), whole.cell_type, whole.surfaces, whole.material)


def run(folder: Path, out: Path, *sets: str) -> int:
    return main(["run", str(folder), "--out", str(out), *QUIET, *(word for text in sets for word in ("--set", text))])


def test_the_case_itself_runs(folder: Path, tmp_path: Path) -> None:
    assert run(folder, tmp_path / "out") == 0


def test_a_hole_where_the_contact_surface_was_named(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_mesh(with_a_hole(), folder / "hole.msh")
    assert run(folder, tmp_path / "out", "mesh=hole.msh") == 2
    said = capsys.readouterr().err
    assert "hole.msh, surface 'z-': expected facets on the boundary of a volume, got 1 of 12 that are not" in said
    assert said.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_contact_surface_that_the_mesh_has_not(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, tmp_path / "out", "surface=bottom") == 2
    assert "body 'block': expected a surface among" in (said := capsys.readouterr().err) and "got 'bottom'" in said
    assert not (tmp_path / "out").exists()


def test_an_unsupported_body_in_statics(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, tmp_path / "out", "held=off") == 2
    said = capsys.readouterr().err
    assert (
        "body 'block': statics with eta = 0 expect supports that exclude rigid motion; it is free to move. Add supports, or choose" in said
    )
    assert not (tmp_path / "out").exists()


def test_contradictory_driven_dofs(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, tmp_path / "out", "twice=0.02") == 2
    assert "of body 'block' is driven twice and differently, by the supports 1 and 2" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_earlier_run_survives_bad_input(folder: Path, tmp_path: Path) -> None:
    assert run(folder, tmp_path / "out") == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()}
    for bad in ("surface=bottom", "held=off", "twice=0.02", "mesh=none.msh"):
        assert main(["run", str(folder), "--out", str(tmp_path / "out"), "--overwrite", "--set", bad]) == 2
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()} == before


def test_a_step_that_cannot_converge_even_when_cut(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One iteration is too few once sliding begins; what was computed before is whole and can be gone on with."""
    out = tmp_path / "out"
    assert run(folder, out, "max_iterations=1", "cuttings=2") == 1
    about = json.loads((out / "run.json").read_text())
    done = about["steps_done"]
    assert about["status"] == "not converged" and 0 < done < 4
    message = about["message"]
    assert f"step {done + 1} did not converge to 1e-08 (NSN-AC from previous steps: maximum number of iterations reached, error" in message
    assert f"from t = {0.25 * done:g} to {0.25 * (done + 1):g} s: cut into parts of h/2 to h/4 = 0.0625 s" in message
    assert "did not converge" in capsys.readouterr().out
    with (out / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["step"]) for row in rows] == list(range(1, done + 1))
    with h5py.File(out / "steps.h5") as file:
        np.testing.assert_array_equal(file["step"][()], np.arange(1, done + 1))
        assert file["load_work"].attrs["unit"] == "J"
    checkpoint = read_checkpoint(out / "checkpoint.h5")
    assert checkpoint is not None and checkpoint[0].number == done
    assert not list(out.rglob("*.partial*"))
    shutil.copytree(out, tmp_path / "again")
    assert main(["run", str(folder), "--out", str(tmp_path / "again"), "--resume", *QUIET]) == 1  # the same again, no worse


def test_a_regularisation_that_is_too_small(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only the first step can tell: the run fails with its message in run.json."""
    script = folder / "press.py"
    script.write_text(SCRIPT.replace("QuasiStatic(0.25)", "QuasiStatic(0.25, 1e-12)"))
    assert run(folder, tmp_path / "out", "held=off") == 2
    assert "part 'block': its system matrix is singular" in capsys.readouterr().err
    about = json.loads((tmp_path / "out" / "run.json").read_text())
    assert about["status"] == "failed" and "larger eta" in about["message"]
    assert "regularised by the mass: eta = 1e-12" in about["notes"][0]


def test_a_full_disk(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The second FCLIB file does not fit: one line that names it, exit code 2, whole files of what came before, and --resume goes on."""
    out = tmp_path / "out"
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def fill_the_disk(*ignored: object) -> None:
        while not (files := list((out / "fclib").rglob("FCSIM*.hdf5"))):  # which may be written beside the next step
            time.sleep(0.01)
        smallest = min(path.stat().st_size for path in files)
        resource.setrlimit(resource.RLIMIT_FSIZE, (smallest // 2, limits[1]))

    monkeypatch.setattr(run_command, "show_step", fill_the_disk)
    arguments = ["run", str(folder), "--out", str(out), "--export-every", "1", "--vtk-every", "0"]
    try:
        assert main(arguments) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    said = capsys.readouterr().err
    assert "File too large" in said and "-00002.hdf5" in said and "Traceback" not in said
    assert [path.name[-10:] for path in (out / "fclib" / "global").iterdir()] == ["00001.hdf5"]
    assert json.loads((out / "run.json").read_text())["status"] == "failed"
    monkeypatch.undo()
    assert main([*arguments, "--resume"]) == 0
    assert sorted(path.name[-10:] for path in (out / "fclib" / "global").iterdir()) == [f"{step:05d}.hdf5" for step in (1, 2, 3, 4)]


def test_a_disk_without_room_for_a_run(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """run.json fits, but not its room for the end: the file is named, and the run is not said to be running."""
    out, arguments = tmp_path / "out", ["--export-every", "0", "--vtk-every", "0"]
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    monkeypatch.setattr(description, "SPARE", 1 << 22)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 21, limits[1]))
    try:
        assert main(["run", str(folder), "--out", str(out), *arguments]) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert "run.json: File too large" in capsys.readouterr().err
    assert json.loads((out / "run.json").read_text())["status"] == "failed"
    assert main(["run", str(folder), "--out", str(out), *arguments, "--resume"]) == 0


def test_a_disk_that_fills_within_a_row(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a row goes again, and does not become whole when there is room later: the table and run.json tell of the same steps."""
    out, made = tmp_path / "out", outputs.StepTable.write
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def with_little_room(*arguments: object) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, ((out / "steps.csv").stat().st_size + 50, limits[1]))
        try:
            made(*arguments)  # type: ignore[arg-type]
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    monkeypatch.setattr(outputs.StepTable, "write", with_little_room)
    arguments = ["run", str(folder), "--out", str(out), "--export-every", "0", "--vtk-every", "0"]
    try:
        assert main(arguments) == 2
    finally:
        signal.signal(signal.SIGXFSZ, handler)
    about = json.loads((out / "run.json").read_text())
    assert (about["status"], about["steps_done"]) == ("failed", 0) and "steps.csv" in about["message"]
    assert len((out / "steps.csv").read_text().splitlines()) == 1  # the header
    monkeypatch.undo()
    assert main([*arguments, "--resume"]) == 0


@pytest.mark.parametrize("fails", [False, True])
def test_rows_that_wait_for_slow_files(
    fails: bool, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In their order after those of the step with the files; none where these could not be written, and --resume goes on."""
    out, made = tmp_path / "out", outputs.FclibSeries.files

    def slow(series: outputs.FclibSeries, step: Step, title: str) -> list[Callable[[], Path]]:
        def write() -> Path:
            time.sleep(0.5)
            if fails:
                raise OSError(f"no room for step {step.number}")
            return made(series, step, title)[0]()

        return [write]

    monkeypatch.setattr(outputs.FclibSeries, "files", slow)
    monkeypatch.setattr(outputs.Outputs, "_may_be_beside", True)
    arguments = ["run", str(folder), "--out", str(out), "--set", "steps=7", "--export-every", "3", "--vtk-every", "0"]
    arguments += ["--checkpoint-every", "2"]
    assert main(arguments) == (2 if fails else 0)
    with (out / "steps.csv").open(newline="") as file:
        numbers = [int(row["step"]) for row in csv.DictReader(file)]
    assert numbers == ([1, 2] if fails else [1, 2, 3, 4, 5, 6, 7])
    if fails:
        assert "no room for step 3" in capsys.readouterr().err
        monkeypatch.undo()
        assert main([*arguments, "--resume"]) == 0
        assert len(list((out / "fclib" / "global").iterdir())) == 2
