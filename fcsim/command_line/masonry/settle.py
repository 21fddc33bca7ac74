"""fcsim settle: what supports bear and how joints open while a support gives way."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from fcsim.brief import counted
from fcsim.command_line.masonry.arguments import add_export, read, stone
from fcsim.command_line.terminal import print_table, say, say_json
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry import MasonryProblem, Movement, Settlement

_SHOWN = 12


def add_settle(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> argparse.ArgumentParser:
    """Add the command `settle`."""
    settle = commands.add_parser(
        "settle",
        help="forces of supports and cracks of a masonry structure whose supports give way",
        description="Move or turn a support step by step in statics; print the forces of the supports, the widest joint, and where the "
        "structure falls. Without --move and --turn: the model's support_motion, held for 1 s.",
    )
    settle.add_argument("--of", metavar="NAME", help="the support that moves (default: the only one)")
    settle.add_argument("--move", type=_three, metavar="X,Y,Z", help="[m] its displacement in the end: 0.01,0,0, --move=-0.01,0,0")
    settle.add_argument("--turn", type=_three, metavar="X,Y,Z", help="[degrees] its turn in the end, a rotation vector: 0,2,0")
    settle.add_argument("--about", type=_three, metavar="X,Y,Z", help="[m] the point about which it turns (default: its centroid)")
    settle.add_argument("--steps", type=int, default=100, help="of the movement (default 100)")
    add_export(settle, "the blocks in the end, to a file")
    settle.set_defaults(act=_settle)
    return settle


def _three(text: str) -> tuple[float, float, float]:
    """The vector of three numbers x,y,z; no names of axes, which would be movements of a metre."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected three numbers 0.01,0,0, got {text!r}") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise argparse.ArgumentTypeError(f"expected three finite numbers, got {text!r}")
    return x, y, z


def _movements(options: argparse.Namespace, problem: MasonryProblem) -> tuple[Movement, ...]:
    from fcsim.masonry import Movement, movements_of

    if options.move is None and options.turn is None:
        for name in ("of", "about"):
            if getattr(options, name) is not None:
                raise InputError(f"--{name}: expected it with --move or --turn")
        found = movements_of(problem)
        if not found:
            raise InputError(f"{options.model}: expected --move or --turn, or support_motion in the file, got none")
        return found
    if options.about is not None and options.turn is None:
        raise InputError("--about: expected it with --turn")
    held = [block.name for block in problem.blocks if block.support]
    if options.of is None and len(held) != 1:
        raise InputError(f"--of: expected which support moves ({', '.join(held[:8])}), got none")
    x, y, z = (math.radians(angle) for angle in options.turn or (0.0, 0.0, 0.0))
    return (Movement(options.of or held[0], options.move or (0.0, 0.0, 0.0), (x, y, z), options.about),)


def _settle(options: argparse.Namespace) -> int:
    from fcsim.masonry import settle
    from fcsim.masonry.exports import moved_blocks, refuse_format, write_blocks

    if options.export is not None:
        refuse_format(options.export)
    problem = read(options)
    movements = _movements(options, problem)
    seen = settle(problem, movements, steps=options.steps, blocks=options.blocks, stone=stone(options))
    if options.json:
        from fcsim.masonry.exports.settlement import settlement_summary

        say_json(settlement_summary(problem, movements, seen))
    else:
        _print(problem, seen)
    if options.export is not None:  # told before a full disk refuses the files
        write_blocks(options.export, moved_blocks(problem, seen.model, seen.x))
    if options.out is not None:
        _write(options, problem, seen)
        if not options.json:
            say(f"history, cracks and pictures: {options.out}")
    return EXIT_OK


def _write(options: argparse.Namespace, problem: MasonryProblem, seen: Settlement) -> None:
    from fcsim.masonry.exports.settlement import write_settlement
    from fcsim.masonry.report import write_openings
    from fcsim.view.cracks import draw_cracks
    from fcsim.view.histories import draw_settlement

    name = problem.title or problem.name
    write_settlement(options.out, problem, _movements(options, problem), seen)
    write_openings(options.out / "openings.csv", problem, seen.joints)
    draw_settlement(seen, options.out / "settle.png", name)
    if problem.dimension == 2:
        draw_cracks(
            problem, seen.model, seen.x, seen.joints, options.out / "cracks.png", f"{name}: {1e3 * seen.moved[-1]:.4g} mm of its support"
        )


def _print(problem: MasonryProblem, seen: Settlement) -> None:
    from fcsim.masonry.exports.settlement import columns_of, rows_of
    from fcsim.masonry.histories.settle import ROTATION
    from fcsim.masonry.openings import in_mm

    rows = rows_of(problem, seen, digits=6)
    shown = sorted({0, 1, len(rows) - 1, *range(0, len(rows), max(len(rows) // _SHOWN, 1))} & set(range(len(rows))))
    print_table(columns_of(problem, seen), [rows[k] for k in shown])
    name = problem.title or problem.name
    end = f"{1e3 * seen.moved[-1]:.5g} mm"
    what = "falls when its support has moved by" if seen.falls else "stands still at"
    say(f"{name}: {what} {end}; {counted(int(seen.open_joints[-1]), 'joint')} open")
    if seen.turned:
        say(f"ends there: beyond it a block turns by more than {ROTATION:g} degree, and elastic blocks are computed for small turns")
    for joint in sorted(seen.joints, key=lambda joint: -joint.opening)[:6]:
        if joint.opening > 1e-3 * seen.opening[-1] > 0:
            opening, slip = in_mm(joint.opening, problem), in_mm(joint.slip, problem)
            say(f"  {joint.between[0]} | {joint.between[1]}: open {opening:.4g} mm, slipped {slip:.4g} mm")
