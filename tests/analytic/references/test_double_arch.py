"""The double arch: a half ring of two layers pressed into a soft block, slides, lifts off and snaps (problem B7 of the reference list)."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.material import ByRegion, FinitePlastic, neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.step import Step
from tests.analytic.references.loading import displacement, loaded, pair, support_force
from tests.analytic.references.meshes import block, sector, spaced

INNER, OUTER, BASE = 1e5, 1e3, 3e2
"""Young's moduli [MPa] of the ring's layers, radii 85 to 90 and 90 to 95 mm, and of the block, 250 x 50 mm; nu is 0.3."""


def hencky(E: float, nu: float, density: float) -> FinitePlastic:
    """Elasticity in logarithmic strains: code_aster's GDEF_LOG with a yield stress out of reach."""
    return FinitePlastic(E, nu, density, 1e6 * E)


def pressed(
    depth: float,
    steps: int,
    mu: float,
    law: Any,
    *,
    ring: tuple[str, int, int],
    base: tuple[int, int],
    soft: float = BASE,
    unit: float = 1.0,
    **rule: Any,
) -> tuple[Model, list[Step]]:
    """Half of it, ends lowered by depth [mm]; ring: elements, cells a layer and along the quarter; base: cells of half the block. soft:
    the block's modulus [MPa]. unit: of length in mm, forces stay N."""
    elements, layers, along = ring
    E = np.array([INNER, OUTER, soft]) * unit**2
    material = ByRegion({"inner": law(E[0], 0.3, 1.0), "outer": law(E[1], 0.3, 1.0)})
    grid = [np.unique([*spaced(0, 0.5, layers), *spaced(0.5, 1, layers)]), spaced(0, 1, along)]
    arc = sector(85 / unit, 95 / unit, -0.5 * np.pi, 0.0, (0.0, 95 / unit))
    regions = {"inner": lambda p: p[:, 0] < 0.5, "outer": lambda p: p[:, 0] > 0.5}
    half_ring = block("ring", grid, material, elements, arc, regions=regions)
    bed = block("base", [spaced(0, 125 / unit, base[0]), spaced(-50 / unit, 0, base[1])], law(E[2], 0.3, 1.0))
    model = build_model(
        [Body("ring", half_ring), Body("base", bed)],
        supports=[
            Support("base", ("x", "y"), "y-"),
            Support("base", ("x",), "x-"),
            Support("ring", ("x",), "y-"),
            Support("ring", ("x",), "y+"),
            Support("ring", ("y",), "y+", velocity=-depth / unit),
        ],
    )
    slave, master = ("base", "y+"), ("ring", "x+")
    return model, loaded(model, [pair(model, slave, master, mu=mu, alert=5 / unit, **rule)], steps, tol=1e-9)


def at(model: Model, step: Step, body: str, x: float, y: float) -> np.ndarray:
    """Displacement (2,) of the body's node next to (x, y)."""
    points = model.deformable[model.number[body]].points
    return displacement(model, step, body)[np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y))]


CODE_ASTER: dict[str, Any] = {"ring": ("Q1", 2, 15), "base": (15, 4), "rule": "nodes", "normals": "smooth"}
"""240 linear quadrilaterals, as ssnp165 counts them (how they are laid out is not stored), smoothed normals, the block the slave."""
BULGE = 95 * (1 - np.cos(np.pi / 4 / 15))
"""[mm] between the chords of 15 cells, on which code_aster's contact is, and the ring's outer circle, on which ours is."""


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_B7_of_code_aster(unit: float) -> None:
    """ssnp165a, frictionless: the block's middle at 16 and 34 mm, and its point 66.7 mm aside; what follows there is dynamic."""
    model, steps = pressed(34.0, 17, 0.0, hencky, unit=unit, **CODE_ASTER)
    middle = [unit * at(model, steps[k], "base", 0.0, 0.0)[1] for k in (7, 16)]
    assert_allclose(middle, [-4.2957, -2.4839], atol=BULGE)
    assert_allclose(unit * at(model, steps[16], "base", 200 / 3 / unit, 0.0)[1], -5.2568, rtol=0.03)


