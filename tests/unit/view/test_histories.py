"""The picture of a settlement."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib import colors, rcParams
from PIL import Image

from fcsim.masonry.histories.settle import Settlement
from fcsim.view.histories import draw_settlement
from fcsim.view.style import STYLE, matplotlib


@pytest.mark.parametrize("supports", [2, 3])
def test_forces_that_are_equal_are_all_seen(tmp_path: Path, supports: int) -> None:
    """The thrusts of an arch's two abutments are, and one hid the other but for its name in the legend."""
    moved, force = np.linspace(0.0, 0.01, 20), np.column_stack([np.linspace(3e3, 2e3, 20), np.full(20, 9e3)])
    forces = {f"abutment {k}": force for k in range(supports)}
    seen = Settlement(moved, forces, moved, moved, np.arange(20.0), False, False, (), None, np.zeros(3))  # type: ignore[arg-type]
    image = np.asarray(Image.open(draw_settlement(seen, tmp_path / "settle.png", "Arch")).convert("RGB")).astype(int)
    with matplotlib().rc_context(STYLE):
        cycle = rcParams["axes.prop_cycle"].by_key()["color"]
    for colour in cycle[:supports]:
        like = (np.abs(image - 255 * np.array(colors.to_rgb(colour))) <= 8).all(-1)
        above, middle = np.array_split(like, 3)[:2]
        assert above.sum() > 700 and middle.sum() > 700
