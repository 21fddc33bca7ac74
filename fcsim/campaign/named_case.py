"""The case that a path stands for, for runs and sweeps: the masonry room is loaded for its files alone, since processes begin often."""

from __future__ import annotations

from pathlib import Path

from fcsim.running.case import CaseScript, load_case


def named_case(path: str | Path) -> CaseScript:
    """The case of a script, of a folder that holds one, of a known case by its name where no such path is there, or of a file of blocks as
    `fcsim.masonry.case.any_case` reads it."""
    if Path(path).suffix.lower() in ("", ".py"):
        return load_case(path)
    from fcsim.masonry.case import any_case  # a tenth of a second of processor time

    return any_case(path)
