"""fcsim tilt | push: limit analysis and simulation of a table that tilts, of a load that grows; the collapse as a film."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from fcsim.command_line.masonry.analysis import print_analysis
from fcsim.command_line.masonry.arguments import AXES, add_export, direction, model_options, read, stone
from fcsim.command_line.masonry.branch import RESOLUTION, push_by_displacement
from fcsim.command_line.terminal import say
from fcsim.errors import InputError

if TYPE_CHECKING:
    from fcsim.masonry import Bracket, LimitAnalysis
    from fcsim.masonry.collapse import Trial

_RISE, _FALL, _H = 2.0, 1.5, 5e-3
"""[s] in which a filmed table rises to the angle of the fall, how long it is filmed from there on, the step."""


def add_tilt(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command `tilt`."""
    tilt = commands.add_parser(
        "tilt",
        help="angle of a table at which a masonry structure collapses",
        description="Print the angle at which a structure on a table begins to move and to fall, by limit analysis and simulation.",
    )
    tilt.add_argument(
        "--direction", type=direction, default=AXES["x"], help="horizontal direction to which the table goes down (default x)"
    )
    tilt.set_defaults(act=_tilt)
    return tilt


def add_push(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command `push`."""
    push = commands.add_parser(
        "push",
        help="multiplier at which a masonry structure begins to move and to fall",
        description="Print the load multiplier at which a structure begins to move and to fall, by limit analysis and by simulation.",
    )
    push.add_argument("--direction", type=direction, help="push with the weight of all blocks this way: x, 1,0.5,0, --direction=-x")
    push.add_argument("--branch", action="store_true", help="the multiplier by displacement and its descending branch, not trials")
    push.add_argument("--step", type=float, help="[m] of the displacement on the branch (default 2.5e-4 of the structure's extent)")
    push.add_argument("--to", type=float, help="[m] displacement at which the branch ends (default half the structure's extent)")
    push.set_defaults(act=_push)
    return push


def add_trials(command: argparse.ArgumentParser) -> None:
    """What simulation is asked besides limit analysis."""
    command.add_argument("--film", action="store_true", help="run the collapse as well: film, steps and VTK files in OUT/run")
    command.add_argument("--resolution", type=float, default=RESOLUTION, help="of the multiplier, as a share of it (default 0.005)")
    command.add_argument("--static", action="store_true", help="limit analysis alone, no simulation")
    add_export(command, "the blocks as they fall, to a file")


def _tilt(options: argparse.Namespace) -> int:
    from fcsim.masonry import analyse, tilted

    _refuse_what_needs_more(options)
    analysis = analyse(tilted(read(options), options.direction), options.tolerance)
    seen = _simulated(options, analysis)
    code = print_analysis(options, analysis, seen, angle=True)
    if options.film and seen is not None:
        _run_collapse(options, {"tilt": f"{math.degrees(math.atan(seen.fall[1])) / _RISE:.6g}"}, _RISE + _FALL)
    return code


def _push(options: argparse.Namespace) -> int:
    from fcsim.masonry import analyse, pushed

    problem = read(options)
    if options.direction is not None:
        problem = pushed(problem, options.direction)
    _refuse_what_needs_more(options)
    if not problem.scaled:
        raise InputError(f"{options.model}: expected a load that the multiplier scales, or --direction, got none")
    if options.branch:
        return push_by_displacement(options, problem)
    for name in ("step", "to"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name}: expected it with --branch, got it without")
    analysis = analyse(problem, options.tolerance)
    seen = _simulated(options, analysis)
    code = print_analysis(options, analysis, seen)
    if options.film and seen is not None:
        _run_collapse(options, {"multiplier": f"{seen.fall[1] * 1.02:.8g}"}, _FALL)
    return code


def _refuse_what_needs_more(options: argparse.Namespace) -> None:
    """InputError for options that ask for what others leave out, before anything is computed."""
    from fcsim.masonry.exports import refuse_format

    if options.film and options.out is None:
        raise InputError("--film: expected a folder for it, --out DIR")
    if options.export is not None:
        refuse_format(options.export)
    for name in ("film", "export"):
        if getattr(options, name) and options.static:
            raise InputError(f"--{name}: expected it without --static, which simulates nothing")
    if options.resolution != RESOLUTION and options.static:
        raise InputError("--resolution: expected it without --static, which simulates nothing")
    if options.blocks != "rigid" and options.static:
        raise InputError("--blocks: expected it without --static: limit analysis knows rigid blocks alone")
    stone(options)


def _simulated(options: argparse.Namespace, analysis: LimitAnalysis) -> Bracket | None:
    from fcsim.masonry import bracket

    if options.static or analysis.associative.outcome != "limit":
        return None
    low = analysis.lowest.multiplier if analysis.lowest.outcome == "limit" else 0.5 * analysis.associative.multiplier
    step = options.resolution

    def told(seen: Trial) -> None:
        say(f"simulated: {_words(seen)}", to_stderr=True)

    return bracket(
        analysis.problem,
        low * (1 - step),
        analysis.associative.multiplier * (1 + step),
        resolution=step,
        watch=told,
        blocks=options.blocks,
        stone=stone(options),
        tolerance=options.tolerance,
    )


def _words(seen: Trial) -> str:
    outcome = "falls" if seen.falls else "slips and locks, or barely moves" if seen.moves else "stands"
    return f"multiplier {seen.multiplier:.6g} {outcome} (moved {seen.displacement:.2e} m in {seen.t:.2g} s)"


def _run_collapse(options: argparse.Namespace, loading: dict[str, str], duration: float) -> None:
    """The collapse as a run with its film, in OUT/run."""
    from fcsim.masonry.case import masonry_case
    from fcsim.running.run import RunOptions, run_case
    from fcsim.view import render

    direction = options.direction or (0.0, 0.0, 0.0)
    assignments = {
        **loading,
        "push": ",".join(f"{c:g}" for c in direction),
        "h": str(_H),
        "steps": str(round(duration / _H)),
        **_as_run(options),
    }
    summary = run_case(
        masonry_case(options.model, options.mu, **model_options(options)),
        assignments,
        options.out / "run",
        RunOptions(export_every=0, vtk_every=5),
        overwrite=True,
    )
    say(f"collapse: {summary.status} after {summary.steps} steps{', ' + summary.message if summary.message else ''}")
    for path in render(options.out / "run"):
        say(path)


def _as_run(options: argparse.Namespace) -> dict[str, str]:
    """The blocks of the trials as a run's parameters."""
    of = stone(options)
    return (
        {} if of is None else {"blocks_are": options.blocks, "E": f"{of.E:g}", "nu": f"{of.nu:g}", "cells": f"{of.cells:g}", "theta": "1"}
    )
