"""fcsim limit: the largest load by limit analysis, the factor by which friction may be reduced, the range of thrust."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from fcsim.command_line.masonry.analysis import friction_words, print_analysis
from fcsim.command_line.masonry.arguments import direction, read
from fcsim.command_line.terminal import print_table, say, say_json
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry import MasonryProblem


def add_limit(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command `limit`."""
    limit = commands.add_parser(
        "limit",
        help="largest load of a masonry structure by limit analysis",
        description="Print the largest multiplier of a masonry problem's load that contact forces bear: the associative "
        "upper bound, and the least one at which Coulomb's friction allows a mechanism.",
    )
    limit.add_argument("--direction", type=direction, help="push with the weight of all blocks this way: x, 1,0.5,0, --direction=-x")
    limit.add_argument(
        "--friction", action="store_true", help="the factor by which all friction could be reduced, in place of the multiplier"
    )
    limit.add_argument(
        "--thrust", action="store_true", help="the least and the largest force of each support in equilibrium, in place of the multiplier"
    )
    limit.add_argument("--multiplier", type=float, default=0.0, help="of the loads that grow, with --friction and --thrust (default 0)")
    limit.set_defaults(act=_limit)
    return limit


def _limit(options: argparse.Namespace) -> int:
    from fcsim.masonry import analyse, pushed

    problem = read(options)
    problem = problem if options.direction is None else pushed(problem, options.direction)
    if options.friction and options.thrust:
        raise InputError("--friction, --thrust: expected one of them, got both")
    if options.friction and options.out is not None:
        raise InputError("--out: expected it without --friction, whose answer is one number")
    if options.friction:
        return _friction(options, problem)
    if options.thrust:
        return _thrust(options, problem)
    if options.multiplier:
        raise InputError("--multiplier: expected it with --friction or --thrust")
    return print_analysis(options, analyse(problem, options.tolerance), None)


def _friction(options: argparse.Namespace, problem: MasonryProblem) -> int:
    from fcsim.masonry import friction_factor, limit_problem

    limit = limit_problem(problem, tolerance=options.tolerance)
    factor = friction_factor(limit, options.multiplier)
    if options.json:
        say_json({"name": problem.name, "multiplier": options.multiplier, "friction_factor": factor})
        return EXIT_OK
    if factor == 0:
        said = "no friction holds it"
    elif factor == math.inf:
        said = "it stands with a thousandth of its friction"
    else:
        needs, has = (friction_words(problem, limit.contacts.mu, share) for share in (1 / factor, 1.0))
        said = f"factor of safety by reduction of friction {factor:.5g}: it needs mu {needs} of {has}"
    say(f"{problem.title or problem.name}: {said}")
    return EXIT_OK


def _thrust(options: argparse.Namespace, problem: MasonryProblem) -> int:
    from fcsim.masonry import limit_problem, support_forces
    from fcsim.masonry.report import SUPPORT_COLUMNS, support_rows, support_summary, write_supports

    found = support_forces(limit_problem(problem, tolerance=options.tolerance), options.multiplier)
    if options.out is not None:
        write_supports(options.out, found)
    if options.json:
        say_json(support_summary(problem, options.multiplier, found))
        return EXIT_OK
    say(f"{problem.title or problem.name}: what its supports may bear in equilibrium")
    print_table(SUPPORT_COLUMNS, support_rows(found, digits=6), texts=2)
    return EXIT_OK
