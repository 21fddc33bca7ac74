"""The curve of a push by displacement."""

from __future__ import annotations

from pathlib import Path

from fcsim.masonry.histories.branch import Branch
from fcsim.view.style import figure, prefixed, save, styled


def draw_branch(branch: Branch, path: Path, title: str) -> Path:
    """Draw the multiplier by displacement, its largest value and where the structure falls by itself or runs away."""
    scale, unit = prefixed("m", branch.displacement)
    with styled():
        drawing = figure(7.0, 4.2, layout="constrained")
        axes = drawing.add_subplot()
        axes.plot(branch.displacement / scale, branch.multiplier, color="#33608c", linewidth=1.6)
        top = int(branch.multiplier.argmax())
        axes.plot(branch.displacement[top] / scale, branch.largest, "o", color="#33608c", markersize=5)
        axes.annotate(
            f"{branch.largest:.5g}", (branch.displacement[top] / scale, branch.largest), xytext=(8, 2), textcoords="offset points"
        )
        if branch.end is not None:
            axes.axvline(branch.end / scale, color="#8c8c8c", linewidth=0.8, linestyle="--")
            axes.annotate(
                "falls by itself", (branch.end / scale, 0.5 * branch.largest), rotation=90, ha="right", va="center", color="#606060"
            )
        elif not branch.held:
            last = branch.displacement[-1] / scale, branch.multiplier[-1]
            axes.plot(*last, "x", color="#8c3333")
            axes.annotate("runs away", last, xytext=(-6, 8), textcoords="offset points", ha="right", color="#8c3333")
        axes.set_xlabel(f"mean displacement along the load [{unit}]")
        axes.set_ylabel("load multiplier")
        axes.set_ylim(0.0, 1.12 * branch.largest or None)  # room for its number, below the title
        axes.set_title(title, wrap=True, fontsize=10)
        return save(drawing, path)
