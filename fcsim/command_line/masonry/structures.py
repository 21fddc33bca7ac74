"""fcsim limit | tilt | push | shake | settle, what a structure of blocks bears: each in a file beside, here what they share."""

from __future__ import annotations

import argparse
from pathlib import Path

from fcsim.command_line.masonry.arguments import add_model, add_stone
from fcsim.command_line.masonry.limit import add_limit
from fcsim.command_line.masonry.settle import add_settle
from fcsim.command_line.masonry.shake import add_shake
from fcsim.command_line.masonry.tilt_and_push import add_push, add_tilt, add_trials


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands `limit`, `tilt`, `push`, `shake` and `settle`."""
    limit, tilt, push = add_limit(commands), add_tilt(commands), add_push(commands)
    shake, settle = add_shake(commands), add_settle(commands)
    for command in (limit, tilt, push, shake, settle):
        add_model(command)
        if command not in (shake, settle):
            command.add_argument("--tolerance", type=float, help="[m] blocks that are nearer touch (default 1e-4 of the smallest block)")
        command.add_argument("--out", type=Path, help="folder for the analysis (JSON), its joints (CSV) and the picture of the mechanism")
        command.add_argument("--json", action="store_true", help="print JSON")
    for command in (tilt, push, shake, settle):
        add_stone(command)
    for command in (tilt, push):
        add_trials(command)
