"""The arch of voussoirs: its joints meet, its surfaces lie on the circles."""

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.arch import semicircular_arch
from fcsim.mesh.material import Material
from fcsim.mesh.quality import cell_volumes

MATERIAL = Material(E=2.2e9, nu=0.2, density=2000)


@pytest.mark.parametrize("depth", [0.3, None])
@pytest.mark.parametrize("along", [1, 3])
def test_semicircular_arch(depth, along):
    """Joints coincide and face each other, springings are level, nodes lie on both circles, the volume is that of the chords' polygons."""
    n, radius, thickness = 7, 2.0, 0.3
    divisions = (along, 2) if depth is None else (along, 1, 2)
    arch = semicircular_arch(n, radius, thickness, depth, divisions, material=MATERIAL)
    assert len({id(body.part) for body in arch.bodies}) == 1
    up = 1 if depth is None else 2
    for left, right in arch.joints():
        a, b = (arch.bodies[left], arch.bodies[right])
        mine, other = (body.points[np.unique(body.surfaces[side])] for body, side in ((a, "x+"), (b, "x-")))
        assert np.abs(mine[:, None] - other[None]).max(axis=2).min(axis=1) == pytest.approx(0, abs=1e-12)
    first, last = arch.bodies[0], arch.bodies[-1]
    assert first.points[np.unique(first.surfaces["x-"])][:, up] == pytest.approx(0, abs=1e-12)
    assert last.points[np.unique(last.surfaces["x+"])][:, up] == pytest.approx(0, abs=1e-12)
    assert first.points[:, 0].max() < 0 < last.points[:, 0].min()
    for body in arch.bodies:
        for side, r in ((arch.intrados, radius - thickness / 2), (arch.extrados, radius + thickness / 2)):
            nodes = body.points[np.unique(body.surfaces[side])]
            assert np.hypot(nodes[:, 0], nodes[:, up]) == pytest.approx(r)
    outer, inner, d = radius + thickness / 2, radius - thickness / 2, np.pi / n / along
    volume = along * 0.5 * np.sin(d) * (outer**2 - inner**2) * (depth or 1.0)
    part = arch.bodies[0].part
    assert cell_volumes(part.points, part.cells, part.cell_type).min() > 0
    assert cell_volumes(part.points, part.cells, part.cell_type).sum() == pytest.approx(volume)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"voussoirs": 1}, "voussoirs: expected a whole number >= 2, got 1"),
        ({"voussoirs": 7.5}, "got 7.5"),
        ({"thickness": 0.0}, "thickness > 0"),
        ({"thickness": 3.0}, "thickness > 0 and < 2 radius, got 3.0"),
        ({"radius": float("nan")}, "radius nan"),
        ({"divisions": (1, 1)}, "divisions: expected 3 whole numbers"),
    ],
)
def test_arches_that_cannot_be(options, message):
    with pytest.raises(InputError, match=message):
        semicircular_arch(**options, material=MATERIAL)