@pytest.mark.slow
def test_B7_of_code_aster_with_friction() -> None:
    """ssnp165b, mu = 0.5: the block's middle and its point 66.7 mm aside at 16, 34, 52, 61 and 70 mm. Friction holds the ring, so that
    nothing snaps, and drags the block's surface along. The published run is dynamic, in 20 steps: it falls behind by up to 15 % in its
    second half."""
    model, steps = pressed(70.0, 35, 0.5, hencky, **CODE_ASTER)
    chosen = [steps[k] for k in (7, 16, 25, 30, 34)]
    middle = np.array([at(model, step, "base", 0.0, 0.0) for step in chosen])[:, 1]
    aside = np.array([at(model, step, "base", 200 / 3, 0.0) for step in chosen])
    assert_allclose(middle[:2], [-4.3810, -2.9421], rtol=0.03)
    assert_allclose(middle[2:], [0.6984, np.interp(62, (61, 70), (1.5492, 2.4075)), 2.4075], rtol=0.15)
    assert_allclose(aside[[1, 2, 4]], [[-2.0772, -5.4678], [-5.9788, -11.4441], [-12.5997, -10.4218]], rtol=0.16)


@pytest.mark.slow
def test_B7_refined() -> None:
    """Frictionless with neo-Hooke and quadratic cells: the middle of the ring goes down by 2.4 mm and no more, on two meshes and by two
    rules of contact, 2 % apart; 15 linear cells along the quarter, which are too stiff in bending, press it almost twice as deep. What
    Poulios and Renard's curve shows, read off Kratos' figure, 4.8 and 5.9 mm at 10 and 20 mm, belongs to other moduli or to such a mesh:
    a block of 100 MPa gives 4.75 and 6.15."""
    meshes: list[dict[str, Any]] = [
        {"ring": ("Q2", 1, 16), "base": (26, 10), "rule": "nodes"},
        {"ring": ("Q2", 1, 32), "base": (52, 20), "rule": "mortar"},
        CODE_ASTER,
    ]
    depth = []
    for mesh in meshes:
        model, steps = pressed(20.0, 4, 0.0, neo_hooke, **mesh)
        depth.append([at(model, step, "ring", 0.0, 0.0)[1] for step in steps])
    fine, finer, locked = np.array(depth)
    assert_allclose(fine, finer, rtol=0.02)
    assert -2.5 < finer.min() < -2.3
    assert_allclose(locked[2] / finer[2], 1.9, atol=0.1)
    for step in steps:  # the block's bottom bears what the ring's ends press, and half of it is the sum over half the model
        force = support_force(model, step, "ring")[:, 1].sum() + support_force(model, step, "base")[:, 1].sum()
        assert abs(force) < 1e-6 * abs(support_force(model, step, "ring")[:, 1].sum())


QUADRATIC: dict[str, Any] = {"ring": ("Q2", 1, 16), "base": (26, 10), "rule": "nodes", "normals": "smooth"}


@pytest.mark.slow
def test_B7_of_poulios_renard() -> None:
    """Their curve at 10, 20, 30 and 40 mm, read off to a hundredth of its 66 mm, is met to that and to the bulge of
    32 chords with a block of 100 MPa: the 1e8 of the script of this ring that comes with GetFEM, Poulios' own."""
    model, steps = pressed(40.0, 16, 0.0, neo_hooke, soft=100.0, **QUADRATIC)
    assert_allclose([at(model, steps[k], "ring", 0.0, 0.0)[1] for k in (3, 7, 11, 15)], [-4.8, -5.9, -5.2, -3.5], atol=0.66 + BULGE / 4)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "rise"), [(0.0, 34.9), (0.5, 3.1)])
def test_B7_through_the_snap(mu: float, rise: float) -> None:
    """Quasi-static to 70 mm on quadratic cells: without friction the ring's middle snaps up by 35 mm while the ends go from 40 to 50 mm,
    with friction, which holds its flanks, it rises by 3. Forces are in equilibrium all along."""
    model, steps = pressed(70.0, 35, mu, neo_hooke, **QUADRATIC)
    middle = np.array([at(model, step, "ring", 0.0, 0.0)[1] for step in steps])
    assert_allclose(middle[24] - middle[19], rise, rtol=0.05)
    for step in steps:
        taken = [support_force(model, step, name)[:, 1].sum() for name in ("ring", "base")]
        assert abs(sum(taken)) < 1e-6 * abs(taken[0])
