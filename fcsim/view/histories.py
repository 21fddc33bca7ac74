"""Histories of a structure on ground that shakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fcsim.masonry.shake import Shake
from fcsim.view.style import STYLE, figure, matplotlib, prefixed, save


def draw_shake(seen: Shake, path: Path, title: str) -> Path:
    """Draw the largest displacement of a corner and the largest turn of a block by time."""
    scale, unit = prefixed("m", seen.displacement)
    with matplotlib().rc_context({**STYLE, "savefig.dpi": 160}):
        drawing = figure(7.0, 5.0, layout="constrained")
        above, below = drawing.subplots(2, 1, sharex=True)
        above.plot(seen.t, seen.displacement / scale, color="#33608c", linewidth=1.2)
        above.set_ylabel(f"largest displacement [{unit}]")
        below.plot(seen.t, np.degrees(seen.turn), color="#8c5a33", linewidth=1.2)
        below.set_ylabel("largest turn [degrees]")
        below.set_xlabel("t [s]")
        above.set_title(title, wrap=True, fontsize=10)
        return save(drawing, path)
