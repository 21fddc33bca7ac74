"""Two slender cantilevers, the tip of one pushed on to the other and down with it (B12 of the reference list)."""

import numpy as np
from numpy.testing import assert_allclose

import fcsim
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.material import saint_venant_kirchhoff
from fcsim.mesh.part import Body
from fcsim.timestep.step import Step
from tests.analytic.references.loading import loaded, pair, support_force
from tests.analytic.references.meshes import block, spaced

LENGTH, HEIGHT, WIDTH, E = 2032.0, 63.5, 10.16, 6894.8
ROOT, ABOVE, LOADED, DOWN = 2946.4, 508.0, 1320.8, 790.0
"""[mm], [MPa]: the upper root's place, how much higher the upper beam lies, where it is loaded, from its root, and how far."""

PUBLISHED = {158.0: 437.0, 316.0: 1668.0}
"""Force by displacement at the first two fifths, code_aster ssnv505."""


def pushed(down: float, steps: int, cells: int) -> tuple[fcsim.Model, list[Step]]:
    """In plane stress, with quadratic cells, the point of load free to move along and to turn."""
    law = saint_venant_kirchhoff(E, 0.3333, 1e-9)
    beams = [
        block(name, [spaced(a, b, cells), spaced(y, y + HEIGHT, 2)], law, "Q2", plane="stress", thickness=WIDTH)
        for name, a, b, y in (("lower", 0.0, LENGTH, 0.0), ("upper", ROOT - LENGTH, ROOT, ABOVE))
    ]
    held = [Support("lower", ("x", "y"), "x-"), Support("upper", ("x", "y"), "x+")]
    model = build_model([Body(part.name, part) for part in beams], supports=held)
    load = fcsim.Control("load", (("upper", (ROOT - LOADED, ABOVE + HEIGHT), 1.0),), (0.0, -1.0), down)
    sides = (("upper", "y-"), ("lower", "y+"))
    pairs = [pair(model, *order, alert=100.0, rule="nodes", normals="smooth") for order in (sides, sides[::-1])]
    return model, loaded(model, pairs, steps, linkage=fcsim.Linkage(model, [load]))


def test_B12_two_cantilevers() -> None:
    """Before they touch 3 E I / L^3, and the tip goes down 1 + 1.5 (2032 - 1320.8) / 1320.8 = 1.81 times as far: they touch at 246 mm. The
    published forces are 1.41 times those found, before and after: of bricks that lock in bending by that much."""
    model, steps = pushed(316.0, 10, 15)
    force = np.array([np.linalg.norm(step.link_force("load")) for step in steps])
    at = 31.6 * np.arange(1, 11)
    stiffness = 3 * E * WIDTH * HEIGHT**3 / 12 / LOADED**3
    assert_allclose(force[:5], stiffness * at[:5], rtol=0.02)
    touching = np.array([support_force(model, step, "lower")[:, 1].sum() > 1e-3 for step in steps])
    assert np.array_equal(touching, at > (ABOVE - HEIGHT) / (1 + 1.5 * (LENGTH - LOADED) / LOADED))
    for step in steps:
        total = sum(support_force(model, step, name)[:, 1].sum() for name in ("lower", "upper"))
        assert_allclose(total, np.linalg.norm(step.link_force("load")), rtol=1e-6)
    assert_allclose([p / np.interp(x, at, force) for x, p in PUBLISHED.items()], 1.41, atol=0.02)
