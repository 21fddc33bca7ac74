"""Runs of one step, without contacts, without a series: drawn without a warning."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

from fcsim.command_line.main import main
from fcsim.running.case import load_case
from fcsim.running.folder import open_run
from fcsim.running.run import RunOptions, run_case
from fcsim.view import render
from fcsim.view.scene import read

pytest.importorskip("pyvista")
pytestmark = pytest.mark.usefixtures("small_pictures")
SCRIPT = """
from dataclasses import dataclass

from fcsim import Case, ExactContacts, Simulation, Support, Theta, build_model
from fcsim.mesh import rigid_plane, rigid_sphere


@dataclass(frozen=True)
class Parameters:
    steps: int = 1
    height: float = 5.0


def build(p: Parameters) -> Case:
    '''A ball above a floor.'''
    bodies = [rigid_sphere("ball", 0.1, (0.0, 0.0, p.height), 1.0), rigid_plane("floor", (0, 0, 0), (0, 0, 1))]
    held = [Support("floor", ("x", "y", "z", "rx", "ry", "rz"))]
    model = build_model(bodies, supports=held, gravity=lambda t: (0.0, 0.0, -9.81))
    return Case("ball", "A ball", Simulation(model, ExactContacts(model, 0.5), Theta(1e-3), p.steps))
"""


@pytest.mark.parametrize(
    ("given", "vtk_every", "drawn"),
    [
        ({"steps": "1"}, 1, {"bodies.png", "contacts.png"}),
        ({"steps": "1"}, 0, set()),
        ({"steps": "2", "height": "0.1"}, 1, {"bodies.png", "contacts.png", "instants.png"}),
    ],
)
def test_odd_runs_are_drawn_without_a_warning(tmp_path: Path, given: dict[str, str], vtk_every: int, drawn: set[str]) -> None:
    folder = tmp_path / "Fälle mit Leerzeichen" / "ball"
    folder.mkdir(parents=True)
    (folder / "ball.py").write_text(SCRIPT)
    run = folder / "größe ü"
    run_case(load_case(folder), given, run, RunOptions(export_every=0, vtk_every=vtk_every))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        files = render(run, film=None, page=True)
    assert {path.name for path in files if path.parent.name == "pictures"} == drawn
    assert files[-1] == run / "page.html" and files[-1].stat().st_size > 1e6


def test_a_run_without_a_series_says_why_there_are_no_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "ball"
    folder.mkdir()
    (folder / "ball.py").write_text(SCRIPT)
    run_case(load_case(folder), {"steps": "1"}, folder / "run", RunOptions(export_every=0, vtk_every=0))
    assert main(["render", str(folder / "run")]) == 0
    said = capsys.readouterr()
    assert "no pictures and no film: the run has no VTK files" in said.err and "plots" in said.out
    assert main(["render", str(folder / "run"), "--quiet"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["render", str(folder / "run"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert "text" not in told and all(Path(file).is_file() for file in told["files"]) and told["run"] == str(folder / "run")


HOPELESS = (
    SCRIPT.replace("Theta(1e-3)", "Theta(1e-3, law=Hopeless(solved=p.solved))").replace(
        "height: float = 5.0", "height: float = 5.0\n    solved: int = 0"
    )
    + """

from fcsim import Gap
from fcsim.errors import NotConverged


@dataclass(frozen=True)
class Hopeless(Gap):
    solved: int = 0

    def terms(self, meeting):
        if meeting.t > (self.solved - 0.5) * 1e-3:
            raise NotConverged(f"step {self.solved + 1} did not converge")
        return super().terms(meeting)
"""
)


@pytest.mark.parametrize("failing", [1, 3])
def test_a_run_that_fails_before_its_first_instant_leaves_one(tmp_path: Path, failing: int, capsys: pytest.CaptureFixture[str]) -> None:
    """In its first step: the beginning, with the contacts found there; later: the last step that was solved. It left nothing to draw."""
    folder, run = tmp_path / "ball", tmp_path / "run"
    folder.mkdir()
    (folder / "ball.py").write_text(HOPELESS)
    given = {"steps": "5", "height": "0.1", "solved": str(failing - 1)}
    assert run_case(load_case(folder), given, run, RunOptions(export_every=0)).status == "not converged"
    (instant,) = open_run(run).instants
    assert instant.t == pytest.approx(1e-3 * (failing - 1)) and instant.rigid is not None and instant.contacts is not None
    contacts = read(instant.contacts)
    if failing == 1:
        assert contacts.n_points == 1 and not np.any(contacts["reaction"]) and contacts["status"].tolist() == [0]
    assert {path.name for path in render(run, film=None) if path.parent.name == "pictures"} == {"bodies.png", "contacts.png"}


ROLLS = """
from dataclasses import dataclass

import numpy as np

from fcsim import Case, Everything, Simulation, Support, Theta, build_model
from fcsim.mesh import rigid_rectangle
from fcsim.mesh.solids.rigid_polygon import rigid_polygon
from fcsim.timestep.state import at_rest


@dataclass(frozen=True)
class Parameters:
    steps: int = 40
    sides: int = 64


def build(p: Parameters) -> Case:
    angle = 2 * np.pi * (np.arange(p.sides) + 0.5) / p.sides - np.pi / 2
    height = 0.1 * np.cos(np.pi / p.sides)
    disk = rigid_polygon("disk", 0.1 * np.column_stack([np.cos(angle), np.sin(angle)]) + [0.0, height], density=2000.0)
    floor = rigid_rectangle("floor", (2.0, 0.1), (0.0, -0.05), 1.0)
    model = build_model([floor, disk], supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, -9.81))
    initial = at_rest(model)
    initial.v[3:] = [1.0, 0.0, -1.0 / height] if p.sides > 8 else [0.0, 0.0, 4.0]
    contact = Everything(model, 0.5, curved=["disk"] if p.sides > 8 else [])
    return Case("rolls", "It rolls", Simulation(model, contact, Theta(2e-3), p.steps, initial=initial))
"""


def test_what_a_disk_rolls_on_from_is_no_crack_and_what_a_box_rocks_on_is(tmp_path: Path) -> None:
    (tmp_path / "rolls").mkdir()
    (tmp_path / "rolls" / "rolls.py").write_text(ROLLS)
    found = {}
    for sides in (64, 4):
        run = tmp_path / str(sides)
        steps = 60 if sides == 64 else 10
        run_case(load_case(tmp_path / "rolls"), {"sides": str(sides), "steps": str(steps)}, run, RunOptions(export_every=0, vtk_every=5))
        found[sides] = {path.name for path in render(run, film=None) if path.parent.name == "pictures"}
    assert "cracks.png" not in found[64] and "cracks.png" in found[4]
