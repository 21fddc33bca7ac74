"""fcsim new: a folder with a small case that runs, to be changed."""

from __future__ import annotations

import argparse
import shlex
import sys
from contextlib import suppress
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path

from fcsim.command_line.answers import answer
from fcsim.command_line.terminal import say
from fcsim.errors import EXIT_OK, InputError
from fcsim.files import plain_name, replacing

TEMPLATE = Path(__file__).with_name("template.py")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `new`."""
    new = commands.add_parser(
        "new",
        help="write a small case that runs, to begin with",
        description="Write NAME/NAME.py, a commented case of two blocks that runs as it is: change it into your own.",
    )
    new.add_argument("name", metavar="NAME", help="name of the case, or a path whose last part is its name")
    new.set_defaults(act=_new)


def _new(options: argparse.Namespace) -> int:
    script = write_case(Path(options.name))
    folder = shlex.quote(str(script.parent))
    if not answer({"case": script.stem, "script": script}):
        say(f"{script}\nrun it: fcsim run {folder}; its parameters: fcsim run {folder} --parameters")
    return EXIT_OK


def write_case(folder: Path) -> Path:
    """Write the case into the folder, whose name it takes, and return the script. InputError for a name that no module can have, or where
    the script is there already."""
    name = plain_name(folder.name, "fcsim new, NAME")
    if not name.isidentifier():
        raise InputError(f"fcsim new, NAME: expected letters, digits and '_', no digit first, got {name!r}")
    if iskeyword(name) or _is_a_package(name):
        raise InputError(f"fcsim new, NAME: expected a name that Python does not use itself, got {name!r}, a keyword or a package")
    script = folder / f"{name}.py"
    if script.exists():
        raise InputError(f"{script}: expected a name that is not taken, found a file")
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(script) as temporary:
            temporary.write_text(TEMPLATE.read_text(encoding="utf-8").replace("NAME", name), encoding="utf-8")
    except FileExistsError:
        raise InputError(f"{folder}: expected a folder or nothing there, found a file") from None
    except OSError:  # a full disk
        for place in made:
            with suppress(OSError):
                place.rmdir()
        raise
    return script


def _is_a_package(name: str) -> bool:
    """Whether a script of this name hides a module from its neighbours, which import its like; a folder without __init__.py is none."""
    if name in sys.stdlib_module_names:
        return True
    try:
        spec = find_spec(name)
    except ValueError:  # of __main__
        return True
    return spec is not None and spec.origin is not None
