"""fcsim shake: a structure of blocks on ground that shakes, as a table, CSV and a picture."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.brief import counted
from fcsim.command_line.masonry.arguments import AXES, direction, read, stone
from fcsim.command_line.terminal import Bar, print_table, say, say_json
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry import MasonryProblem, Shake
    from fcsim.timestep.step import Step


def add_shake(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command `shake`."""
    shake = commands.add_parser(
        "shake",
        help="what an earthquake or a pulse makes of a masonry structure",
        description="Shake the ground by the model's base_acceleration or a record; print how far blocks move and which fall.",
    )
    shake.add_argument("--record", type=Path, help="CSV, columns 't [s]' and 'a [m/s^2]' or 'a [g]', in place of base_acceleration")
    shake.add_argument("--direction", type=direction, help="of the record: x, 1,0.5,0, --direction=-x (default x)")
    shake.add_argument("--factor", type=float, help="on the record's accelerations (default 1)")
    shake.add_argument("--duration", type=float, help="[s] (default: the record's and 2 s)")
    shake.add_argument(
        "--h", type=float, help="[s] step (default: a hundredth of the time in which the smallest block falls by its extent)"
    )
    shake.set_defaults(act=_shake)
    return shake


def _shake(options: argparse.Namespace) -> int:
    from fcsim.assembly.time_functions import read_acceleration_record
    from fcsim.masonry import shake, shaken

    for name in ("direction", "factor"):
        if options.record is None and getattr(options, name) is not None:
            raise InputError(f"--{name}: expected it with --record")
    factor = 1.0 if options.factor is None else options.factor
    if not math.isfinite(factor):
        raise InputError(f"--factor: expected a finite number, got {factor}")
    problem = read(options)
    if options.record is not None:
        problem = shaken(problem, options.direction or AXES["x"], read_acceleration_record(options.record).scaled(factor))
    with Bar("step") as bar:

        def watch(step: Step, steps: int) -> None:
            bar.update(step.number, steps, f"{step.state.t:.4g} s")

        seen = shake(problem, duration=options.duration, h=options.h, blocks=options.blocks, stone=stone(options), watch=watch)
    if options.json:
        from fcsim.masonry.report import shake_summary

        say_json(shake_summary(seen))
    else:
        _print(problem, seen)
    if options.out is not None:  # told before a full disk refuses the files
        from fcsim.masonry.report import write_shake
        from fcsim.view.histories import draw_shake

        write_shake(options.out, seen)
        draw_shake(seen, options.out / "shake.png", problem.title or problem.name)
        if not options.json:
            say(f"history and picture: {options.out}")
    return EXIT_OK


def _print(problem: MasonryProblem, seen: Shake) -> None:
    rows = [
        ("largest displacement of a corner", f"{1e3 * seen.displacement.max():.5g} mm", f"{seen.t[seen.displacement.argmax()]:.4g} s"),
        ("largest turn of a block", f"{math.degrees(seen.turn.max()):.5g} degrees", f"{seen.t[seen.turn.argmax()]:.4g} s"),
        ("displacement in the end", f"{1e3 * seen.displacement[-1]:.5g} mm", f"{seen.t[-1]:.4g} s"),
    ]
    held = sum(block.support for block in problem.blocks)
    sizes = f"{counted(len(problem.blocks) - held, 'block')}, {counted(held, 'support')}"
    say(f"{problem.title or problem.name}: {sizes}, {seen.t[-1]:.4g} s in {counted(len(seen.t), 'step')}")
    print_table(("", "", "at"), rows, texts=1)
    fell = ", ".join(seen.fallen[:8]) + (f" and {len(seen.fallen) - 8} more" if len(seen.fallen) > 8 else "")
    say(f"fallen: {fell}" if fell else "nothing has fallen" + (", but it moves still" if seen.moving else ""))
    for remark in seen.remarks:
        say(f"note: {remark}")
