"""fcsim cases: the cases that come with fcsim, and what one of them is."""

from __future__ import annotations

import argparse

from fcsim.command_line.answers import answer
from fcsim.command_line.terminal import print_table, say
from fcsim.errors import EXIT_OK, InputError

WIDTH = 110
"""Characters of a description in the list."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `cases`."""
    cases = commands.add_parser(
        "cases",
        help="list the cases that come with fcsim",
        description="List the cases that come with fcsim; with a NAME, what it is, where its script lies and what --set changes.",
    )
    cases.add_argument("case", nargs="?", metavar="NAME", help="describe this case")
    cases.set_defaults(act=_cases)


def _cases(options: argparse.Namespace) -> int:
    from fcsim.running.known_cases import known_cases

    known = {case.name: case for case in known_cases()}
    if not known:
        raise InputError("fcsim cases: expected the folder cases/ in the installed package or beside it, found none; install fcsim anew")
    if options.case is not None:
        _describe(options.case)
    elif not answer({"cases": [{"name": case.name, "about": case.about, "folder": case.folder} for case in known.values()]}):
        print_table(("case", ""), [(case.name, _short(case.about)) for case in known.values()], texts=2)
        say("\nfcsim run NAME runs one into results/NAME; fcsim cases NAME says more; fcsim new NAME begins one of your own")
    return EXIT_OK


def _describe(name: str) -> None:
    from fcsim.running.known_cases import case_place, declared_parameters

    folder = case_place(name)
    script = folder / f"{folder.resolve().name}.py" if folder.is_dir() else folder
    parameters = declared_parameters(script)
    if answer({"name": script.stem, "script": script, "parameters": parameters}):
        return
    readme = script.parent / "README.md"
    say(readme.read_text(encoding="utf-8").partition("\n## ")[0].strip() if readme.is_file() else script.stem)
    say(f"\nscript: {script}")
    print_table(
        ("parameter", "default", "expects"),
        [(p.name, p.default, ", ".join(p.choices) or p.kind) for p in parameters],
        title=f"fcsim run {name} --set NAME=VALUE changes",
        texts=3,
    )


def _short(text: str) -> str:
    return text if len(text) <= WIDTH else text[: WIDTH - 4].rsplit(" ", 1)[0] + " ..."
