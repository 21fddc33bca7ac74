"""What limit analysis and simulation found of a structure: its files, its table on the terminal, the exit code."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.brief import counted
from fcsim.command_line.masonry.arguments import stone
from fcsim.command_line.terminal import print_table, say, say_json
from fcsim.errors import EXIT_NOT_CONVERGED, EXIT_OK

if TYPE_CHECKING:
    from fcsim.arrays import FloatArray
    from fcsim.masonry import Bracket, LimitAnalysis, MasonryProblem
    from fcsim.timestep.step import Step

WORDS = {"hinge": ("turns", "turn"), "sliding": ("slides", "slide"), "open": ("opens", "open"), "closed": ("stays closed", "stay closed")}


def print_analysis(options: argparse.Namespace, analysis: LimitAnalysis, seen: Bracket | None, *, angle: bool = False) -> int:
    """Say what was found (seen: by simulation), multipliers as angles too, write what --out and --export ask for, and return the exit code.

    What took minutes is told before a full disk refuses the files.
    """
    if options.json:
        from fcsim.masonry.report import summary

        say_json(summary(analysis, seen))
    else:
        _print(analysis, seen, angle)
    _write(options, analysis, seen)
    if options.out is not None and not options.json:
        say(f"analysis, joints and picture: {options.out}")
    return _exit(analysis)


def _print(analysis: LimitAnalysis, seen: Bracket | None, angle: bool) -> None:
    from fcsim.masonry.remarks import remarks

    _print_multipliers(analysis, seen, angle)
    for remark in remarks(analysis, seen):
        say(f"note: {remark}")
    for expected in analysis.problem.expected:
        say(f"expected: {expected.quantity}: {expected.value}")
    if analysis.lowest.outcome == "limit":
        states = [joint.state for joint in analysis.joints]
        number = {state: states.count(state) for state in WORDS if state in states}
        say("mechanism: " + ", ".join(f"{counted(n, 'joint')} {WORDS[state][n > 1]}" for state, n in number.items()))


def _write(options: argparse.Namespace, analysis: LimitAnalysis, seen: Bracket | None) -> None:
    """What --out and --export ask for."""
    if options.out is not None:
        from fcsim.masonry.report import write_analysis
        from fcsim.view.mechanism import draw_mechanism

        write_analysis(options.out, analysis, seen)
        draw_mechanism(analysis, options.out / "mechanism.png")
    falling = None if seen is None or (options.out is None and options.export is None) else _falling(options, analysis, seen)
    if seen is not None and falling is not None and options.out is not None:
        _write_cracks(options.out, analysis, seen, falling)
    if falling is not None and options.export is not None:
        from fcsim.masonry.exports import moved_blocks, write_blocks

        write_blocks(options.export, moved_blocks(analysis.problem, falling.model, falling.state.x))


def friction_words(problem: MasonryProblem, mu: FloatArray, share: float = 1.0) -> str:
    """A share of the friction mu (nc,) that the joints have: a number, or from which to which."""
    low, high = (mu.min(), mu.max()) if len(mu) else (problem.mu, problem.mu)
    return f"{share * low:.5g}" if low == high else f"{share * low:.5g} to {share * high:.5g}"


def _print_multipliers(analysis: LimitAnalysis, seen: Bracket | None, angle: bool) -> None:
    """The table of multipliers; angle: with the angle of a table that tilts."""
    problem = analysis.problem
    free = sum(not block.support for block in problem.blocks)
    held = len(problem.blocks) - free
    mu = friction_words(problem, analysis.limit.contacts.mu)
    sizes = ((free, "block"), (held, "support"), (len(analysis.joints), "joint"))
    say(f"{problem.title or problem.name}: {', '.join(counted(n, one) for n, one in sizes)}, mu {mu}")
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
    write_openings(directory / "openings.csv", analysis.problem, joints)
    if analysis.problem.dimension == 2:
        title = f"{analysis.problem.title or analysis.problem.name}: {step.state.t:.2f} s after the multiplier {seen.fall[1]:.4g}"
        draw_cracks(analysis.problem, step.model, step.state.x, joints, directory / "cracks.png", title)


def _exit(analysis: LimitAnalysis) -> int:
    return EXIT_NOT_CONVERGED if "undecided" in (analysis.associative.outcome, analysis.coulomb.outcome) else EXIT_OK
