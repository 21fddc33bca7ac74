"""What tests of several rooms share.

A small case script: a brick dropped on a held one, pushed aside; four contacts; a run takes a fraction of a second. Mesh and surface files
read by this process instead of one of their own, for tests of what is read rather than of how.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

import pytest

from fcsim.files import regular

SCRIPT = """
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.running.case import Case, Sensor
from fcsim.command_line.main import main
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta


@dataclass(frozen=True)
class Parameters:
    size: tuple[float, float, float] = (0.2, 0.2, 0.1)
    divisions: tuple[int, int, int] = (2, 2, 1)
    E: float = 1e7
    held: bool = False
    rule: Literal["nodes", "faces"] = "nodes"
    max_iterations: int = 200
    fallback: bool = True
    steps: int = 12
    solver: str = "NSN-AC"
    tol: float = 1e-8


def build(p):
    part = brick("brick", p.size, p.divisions, Material(p.E, 0.2, 2000.0))
    model = build_model(
        [Body("lower", part), Body("upper", part, translation=np.array([0.03, 0.02, p.size[2]]))],
        supports=[Support("lower", ("x", "y", "z"), "z-")],
        gravity=lambda t: (2.0, 0, -9.81),
        beta=1e-3,
    )
    pair = SurfacePair(contact_surface(model, [("upper", "z-")]), contact_surface(model, [("lower", "z+")]), 0.3, 1e-3, p.rule)
    chain = {} if p.fallback else {"fallback": ()}
    settings = SolverSettings(name=p.solver, tol=p.tol, options={"max_iterations": p.max_iterations}, **chain)

    def lift(step):
        while p.held and step.number > 8 and (Path(__file__).parent / "hold").exists():  # whoever holds it decides, not the clock
            time.sleep(0.01)
        return float(step.contact_force_on(1)[2])

    return Case(
        "two_blocks",
        "Two blocks",
        Simulation(model, Detector([pair], model.n_nodes), Theta(1e-3), p.steps, settings),
        (Sensor("lift", "vertical force on the upper block", "N", lift), Sensor("x", "displacement", "m", lambda s: float(s.state.x[-3]))),
        plots={"imposed": "x", "reaction": ("lift",), "bound": (1.0, "a bound")},
        fclib_set="TWO",
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
"""


@pytest.fixture
def case_folder(tmp_path: Path) -> Path:
    """The folder two_blocks with its script."""
    folder = tmp_path / "two_blocks"
    folder.mkdir()
    (folder / "two_blocks.py").write_text(SCRIPT, encoding="utf-8")
    return folder


@pytest.fixture
def steps_without_seconds() -> Callable[[Path], list[dict[str, str]]]:
    """Rows of steps.csv without what depends on the machine's speed, or on where a run ended: its last overlap is measured."""
    import csv

    def read(directory: Path) -> list[dict[str, str]]:
        with (directory / "steps.csv").open(newline="", encoding="utf-8") as file:
            return [{k: v for k, v in row.items() if not k.startswith(("seconds", "overlap"))} for row in csv.DictReader(file)]

    return read


@pytest.fixture
def read_here(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same `main` of the same module writes the same arrays, without limits: a process begins with a second of imports.

    mesh/test_foreign.py and tests/faults keep the processes.
    """

    def read[T](path: Path, module: str, arguments: Sequence[str], loaded: Callable[[Path], T]) -> T:
        out = tmp_path_factory.mktemp("read") / "mesh.npz"
        assert regular(path) and import_module(module).main(str(path), str(out), *arguments) == 0
        return loaded(out)

    def unlimited(path: str, work: Callable[[], None]) -> int:
        work()
        return 0

    for module in ("fcsim.mesh.foreign", "fcsim.mesh.solids.surface_file"):
        monkeypatch.setattr(f"{module}.read_apart", read)
        monkeypatch.setattr(f"{module}.limited", unlimited)
