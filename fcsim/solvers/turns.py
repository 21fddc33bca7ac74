"""Methods that can pause: they work by turns, so that another can work in between and the better one arrive first."""

from __future__ import annotations

from collections.abc import Generator

from fcsim.solvers.base import Iterate

Turns = Generator[None, None, Iterate]
"""Yields between two turns, whenever it can be left or go on later; returns the iterate and why it stopped."""


def to_the_end(turns: Turns) -> Iterate:
    """All the turns, one after the other."""
    while True:
        try:
            next(turns)
        except StopIteration as stop:
            iterate: Iterate = stop.value
            return iterate
