"""The cases that come with fcsim: in the wheel beside the package's code, in a clone beside the package."""

from __future__ import annotations

import ast
import difflib
from dataclasses import dataclass
from pathlib import Path

from fcsim.errors import InputError

KINDS = {"BlockKind": ("deformable", "rigid", "mixed")}
"""Names of Literals of fcsim that cases write: scripts are read, not run, and a shell that completes waits for no imports."""
PLACES = (Path(__file__).parents[1] / "cases", Path(__file__).parents[2] / "cases")


@dataclass(frozen=True)
class KnownCase:
    """A case that comes with fcsim; about: the first sentence of its script."""

    name: str
    folder: Path
    about: str

    @property
    def script(self) -> Path:
        return self.folder / f"{self.name}.py"


@dataclass(frozen=True)
class DeclaredParameter:
    """A parameter as the script writes it: name, type, default, and the values that a Literal or a switch allows."""

    name: str
    kind: str
    default: str
    choices: tuple[str, ...] = ()


def known_cases() -> list[KnownCase]:
    """The cases in the order of their names; none where the package was taken out of its wheel or clone."""
    place = next((place for place in PLACES if place.is_dir()), None)
    folders = sorted(place.iterdir()) if place is not None else []
    return [KnownCase(folder.name, folder, _about(script)) for folder in folders if (script := folder / f"{folder.name}.py").is_file()]


def case_place(given: str | Path) -> Path:
    """The path of a case: the path itself where there is one, else that of a known case of this name.

    Raises InputError that names cases of similar names where there is neither.
    """
    path = Path(given)
    if path.exists():
        return path
    known = {case.name: case for case in known_cases()}
    if str(given) in known:
        return known[str(given)].folder
    near = difflib.get_close_matches(path.stem, known, 3)
    mean = f"; did you mean {' or '.join(near)}?" if near else ""
    raise InputError(
        f"case {str(given)!r}: expected a folder NAME that holds NAME.py, such a script, a masonry problem in JSON or a name of "
        f"`fcsim cases`; found no {path}{mean}"
    )


def declared_parameters(script: Path) -> list[DeclaredParameter]:
    """What the script's class Parameters declares, read without running the script; none where it cannot be read so."""
    try:
        tree = ast.parse(script.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return []
    found = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Parameters")
    annotated = [node for declared in found for node in declared.body if isinstance(node, ast.AnnAssign)]
    return [_declared(node) for node in annotated if isinstance(node.target, ast.Name)]


def _declared(node: ast.AnnAssign) -> DeclaredParameter:
    kind = ast.unparse(node.annotation)
    choices: tuple[str, ...] = ("on", "off") if kind == "bool" else KINDS.get(kind, ())
    if kind.startswith("Literal[") and isinstance(node.annotation, ast.Subscript):
        choices = tuple(str(c.value) for c in ast.walk(node.annotation.slice) if isinstance(c, ast.Constant))
    return DeclaredParameter(ast.unparse(node.target), kind, "" if node.value is None else ast.unparse(node.value), choices)


def _about(script: Path) -> str:
    try:
        text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    except (OSError, SyntaxError, ValueError):
        return ""
    return " ".join(text.split("\n\n")[0].split()).partition(". ")[0].removesuffix(".")
