"""What is begun fits into the memory that is free, or says so before it begins."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from fcsim import Body, Everything, Simulation, Support, Theta, build_model, memory
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.memory import any_size, free_memory, readable, refuse_beyond_memory
from fcsim.mesh import brick, rigid_box, running_bond
from fcsim.mesh.material import Material
from fcsim.running.case import load_case

STONE = Material(1e9, 0.2, 2000.0)
WALL = Path(__file__).parents[2] / "cases" / "masonry_wall"


@pytest.mark.parametrize(("size", "text"), [(3 * 2**20, "3 MiB"), (1.5 * 2**30, "1.5 GiB"), (2.0**43, "8 TiB"), (1e30, "8.67e+11 EiB")])
def test_sizes_for_people(size: float, text: str) -> None:
    assert readable(size) == text


def test_free_memory_is_part_of_the_machines() -> None:
    installed = 1024 * int(next(line for line in Path("/proc/meminfo").read_text().splitlines() if line.startswith("MemTotal")).split()[1])
    assert 0 < free_memory() <= installed


def test_a_containers_limit_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "max").write_text("1000000\n")
    (tmp_path / "current").write_text("400000\n")
    monkeypatch.setattr(memory, "CGROUPS", ((str(tmp_path / "max"), str(tmp_path / "current")),))
    assert free_memory() == 600_000
    (tmp_path / "max").write_text("max\n")
    assert free_memory() > 1e6


def test_the_processs_own_limit_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (1, 1))
    assert free_memory() == 0


def test_libraries_are_not_loaded_into_too_few_addresses() -> None:
    """They ended in a segmentation fault, or by "cannot load MPI library". The child's limit leaves what it has by then and 200 MiB."""
    child = (
        "import resource, fcsim, fcsim.runtime as runtime; from fcsim.memory import own_addresses; n = int(own_addresses()) + 200 * 2**20; "
        "resource.setrlimit(resource.RLIMIT_AS, (n, n)); runtime.dolfinx()"
    )
    ended = subprocess.run([sys.executable, "-c", child], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert "InputError: memory: the libraries of finite elements take about 400 MiB, this process' limit leaves 200 MiB" in ended.stderr


def test_a_limit_too_small_for_numpy_and_numba_is_a_line() -> None:
    """It was a traceback of whichever of their libraries no longer fitted in, of the command as of the first public name."""
    child = (
        "import resource, fcsim, fcsim.__main__ as program; from fcsim.memory import own_addresses; "
        "n = int(own_addresses()) + 200 * 2**20; resource.setrlimit(resource.RLIMIT_AS, (n, n)); code = program.run()\n"
        "try: fcsim.solve\nexcept fcsim.InputError as error: print(error)\nraise SystemExit(code)"
    )
    ended = subprocess.run([sys.executable, "-c", child], capture_output=True, text=True, check=False)
    line = "memory: NumPy, SciPy and numba take about 350 MiB, this process' limit leaves 200 MiB; raise it (ulimit -v)\n"
    assert (ended.returncode, ended.stderr, ended.stdout) == (2, f"fcsim: {line}", line)


def test_refused_unless_told(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_beyond_memory("a point", 8.0)
    with pytest.raises(InputError, match=r"^a cloud: takes about 909 TiB of memory, "):
        refuse_beyond_memory("a cloud", 1e15)
    with any_size():
        refuse_beyond_memory("a cloud", 1e15)
    monkeypatch.setenv("FCSIM_ANY_SIZE", "1")
    refuse_beyond_memory("a cloud", 1e15)
    monkeypatch.setenv("FCSIM_ANY_SIZE", "0")
    with pytest.raises(InputError, match="--any-size"):
        refuse_beyond_memory("a cloud", 1e15)


def test_meshes_and_walls_that_no_machine_holds() -> None:
    """They are refused at once, before gmsh or a loop over the blocks begins."""
    with pytest.raises(InputError, match=r"'b': a mesh of 100000 x 100000 x 100000 cells: takes about 1\.04 EiB of memory"):
        brick("b", (1, 1, 1), (10**5, 10**5, 10**5), STONE)
    with pytest.raises(InputError, match="a mesh of"):
        rigid_box("b", (1, 1, 1), (0, 0, 0), 1.0, (10**5, 10**5, 10**5))
    with pytest.raises(InputError, match=r"running_bond: a wall of 3\.5e"):
        running_bond(10**9, 3.5, material=STONE)
    with pytest.raises(InputError, match="running_bond: a wall of 3e"):
        running_bond(3, 1e300, material=STONE)
    for number in (float("inf"), float("nan")):
        with pytest.raises(InputError, match="blocks: expected a multiple of 1/2"):
            running_bond(3, number, material=STONE)
        with pytest.raises(InputError, match="courses: expected a whole number"):
            running_bond(number, 3.5, material=STONE)  # type: ignore[arg-type]


@pytest.mark.parametrize("bricks", [10**8, 2**63])
def test_a_stack_that_no_machine_holds(bricks: int) -> None:
    """Refused before there is a list of its bricks, which took all the memory there is."""
    script = load_case(WALL.parent / "stack")
    with pytest.raises(InputError, match=rf"stack: {bricks} bricks: takes about"):
        script.build(script.parameters(bricks=bricks))  # type: ignore[call-arg]


def test_a_run_says_its_size_and_refuses_one_too_large(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The default wall: nine full blocks of 9 x 5 x 5 nodes, three halves of 5 x 5 x 5, two platens, 688 contacts."""
    dofs = 3 * (9 * 9 * 25 + 3 * 5 * 25) + 2 * 6
    arguments = ["run", str(WALL), "--out", str(tmp_path / "out"), "--steps", "1", "--export-every", "0", "--vtk-every", "0"]
    assert main(arguments) == 0
    assert f"14 bodies, {dofs} degrees of freedom, 688 contacts to begin with: about " in capsys.readouterr().err
    monkeypatch.setattr(memory, "free_memory", lambda: 1e8)
    assert main([*arguments[:3], str(tmp_path / "two"), *arguments[4:]]) == 2
    said = capsys.readouterr().err
    assert f"14 bodies with {dofs} degrees of freedom" in said and "95 MiB are free" in said and not (tmp_path / "two").exists()
    assert main([*arguments[:3], str(tmp_path / "two"), *arguments[4:], "--any-size"]) == 0


def test_a_compliance_that_no_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    """The surface that contact may touch is what counts: from Python, too, where no run has weighed the model before."""
    block = brick("block", (0.1, 0.1, 0.1), (2, 2, 2), STONE)
    ground = rigid_box("ground", (1.0, 1.0, 0.1), (0.05, 0.05, -0.05), 1.0)
    supports = [Support("ground", ("x", "y", "z", "rx", "ry", "rz"))]
    model = build_model([ground, Body("block", block)], supports=supports, gravity=lambda t: (0.0, 0.0, -9.81))
    monkeypatch.setattr(memory, "free_memory", lambda: 1000.0)
    dofs = 3 * 26  # the nodes of 2 x 2 x 2 cells but the one inside
    with pytest.raises(InputError, match=rf"^part 'block': the compliance between the {dofs} degrees of freedom of the surface"):
        next(iter(Simulation(model, Everything(model, mu=0.5), Theta(1e-3), 1)))
