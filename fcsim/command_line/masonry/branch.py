"""fcsim push --branch: the multiplier by displacement and its descending branch, as a table, CSV and a picture."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

from fcsim.command_line.terminal import Bar, print_table, say, say_json
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry import MasonryProblem

RESOLUTION = 0.005
"""Of the multiplier in trials, as a share of it."""
_SILENT = 10.0
"""[s] after which a push by displacement says where it is, a step that is taken again too."""


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
        say_json(branch_summary(branch))
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
