"""fcsim limit | tilt | push | shake | settle: what a structure of blocks bears, by limit analysis and by simulation."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.masonry.arguments import AXES, add_export, add_model, add_stone, direction, read, stone
from fcsim.command_line.masonry.histories import RESOLUTION, push_by_displacement, shake_ground
from fcsim.command_line.masonry.settle import add_settle
from fcsim.command_line.terminal import print_table, say
from fcsim.errors import EXIT_NOT_CONVERGED, EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry import Bracket, LimitAnalysis, MasonryProblem
    from fcsim.timestep.step import Step


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands `limit`, `tilt`, `push`, `shake` and `settle`."""
    limit = commands.add_parser(
        "limit",
        help="largest load of a masonry structure by limit analysis",
        description="Print the largest multiplier of a masonry problem's load that contact forces bear: the associative "
        "upper bound, and the least one at which Coulomb's friction allows a mechanism.",
    )
    limit.add_argument("--direction", type=direction, help="push with the weight of all blocks in this direction: x, 1,0.5,0 or =-x")
    limit.add_argument(
        "--friction", action="store_true", help="the factor by which all friction could be reduced, in place of the multiplier"
    )
    limit.add_argument(
        "--thrust", action="store_true", help="the least and the largest force of each support in equilibrium, in place of the multiplier"
    )
    limit.add_argument("--multiplier", type=float, default=0.0, help="of the loads that grow, with --friction and --thrust (default 0)")
    limit.set_defaults(act=_limit)
    tilt = commands.add_parser(
        "tilt",
        help="angle of a table at which a masonry structure collapses",
        description="Print the angle at which a structure on a table begins to move and to fall, by limit analysis and simulation.",
    )
    tilt.add_argument(
        "--direction", type=direction, default=AXES["x"], help="horizontal direction to which the table goes down (default x)"
    )
    tilt.set_defaults(act=_tilt)
    push = commands.add_parser(
        "push",
        help="multiplier at which a masonry structure begins to move and to fall",
        description="Print the load multiplier at which a structure begins to move and to fall, by limit analysis and by simulation.",
    )
    push.add_argument("--direction", type=direction, help="push with the weight of all blocks in this direction: x, 1,0.5,0 or =-x")
    push.add_argument("--branch", action="store_true", help="the multiplier by displacement and its descending branch, not trials")
    push.add_argument("--step", type=float, help="[m] of the displacement on the branch (default 2.5e-4 of the structure's extent)")
    push.add_argument("--to", type=float, help="[m] displacement at which the branch ends (default half the structure's extent)")
    push.set_defaults(act=_push)
    shake = commands.add_parser(
        "shake",
        help="what an earthquake or a pulse makes of a masonry structure",
        description="Shake the ground by the model's base_acceleration or a record; print how far blocks move and which fall.",
    )
    shake.add_argument("--record", type=Path, help="CSV, columns 't [s]' and 'a [m/s^2]' or 'a [g]', in place of base_acceleration")
    shake.add_argument("--direction", type=direction, default=AXES["x"], help="of the record: x, 1,0.5,0 or =-x (default x)")
    shake.add_argument("--factor", type=float, default=1.0, help="on the record's accelerations (default 1)")
    shake.add_argument("--duration", type=float, help="[s] (default: the record's and 2 s)")
    shake.add_argument(
        "--h", type=float, help="[s] step (default: a hundredth of the time in which the smallest block falls by its extent)"
    )
    shake.set_defaults(act=lambda options: shake_ground(options, read(options)))
    settle = add_settle(commands)
    for command in (limit, tilt, push, shake, settle):
        add_model(command)
        if command not in (shake, settle):
            command.add_argument("--tolerance", type=float, help="[m] blocks that are nearer touch (default 1e-4 of the smallest block)")
        command.add_argument("--out", type=Path, help="folder for the analysis (JSON), its joints (CSV) and the picture of the mechanism")
        command.add_argument("--json", action="store_true", help="print JSON")
    for command in (tilt, push, shake, settle):
        add_stone(command)
    for command in (tilt, push):
        _add_trials(command)


def _add_trials(command: argparse.ArgumentParser) -> None:
    """What simulation is asked besides limit analysis."""
    command.add_argument("--film", action="store_true", help="run the collapse as well: film, steps and VTK files in OUT/run")
    command.add_argument("--resolution", type=float, default=RESOLUTION, help="of the multiplier, as a share of it (default 0.005)")
    command.add_argument("--static", action="store_true", help="limit analysis alone, no simulation")
    add_export(command, "the blocks as they fall, to a file")


