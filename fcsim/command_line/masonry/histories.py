"""fcsim push --branch and fcsim shake: structures of blocks on their way, as tables, CSV and pictures."""

from __future__ import annotations

import argparse
import math
import time
from typing import TYPE_CHECKING

from fcsim.command_line.masonry.arguments import stone
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry import MasonryProblem
    from fcsim.timestep.step import Step

RESOLUTION = 0.005
"""Of the multiplier in trials, as a share of it."""
_SILENT = 10.0
"""[s] after which a push by displacement says where it is, a step that is taken again too."""


def shake_ground(options: argparse.Namespace, problem: MasonryProblem) -> int:
    """`fcsim shake`."""
    from fcsim.assembly.time_functions import read_acceleration_record
    from fcsim.masonry import shake, shaken

    if options.record is not None:
        problem = shaken(problem, options.direction, read_acceleration_record(options.record).scaled(options.factor))
    elif options.factor != 1.0:
        raise InputError("--factor: expected it with --record")
    with Bar("step") as bar:

        def watch(step: Step, steps: int) -> None:
            bar.update(step.number, steps, f"{step.state.t:.4g} s")

        seen = shake(problem, duration=options.duration, h=options.h, blocks=options.blocks, stone=stone(options), watch=watch)
    if options.out is not None:
        from fcsim.masonry.report import write_shake
        from fcsim.view.histories import draw_shake

        write_shake(options.out, seen)
        draw_shake(seen, options.out / "shake.png", problem.title or problem.name)
    if options.json:
        from fcsim.masonry.report import shake_summary
        from fcsim.records import json_text

        say(json_text(shake_summary(seen)).rstrip())
        return EXIT_OK
    rows = [
        ("largest displacement of a corner", f"{1e3 * seen.displacement.max():.5g} mm", f"{seen.t[seen.displacement.argmax()]:.4g} s"),
        ("largest turn of a block", f"{math.degrees(seen.turn.max()):.5g} degrees", f"{seen.t[seen.turn.argmax()]:.4g} s"),
        ("displacement in the end", f"{1e3 * seen.displacement[-1]:.5g} mm", f"{seen.t[-1]:.4g} s"),
    ]
    say(f"{problem.title or problem.name}: {len(problem.blocks)} blocks, {seen.t[-1]:.4g} s in {len(seen.t)} steps")
    print_table(("", "", "at"), rows, texts=1)
    fell = ", ".join(seen.fallen[:8]) + (f" and {len(seen.fallen) - 8} more" if len(seen.fallen) > 8 else "")
    say(f"fallen: {fell}" if fell else "nothing has fallen" + (", but it moves still" if seen.moving else ""))
    for remark in seen.remarks:
        say(f"note: {remark}")
    if options.out is not None:
        say(f"history and picture: {options.out}")
    return EXIT_OK


def push_by_displacement(options: argparse.Namespace, problem: MasonryProblem) -> int:
    """`fcsim push --branch`."""
    from fcsim.masonry.histories import branch as pushes
    from fcsim.masonry.report import branch_summary, write_branch

    if options.film or options.static:
        raise InputError("--branch: expected it without --film and --static")
    blocks = "which knows rigid blocks and writes no blocks"  # several elastic ones that turn about each other do not settle in statics
    trials = "which needs no joints and no trials"
    useless = (("export", None, blocks), ("blocks", "rigid", blocks), ("tolerance", None, trials), ("resolution", RESOLUTION, trials))
    for option, usual, why in useless:
        if getattr(options, option) != usual:
            raise InputError(f"--{option}: expected it without --branch, {why}")
    by = options.step or pushes.default_step(problem)
    end = options.to or pushes.default_end(problem)
    with Bar("displacement") as bar:
        told, began = time.monotonic(), False

        def tell(text: str) -> None:
            nonlocal told
            if not began or time.monotonic() > told + _SILENT:
                told = time.monotonic()
                bar.say(text)

        def watch(displacement: float, multiplier: float) -> None:
            nonlocal began
            began, text = True, f"{1e3 * displacement:.4g} mm, multiplier {multiplier:.4g}"
            bar.update(round(displacement / by), round(end / by), text)
            tell(text)

        branch = pushes.push_by_displacement(problem, step=options.step, to=options.to, watch=watch, tell=tell)
    name = problem.title or problem.name
    if options.out is not None:
        from fcsim.view.branch import draw_branch

        write_branch(options.out, branch)
        draw_branch(branch, options.out / "branch.png", name)
    if options.json:
        from fcsim.records import json_text

        say(json_text(branch_summary(branch)).rstrip())
        return EXIT_OK
    count = len(branch.displacement)
    shown = [*range(0, count - 1, max(count // 12, 1)), count - 1]
    rows = [(f"{1e3 * branch.displacement[k]:.4g}", f"{branch.multiplier[k]:.6g}") for k in shown]
    print_table(("displacement [mm]", "multiplier"), rows)
    say(f"{name}: set in motion at the multiplier {branch.multiplier[0]:.6g}, largest {branch.largest:.6g}")
    if branch.end is not None:
        say(f"falls by itself from a displacement of {1e3 * branch.end:.5g} mm on")
    elif branch.held:
        say(f"bears a multiplier still at {1e3 * branch.displacement[-1]:.5g} mm")
    else:
        say(f"runs away at {1e3 * branch.displacement[-1]:.5g} mm though it is held: another joint opens there, or a block comes off")
    if options.out is not None:
        say(f"curve and picture: {options.out}")
    return EXIT_OK
