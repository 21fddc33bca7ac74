"""The crack map: a plane structure with its joints coloured by their openings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.masonry.openings import OPEN, Opening
from fcsim.masonry.problem import MasonryProblem
from fcsim.view.joints.draw import HAIR, crack_colours
from fcsim.view.style import figure, matplotlib, prefixed, save, styled

_SUPPORTS = 0.25
"""Of the free blocks' extent: so far beyond them their supports are seen."""


def draw_cracks(problem: MasonryProblem, model: Model, x: FloatArray, joints: tuple[Opening, ...], path: Path, title: str) -> Path:
    """Draw blocks of a plane problem in the configuration x, each joint as a line whose colour and width are its opening."""
    if problem.dimension != 2:
        raise InputError(f"crack map of {problem.name!r}: expected a plane problem, got one in 3D")
    most = max((joint.opening for joint in joints), default=0.0)
    scale, unit = prefixed("m", [most])
    with styled():
        places = np.split(model.positions(x), model.node_offset[1:-1])
        held = [problem.blocks[problem.number[body.name]].support for body in model.bodies]
        width, height = np.ptp(_seen(places, held), axis=0)
        drawing = figure(9.0, float(np.clip(8.0 * height / max(width, 1e-9), 3.0, 12.0)) + 0.8, layout="constrained")
        axes = drawing.add_subplot()
        for corners, body, fixed in zip(places, model.bodies, held, strict=True):
            for side in body.surfaces["skin"]:
                axes.plot(*corners[side].T, color="#8c8c8c" if fixed else "#b0a890", linewidth=0.7, zorder=1)
        colours = crack_colours()
        none = most <= OPEN * problem.size
        for joint in sorted(joints, key=lambda joint: joint.opening):
            if joint.opening > HAIR * most and not none:
                share = joint.opening / most
                axes.plot(*zip(*joint.ends, strict=True), color=colours(share), linewidth=1.0 + 5.0 * share, zorder=2)
        margin = 0.05 * max(width, height)
        low, high = _seen(places, held)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("z [m]")
        axes.grid(False)
        # over the whole figure, however narrow the axes; what matplotlib wraps itself takes no part in its layout, and was cut
        drawing.suptitle(fill(title, 90), x=0.02, horizontalalignment="left", fontsize=10, fontweight="bold")
        if none:
            axes.set_title("no joint is open", loc="left", fontsize=10)
            return save(drawing, path)
        bar = matplotlib().cm.ScalarMappable(matplotlib().colors.Normalize(0.0, most / scale), colours)
        drawing.colorbar(bar, ax=axes, label=f"opening of the joint [{unit}]", shrink=0.8)
        return save(drawing, path)


def _seen(places: Sequence[FloatArray], held: Sequence[bool]) -> FloatArray:
    """Lowest and highest coordinates (2, d) [m] of what is drawn: the free blocks, and their supports as far as they are no ground that
    would leave the blocks small."""
    free = np.concatenate([place for place, fixed in zip(places, held, strict=True) if not fixed])
    every = np.concatenate(places)
    room = _SUPPORTS * float(np.ptp(free, axis=0).max())
    low = np.maximum(every.min(axis=0), free.min(axis=0) - room)
    high = np.minimum(every.max(axis=0), free.max(axis=0) + room)
    seen: FloatArray = np.stack([low, high])
    return seen
