"""The command line of scripts that run a case at several refinements: what they share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from fcsim.errors import FcsimError, InputError
from fcsim.running.case import CaseScript, load_case
from fcsim.running.parameters import parse_parameters


def refinement_command[T](
    script: Path,
    description: str,
    divisions: str,
    refine: Callable[[CaseScript, dict[str, str], int], T],
    table: Callable[[list[T]], str],
    draw: Callable[[list[T], str, Path], Path],
) -> int:
    """Run the case of the folder that `script` lies in once for each number of --divisions; print the table and the picture's path.

    refine(case script, parameter texts, divisions) runs the case once; draw(results, title, folder) writes the picture. Returns the
    exit code: 2 for bad input and for a run that does not converge, which is said on stderr.
    """
    folder = script.resolve().parent
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "--divisions", default=divisions, help=f"elements along the half-width of the core, a run each (default {divisions})"
    )
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="assignments", help="a parameter of the case")
    parser.add_argument(
        "--out", type=Path, default=Path("results") / folder.name, help=f"folder of the picture (default results/{folder.name})"
    )
    options = parser.parse_args()
    try:
        if not all("=" in text for text in options.assignments):
            raise InputError("--set: expected NAME=VALUE")
        if not all(number.isdigit() for number in options.divisions.split(",")):
            raise InputError(f"--divisions: expected whole numbers separated by commas, got {options.divisions!r}")
        case = load_case(folder)
        assignments = dict(text.split("=", 1) for text in options.assignments)
        found = [refine(case, assignments, int(n)) for n in options.divisions.split(",")]
        title = case.build(parse_parameters(case, {**assignments, "divisions": "1"})).title
        print(table(found))
        print(draw(found, title, options.out / "plots"))
    except FcsimError as error:
        print(f"{script.name}: {error}", file=sys.stderr)
        return 2
    return 0
