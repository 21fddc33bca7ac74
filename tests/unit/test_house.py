"""The house itself: sizes of files, folders and functions, names, and one definition of the types of arrays."""

import ast
import re
import tokenize
from importlib import import_module
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[2] / "fcsim"
FILES = sorted(HOUSE.rglob("*.py"))

LINES, IN_FOLDER, IN_FUNCTION = 350, 15, 60
REASON = "long because"
"""These words in the docstring of a longer function begin its reason."""


def place(path: Path) -> str:
    return path.relative_to(HOUSE).as_posix()


def test_no_file_is_longer_than_350_lines() -> None:
    long = {place(path): n for path in FILES if (n := len(path.read_text(encoding="utf-8").splitlines())) > LINES}
    assert not long


def test_no_folder_holds_more_than_15_files() -> None:
    folders = {path.parent for path in FILES}
    counts = {place(folder): n for folder in folders if (n := sum(e.is_file() for e in folder.iterdir())) > IN_FOLDER}
    assert not counts


def test_no_function_is_longer_than_60_lines_without_a_reason_in_its_docstring() -> None:
    long = {}
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or REASON in (ast.get_docstring(node) or "").lower():
                continue
            if (n := (node.end_lineno or 0) - node.lineno + 1) > IN_FUNCTION:
                long[f"{place(path)}:{node.name}"] = n
    assert not long


def test_names_say_what_is_in_a_file() -> None:
    nothing_said = re.compile(r"(^|_)(utils?|helpers?|misc|common|tools|v\d+|new|old|tmp)(_|$)")
    assert not [place(path) for path in FILES if nothing_said.search(path.stem)]


def test_every_file_says_what_it_is_for() -> None:
    assert not [place(path) for path in FILES if not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))]


def test_the_types_of_arrays_are_defined_once() -> None:
    defined = re.compile(r"^(Float|Int|Bool)Array\s*(:.*)?=", re.MULTILINE)
    found = {place(path) for path in FILES if defined.search(path.read_text(encoding="utf-8"))}
    assert found - {"solvers/newton/regularised.py"} == {"arrays.py"}  # that file's IntArray is of 32 bits


def test_kernels_assign_no_slice_from_another() -> None:
    """With it numba compiles the text of a refusal, in each process anew: two to four seconds, and twice a loop's time in the kernel."""
    found = []
    for path in FILES:
        for kernel in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(kernel, ast.FunctionDef) or not any("njit" in ast.unparse(d) for d in kernel.decorator_list):
                continue
            for node in ast.walk(kernel):
                if not isinstance(node, ast.Assign) or isinstance(node.value, ast.Constant | ast.UnaryOp):
                    continue
                for target in node.targets:
                    sliced = isinstance(target, ast.Subscript) and any(isinstance(part, ast.Slice) for part in ast.walk(target.slice))
                    if sliced and not isinstance(node.value, ast.Name):  # a name may be that of a number
                        found.append(f"{place(path)}:{node.lineno}: {ast.unparse(node)}")
    assert not found


def test_any_stands_nowhere_without_a_reason() -> None:
    """A Protocol, a TypeVar, `object` or the class itself says more; what is left has its reason in a comment on its line."""
    uses = []
    for path in FILES:
        with tokenize.open(path) as file:
            tokens = [token for token in tokenize.generate_tokens(file.readline) if token.string == "Any" and token.type == tokenize.NAME]
        uses += [(place(path), token.line) for token in tokens if "import" not in token.line]
    assert len(uses) < 15
    assert not [use for use in uses if "#" not in use[1]]


PUBLIC = {  # by README before the rooms were moved, and all that the faces of the rooms it imports from offered then
    "fcsim": (
        "SOLVERS Body Detector Gap GeneralisedAlpha GlobalProblem LocalProblem Material Part QuasiStatic RigidBody Simulation "
        "SolverSettings Support SurfacePair Theta Velocity build_model contact_surface read_fclib solve two_pass write_fclib"
    ),
    "fcsim.mesh": (
        "Body Material Part RigidBody RunningBond SemicircularArch blocks_that_are brick check_quality graded_brick graded_rectangle "
        "half_ball half_disk mass_properties part_from_gmsh read_mesh read_parts rectangle rigid_body rigid_box rigid_rectangle "
        "running_bond semicircular_arch write_mesh"
    ),
    "fcsim.solvers": "Method Result SOLVERS Status solve",
    "fcsim.export_fclib": "FclibFile Info MatrixInfo Solution file_name read_fclib write_fclib",
    "fcsim.errors": "NotConverged",
}


@pytest.mark.parametrize("room", PUBLIC)
def test_public_names_stay(room: str) -> None:
    missing = [name for name in PUBLIC[room].split() if not hasattr(import_module(room), name)]
    assert not missing
