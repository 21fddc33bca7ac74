"""Where runs begin: the velocities of what supports drive by displacements and angles, however short their times are."""

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.mesh.blocks import rigid_box
from fcsim.timestep import at_rest


@pytest.mark.parametrize("period", [1.0, 1e-3, 1e-6, 1e-8])
@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_driven_motions_begin_at_their_own_rates(period: float, size: float) -> None:
    """a sin(2 pi t / T) begins at 2 pi a / T, a displacement as an angle; what is held, at none."""
    rate = 2 * np.pi / period
    box, wheel = rigid_box("box", (1.0,) * 3, (0.0, 0.0, 0.0), 1.0), rigid_box("wheel", (1.0,) * 3, (3.0, 0.0, 0.0), 1.0)
    supports = [
        Support("box", ("x",), displacement=lambda t: size * np.sin(rate * t)),
        Support("box", ("y", "z", "rx", "ry", "rz")),
        DrivenRotation("wheel", angle=lambda t: size * np.sin(rate * t), point=(3.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
    ]
    model = build_model([box, wheel], supports=supports)
    v = at_rest(model).v
    assert v[0] == pytest.approx(size * rate, rel=1e-3) and v[11] == pytest.approx(size * rate, rel=1e-3)
    assert np.abs(np.delete(v, [0, 11])).max() <= 1e-12 * size * rate
    assert np.array_equal(v, at_rest(model, h=1e-3).v) == (period >= 1e-3)
