"""Histories of a structure on ground that shakes, and on supports that give way."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fcsim.masonry.histories.settle import Settlement
from fcsim.masonry.histories.shake import Shake
from fcsim.view.style import figure, prefixed, save, styled


def draw_shake(seen: Shake, path: Path, title: str) -> Path:
    """Draw the largest displacement of a corner and the largest turn of a block by time."""
    scale, unit = prefixed("m", seen.displacement)
    with styled():
        drawing = figure(7.0, 5.0, layout="constrained")
        above, below = drawing.subplots(2, 1, sharex=True)
        above.plot(seen.t, seen.displacement / scale, color="#33608c", linewidth=1.2)
        above.set_ylabel(f"largest displacement [{unit}]")
        below.plot(seen.t, np.degrees(seen.turn), color="#8c5a33", linewidth=1.2)
        below.set_ylabel("largest turn [degrees]")
        below.set_xlabel("t [s]")
        above.set_title(title, wrap=True, fontsize=10)
        return save(drawing, path)


def draw_settlement(seen: Settlement, path: Path, title: str) -> Path:
    """Draw the horizontal and vertical forces of supports and the widest joint by the movement."""
    scale, unit = prefixed("m", seen.moved)
    wide, of_wide = prefixed("m", seen.opening)
    largest, of_force = prefixed("N", [float(np.abs(force).max()) for force in seen.forces.values()])
    with styled():
        drawing = figure(7.0, 7.0, layout="constrained")
        across, up, below = drawing.subplots(3, 1, sharex=True)
        widths = np.linspace(min(1.2 * len(seen.forces), 6.0), 1.2, len(seen.forces))  # thinner over wider: abutments' thrusts are equal
        for (name, force), width in zip(seen.forces.items(), widths, strict=True):
            across.plot(seen.moved / scale, seen.thrust(name) / largest, linewidth=width, label=name)
            up.plot(seen.moved / scale, force[:, -1] / largest, linewidth=width, label=name)
        below.plot(seen.moved / scale, seen.opening / wide, color="#8c5a33", linewidth=1.2)
        across.set_ylabel(f"thrust [{of_force}]")
        up.set_ylabel(f"vertical force [{of_force}]")
        below.set_ylabel(f"widest joint [{of_wide}]")
        below.set_xlabel(f"movement of the support [{unit}]" + (", falls then" if seen.falls else ""))
        across.legend(fontsize=8)
        across.set_title(title, wrap=True, fontsize=10)
        return save(drawing, path)
