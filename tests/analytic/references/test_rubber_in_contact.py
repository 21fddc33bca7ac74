"""Published contact problems of finite strain: B5, B8, B11 of the reference list of issue 16."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.blocks import rigid_rectangle
from fcsim.mesh.material import mooney_rivlin, neo_hooke
from fcsim.mesh.part import Body
from tests.analytic.references.loading import loaded, pair, support_force
from tests.analytic.references.meshes import block, sector, spaced


def quarter_disk(radius: float) -> object:
    """[0, 1]^2 to a quarter of a disk: squares in the middle, circles at the rim."""

    def at(p: np.ndarray) -> np.ndarray:
        share, length = p.max(axis=1), np.linalg.norm(p, axis=1)
        circle = np.divide(share, length, out=np.ones_like(share), where=length > 0)
        return radius * p * (0.85 * (1 - share) + share * circle)[:, None]

    return at


@pytest.mark.parametrize(("n", "steps"), [(8, 10), pytest.param(16, 20, marks=pytest.mark.slow)])
def test_B5_rubber_cylinder_between_plates(n: int, steps: int) -> None:
    """VM201, T. Sussman and K. J. Bathe: R 200 mm, plane strain, C10 0.293, C01 0.177, K 1410 MPa, frictionless plates closed by 100 and
    200 mm: 250 and 1400 N/mm, read off a figure."""
    part = block("disk", [spaced(0, 1, n)] * 2, mooney_rivlin(0.293, 0.177, 1410.0, 1e-9), "Q1-bbar", quarter_disk(200.0))
    model = build_model(
        [Body("disk", part), rigid_rectangle("plate", (600.0, 50.0), (0.0, 225.0), 1.0)],
        supports=[
            Support("disk", ("x",), "x-"),
            Support("disk", ("y",), "y-"),
            Support("plate", ("x", "rz")),
            Support("plate", ("y",), velocity=-100.0),
        ],
    )
    pairs = [pair(model, ("disk", side), ("plate", "y-"), alert=50.0, rule="nodes") for side in ("y+", "x+")]
    found = loaded(model, pairs, steps)
    force = [2 * support_force(model, step, "disk")[:, 1].sum() for step in found]
    assert_allclose([force[steps // 2 - 1], force[-1]], [250.0, 1400.0], rtol=0.05)


@pytest.mark.slow
def test_B8_press_fit() -> None:
    """K. A. Fischer and P. Wriggers: a block 450 x 200 (half), E 1000, nu 0.47, is pushed from a channel 199 high over a taper into one
    149 high, E 21000, nu 0.3, mu 0.1: horizontal force 3.66e4 at its peak, 2.50e4 N/mm within the narrow part."""
    x = np.concatenate([spaced(0, 800, 16), spaced(800, 1000, 8)[1:], spaced(1000, 1900, 30)[1:]])

    def channel(p: np.ndarray) -> np.ndarray:
        wall = np.interp(p[:, 0], [0, 800, 1000, 1900], [199.0, 199.0, 149.0, 149.0])
        return np.stack([p[:, 0], wall + (449 - wall) * p[:, 1]], axis=1)

    outer = block("channel", [x, spaced(0, 1, 6)], neo_hooke(21000.0, 0.3, 1e-9), "Q1", channel)
    inner = block("block", [spaced(0, 450, 24), spaced(0, 200, 10)], neo_hooke(1000.0, 0.47, 1e-9), "Q1-bbar")
    model = build_model(
        [Body("block", inner), Body("channel", outer)],
        supports=[
            Support("channel", ("x", "y"), "y+"),
            Support("block", ("y",), "y-"),
            Support("block", ("x",), "x-", velocity=lambda t: 0.0 if t < 1 else 1000.0 / 100),
        ],
    )
    joint = pair(model, ("block", "y+"), ("channel", "y-"), 0.1, alert=20.0, rule="nodes", normals="smooth")
    steps = loaded(model, [joint], 101, last=101.0)
    on = np.unique(inner.surfaces["x-"])
    force = np.array([support_force(model, step, "block")[on, 0].sum() for step in steps])
    assert_allclose(force.max(), 3.66e4, rtol=0.03)
    assert_allclose(force[-1], 2.50e4, rtol=0.03)


@pytest.mark.slow
def test_B11_ring_under_a_plate() -> None:
    """A. F. Saleeb, code_aster ssnp501: a quarter of a ring of radii 4.15 and 6.35 cm, E 407 N/cm2, nu 0.48, under a plate that is lowered
    by 2.225 cm: 8.008, 16.017, 24.025, 32.033 N at the quarters (their tolerances 10, 5, 2, 3 %). Plane strain: in plane stress, as the
    list has it, all four are 1 - nu^2 = 0.77 of that."""
    grid = [spaced(0, 1, 6), spaced(0, 1, 40)]
    part = block("ring", grid, neo_hooke(407.0, 0.48, 1e-3), "Q1-bbar", sector(4.15, 6.35, 0.0, 0.5 * np.pi))
    model = build_model(
        [Body("ring", part), rigid_rectangle("plate", (30.0, 1.0), (0.0, 6.85), 1.0)],
        supports=[
            Support("ring", ("y",), "y-"),
            Support("ring", ("x",), "y+"),
            Support("plate", ("x", "rz")),
            Support("plate", ("y",), velocity=-2.225),
        ],
    )
    steps = loaded(model, [pair(model, ("ring", "x+"), ("plate", "y-"), alert=1.0, rule="nodes")], 16)
    force = np.array([support_force(model, step, "ring")[:, 1].sum() for step in steps])[3::4]
    assert np.all(np.abs(force / [8.008, 16.017, 24.025, 32.033] - 1) < [0.10, 0.05, 0.02, 0.03])