def _limit(options: argparse.Namespace) -> int:
    from fcsim.masonry import analyse, pushed

    problem = read(options)
    problem = problem if options.direction is None else pushed(problem, options.direction)
    if options.friction and options.thrust:
        raise InputError("--friction, --thrust: expected one of them, got both")
    if options.friction:
        return _friction(options, problem)
    if options.thrust:
        return _thrust(options, problem)
    if options.multiplier:
        raise InputError("--multiplier: expected it with --friction or --thrust")
    return _report(options, analyse(problem, options.tolerance), None)


def _friction(options: argparse.Namespace, problem: MasonryProblem) -> int:
    from fcsim.masonry import friction_factor, limit_problem

    factor = friction_factor(limit_problem(problem, tolerance=options.tolerance), options.multiplier)
    if options.out is not None:
        raise InputError("--out: expected it without --friction, whose answer is one number")
    if options.json:
        from fcsim.records import json_text

        say(json_text({"name": problem.name, "multiplier": options.multiplier, "friction_factor": factor}).rstrip())
        return EXIT_OK
    if factor == 0:
        said = "no friction holds it"
    elif factor == math.inf:
        said = "it needs no friction"
    else:
        said = f"factor of safety by reduction of friction {factor:.5g}: it needs mu {problem.mu / factor:.5g} of {problem.mu:g}"
    say(f"{problem.title or problem.name}: {said}")
    return EXIT_OK


def _thrust(options: argparse.Namespace, problem: MasonryProblem) -> int:
    from fcsim.masonry import limit_problem, support_forces
    from fcsim.masonry.report import SUPPORT_COLUMNS, support_rows, support_summary, write_supports

    found = support_forces(limit_problem(problem, tolerance=options.tolerance), options.multiplier)
    if options.out is not None:
        write_supports(options.out, found)
    if options.json:
        from fcsim.records import json_text

        say(json_text(support_summary(problem, options.multiplier, found)).rstrip())
        return EXIT_OK
    say(f"{problem.title or problem.name}: what its supports may bear in equilibrium")
    print_table(SUPPORT_COLUMNS, support_rows(found, digits=6), texts=2)
    return EXIT_OK


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
    code = _report(options, analysis, seen)
    if options.film and seen is not None:
        _run_collapse(options, {"multiplier": f"{seen.fall[1] * 1.02:.8g}"}, _FALL)
    return code


_RISE, _FALL, _H = 2.0, 1.5, 5e-3
"""[s] in which a filmed table rises to the angle of the fall, how long it is filmed from there on, the step."""


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
        masonry_case(
            options.model, options.mu, density=options.density, scale=options.scale, supports=options.support, array=options.array
        ),
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


def _tilt(options: argparse.Namespace) -> int:
    from fcsim.masonry import analyse, tilted

    _refuse_what_needs_more(options)
    analysis = analyse(tilted(read(options), options.direction), options.tolerance)
    seen = _simulated(options, analysis)
    code = _report(options, analysis, seen, angle=True)
    if options.film and seen is not None:
        _run_collapse(options, {"tilt": f"{math.degrees(math.atan(seen.fall[1])) / _RISE:.6g}"}, _RISE + _FALL)
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
    if options.blocks != "rigid" and options.static:
        raise InputError("--blocks: expected it without --static: limit analysis knows rigid blocks alone")
    stone(options)


def _simulated(options: argparse.Namespace, analysis: LimitAnalysis) -> Bracket | None:
    from fcsim.masonry import bracket

    if options.static or analysis.associative.outcome != "limit":
        return None
    low = analysis.lowest.multiplier if analysis.lowest.outcome == "limit" else 0.5 * analysis.associative.multiplier
    step = options.resolution

    def told(seen: object) -> None:
        say(f"simulated: {_words(seen)}", to_stderr=True)

    return bracket(
        analysis.problem,
        low * (1 - step),
        analysis.associative.multiplier * (1 + step),
        resolution=step,
        watch=told,
        blocks=options.blocks,
        stone=stone(options),
    )


def _words(seen) -> str:  # type: ignore[no-untyped-def]
    outcome = "falls" if seen.falls else "slips and locks, or barely moves" if seen.moves else "stands"
    return f"multiplier {seen.multiplier:.6g} {outcome} (moved {seen.displacement:.2e} m in {seen.t:.2g} s)"


