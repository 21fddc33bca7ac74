"""Joints on a picture: each facet in the colour of its opening, as thick as that where it is seen from its edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.running.folder import Instant
from fcsim.view.joints.joints import Joints, configuration
from fcsim.view.scene import COLOUR_MAP, Scene
from fcsim.view.style import matplotlib, prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import ListedColormap

HAIR = 1e-3
"""Of the largest opening: less is drawn as closed."""
ROUND_OFF = 1e-9
"""Of the size of the whole: an opening that is smaller is none."""


def crack_colours() -> ListedColormap:
    """From a hair to the widest crack, none of them as pale as stone."""
    return matplotlib().colors.ListedColormap(matplotlib().colormaps[COLOUR_MAP](np.linspace(0.25, 0.85, 256)))


def opened(joints: Joints, instant: Instant, size: float) -> FloatArray:
    """Openings (nf,) [m] at an instant, 0 where the joint is closed; all of them where nothing opened beyond round-off."""
    opening = np.maximum(joints.opening(configuration(instant)), 0.0)
    return opening if opening.max(initial=0.0) > ROUND_OFF * size else np.zeros_like(opening)


def draw_joints(axes: Axes, scene: Scene, instant: Instant, joints: Joints, opening: FloatArray) -> None:
    """Put the facets of open joints on an image of the scene, the widest on top, and names the width of the widest of three joints."""
    from matplotlib.collections import PolyCollection

    most = float(opening.max())
    order = np.argsort(opening)
    order = order[opening[order] > HAIR * most]
    k = joints.own.shape[1]
    places = joints.corners(configuration(instant, scene.survey.exaggeration))
    points = scene.pixels(places.reshape(-1, 3)).reshape(-1, k, 2)
    share = opening[order] / most
    colours = crack_colours()(share)
    axes.add_collection(
        PolyCollection(
            list(points[order]), closed=k > 2, facecolors=colours, edgecolors=colours, linewidths=0.6 + 4.4 * share, capstyle="round"
        )
    )
    scale, unit = prefixed("m", [most])
    for number in widest(joints, opening, 3):
        x, y = points[number].mean(axis=0)
        text = f"{opening[number] / scale:.3g} {unit}"
        box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
        axes.annotate(text, (x, y), xytext=(10, 8), textcoords="offset points", fontsize=10, bbox=box)


def widest(joints: Joints, opening: FloatArray, number: int) -> list[int]:
    """The widest facet of each of the `number` widest joints, of those at least a tenth as wide as the widest of all."""
    chosen: dict[tuple[int, int], int] = {}
    for facet in np.argsort(-opening):
        if len(chosen) == number or opening[facet] <= 0.1 * opening.max():
            break
        first, second = sorted(joints.bodies[facet].tolist())
        chosen.setdefault((first, second), int(facet))
    return list(chosen.values())