def _report(options: argparse.Namespace, analysis: LimitAnalysis, seen: Bracket | None, *, angle: bool = False) -> int:
    from fcsim.masonry.remarks import remarks
    from fcsim.masonry.report import summary, write_analysis

    if options.out is not None:
        from fcsim.view.mechanism import draw_mechanism

        write_analysis(options.out, analysis, seen)
        draw_mechanism(analysis, options.out / "mechanism.png")
    falling = None if seen is None or (options.out is None and options.export is None) else _falling(options, analysis, seen)
    if seen is not None and falling is not None and options.out is not None:
        _write_cracks(options.out, analysis, seen, falling)
    if falling is not None and options.export is not None:
        from fcsim.masonry.exports import moved_blocks, write_blocks

        write_blocks(options.export, moved_blocks(analysis.problem, falling.model, falling.state.x))
    if options.json:
        from fcsim.records import json_text

        say(json_text(summary(analysis, seen)).rstrip())
        return _exit(analysis)
    problem = analysis.problem
    free = sum(not block.support for block in problem.blocks)
    held = len(problem.blocks) - free
    say(f"{problem.title or problem.name}: {free} blocks, {held} supports, {len(analysis.joints)} joints, mu {problem.mu:g}")
    rows: list[Sequence[str]] = []

    def row(what: str, multiplier: float, remark: str) -> None:
        rows.append((what, remark, f"{multiplier:.6g}", *([f"{math.degrees(math.atan(multiplier)):.3f}"] if angle else [])))

    for found, remark in (
        (analysis.associative, "no state of equilibrium above it"),
        (analysis.coulomb, "from there on the mechanism goes with Coulomb's law"),
    ):
        words = {"falls": "it falls under the loads that stay", "unbounded": "borne at every multiplier", "undecided": "did not converge"}
        row(f"limit analysis, {found.law}", found.multiplier, words.get(found.outcome, remark))
    if analysis.lowest is not analysis.coulomb:
        row("limit analysis, Coulomb, lowest", analysis.lowest.multiplier, "another mechanism with slip: motion may begin there")
    if seen is not None:
        for what, (low, high) in (("first motion", seen.motion), ("falls", seen.fall)):
            if high > 0:
                row(f"simulation, {what}: not at", low, "held for a while, it did not")
            row(f"simulation, {what}: at", high, "")
    print_table(("", "", "multiplier", *(["degrees"] if angle else [])), rows, texts=2)
    for remark in remarks(analysis, seen):
        say(f"note: {remark}")
    for expected in problem.expected:
        say(f"expected: {expected.quantity}: {expected.value}")
    if analysis.lowest.outcome == "limit":
        states = [joint.state for joint in analysis.joints]
        say("mechanism: " + ", ".join(f"{states.count(state)} joints {word}" for state, word in WORDS.items() if state in states))
    if options.out is not None:
        say(f"analysis, joints and picture: {options.out}")
    return _exit(analysis)


def _falling(options: argparse.Namespace, analysis: LimitAnalysis, seen: Bracket) -> Step:
    """The step in which the fall has begun."""
    from fcsim.masonry.collapse import fallen

    return fallen(analysis.problem, seen.fall[1], blocks=options.blocks, stone=stone(options))


def _write_cracks(directory: Path, analysis: LimitAnalysis, seen: Bracket, step: Step) -> None:
    """The openings of joints in the beginning fall, as a table and, in 2D, as a picture."""
    from fcsim.masonry.openings import openings
    from fcsim.masonry.report import write_openings
    from fcsim.masonry.structure import touching
    from fcsim.view.cracks import draw_cracks

    contacts = touching(analysis.problem, step.model) if step.model.deformable else analysis.limit.contacts
    joints = openings(contacts, step.model, step.state.x)
    write_openings(directory / "openings.csv", joints)
    if analysis.problem.dimension == 2:
        title = f"{analysis.problem.title or analysis.problem.name}: {step.state.t:.2f} s after the multiplier {seen.fall[1]:.4g}"
        draw_cracks(analysis.problem, step.model, step.state.x, joints, directory / "cracks.png", title)


WORDS = {"hinge": "turn", "sliding": "slide", "open": "open", "closed": "stay closed"}


def _exit(analysis: LimitAnalysis) -> int:
    return EXIT_NOT_CONVERGED if "undecided" in (analysis.associative.outcome, analysis.coulomb.outcome) else EXIT_OK
