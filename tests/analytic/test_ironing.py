"""Shallow ironing: a stiff die pressed into a block of rubber and drawn along it (problem B6 of the reference list)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import Hyperelastic, neo_hooke
from fcsim.mesh.part import Body, Part
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

Law = Callable[[float, float, float], Any]
E = 68.96e7
TIMES = (0.5, 0.8, 1.0, 1.1, 1.5, 1.9, 2.0)
HARTMANN = (0.951, 2.213, 3.195, 3.955, 4.084, 3.793, 3.421)
"""Vertical reactions [1e8 N/m], read from the curves of S. Hartmann et al., as code_aster's test ssnp153 quotes them."""


POULIOS_RENARD = {
    0.5: (0.815, 0.155),
    0.8: (1.870, 0.375),
    1.0: (2.679, 0.553),
    1.05: (3.079, 1.024),
    1.1: (3.243, 0.994),
    1.25: (3.349, 1.002),
    1.5: (3.375, 1.021),
    1.75: (3.352, 1.005),
    1.9: (3.219, 0.898),
    2.0: (2.879, 0.640),
}
"""Vertical and horizontal reactions of K. Poulios and Y. Renard, 2015, as solids4foam's benchmark has read them off."""

KRATOS = {1.0: (2.69, 0.29), 1.5: (3.39, 0.0), 2.0: (2.92, -0.20)}
"""The same without friction, as Kratos' validation shows them, in agreement with Poulios and Renard, read off to 1 % of 3.4."""


def _ciarlet(F: Any, p: Any) -> Any:
    import ufl

    J = ufl.det(F)
    return 0.5 * p["mu"] * (ufl.inner(F, F) - 3) + 0.25 * p["lambda"] * (J**2 - 1) - (0.5 * p["lambda"] + p["mu"]) * ufl.ln(J)


def ciarlet_by_plane_stress(E: float, nu: float, density: float) -> Hyperelastic:
    """W = mu/2 (tr C - 3) + lambda*/4 (J^2 - 1) - (lambda*/2 + mu) ln J, P. G. Ciarlet's neo-Hooke, with plane stress' lambda* = 2 lambda
    mu / (lambda + 2 mu) in place of lambda."""
    mu, lame = 0.5 * E / (1 + nu), E * nu / ((1 + nu) * (1 - 2 * nu))
    return Hyperelastic(_ciarlet, density, {"mu": mu, "lambda": 2 * lame * mu / (lame + 2 * mu)})


def die(cells: tuple[int, int], law: Law) -> Part:
    """Its foot an arc of radius 0.75 about (0.8, 0.95) from x = 0.2 to 1.4, its top at 1.4."""
    square = rectangle("die", (1.0, 1.0), cells, law(10 * E, 0.32, 1.0))
    s, t = square.points.T
    angle = (2 * s - 1) * np.arcsin(0.8)
    foot = np.stack([0.8 + 0.75 * np.sin(angle), 0.95 - 0.75 * np.cos(angle)])
    top = np.stack([0.2 + 1.2 * s, np.full_like(s, 1.4)])
    return Part("die", (foot * (1 - t) + top * t).T, square.cells, square.cell_type, square.surfaces, square.material)


def of_elements(part: Part, elements: str) -> Part:
    return Part(part.name, part.points, part.cells, part.cell_type, part.surfaces, part.material, elements=elements)


def ironed(
    steps: int, last: int, block_slave: bool = False, mu: float = 0.3, law: Law = neo_hooke, elements: str = "Q1", **rule: Any
) -> dict[float, tuple[float, float]]:
    """Vertical and horizontal reactions [1e8 N/m] of the die's top by time: 1 down for t < 1, then 10 along for t < 2."""
    block = of_elements(rectangle("block", (12.0, 4.0), (60, 15), law(E, 0.32, 1.0), origin=(0.0, -4.0)), elements)
    supports = [
        Support("block", ("x", "y"), "y-"),
        Support("die", ("y",), "y+", velocity=lambda t: -1.0 if t < 1 else 0.0),
        Support("die", ("x",), "y+", velocity=lambda t: 10.0 if t > 1 else 0.0),
    ]
    model = build_model([Body("block", block), Body("die", of_elements(die((8, 6), law), elements))], supports=supports)
    surfaces = [contact_surface(model, [of]) for of in (("die", "y-"), ("block", "y+"))]
    slave, master = reversed(surfaces) if block_slave else surfaces
    detector = Detector([SurfacePair(slave, master, mu, 0.05, **rule)], model.n_nodes)
    top = model.dof_of_node[np.unique(model.facets("die", "y+"))]
    anywhere = Limits(rotation=np.inf, strain=np.inf)
    simulation = Simulation(model, detector, QuasiStatic(2 / steps), steps, limits=anywhere, witness=None)
    found = {}
    for step in simulation:
        force = step.support_impulse[top].sum(axis=0) / 1e8
        found[round(step.state.t, 9)] = (-float(force[1]), float(force[0]))
        if step.number == last:
            break
    return found


@pytest.mark.slow
def test_pressed_in_all_rules_of_contact_agree() -> None:
    """At full depth the pressure depends on the rule and on which surface is the slave by less than 1 %, and is Hartmann's to 2 %."""
    ways: list[dict[str, Any]] = [{"normals": "smooth"}, {}, {"candidates": "mortar"}, {"block_slave": True}]
    at_depth = np.array([ironed(40, 20, **way)[1.0] for way in ways])
    assert_allclose(at_depth[:, 0], at_depth[:, 0].mean(), rtol=0.01)
    assert_allclose(at_depth[:, 0], HARTMANN[2], rtol=0.02)
    assert_allclose(at_depth[:, 1], at_depth[:, 1].mean(), rtol=0.02)


@pytest.mark.parametrize("way", [{}, pytest.param({"block_slave": True}, marks=pytest.mark.slow)])
def test_first_touch_on_the_kink_between_two_facets(way: dict[str, Any]) -> None:
    """One node touches, with facets' own normals on the edge between two of them: the forces are those of interpolated normals, to 1e-6."""
    assert_allclose(ironed(40, 5, **way)[0.25], ironed(40, 5, normals="smooth")[0.25], rtol=1e-6)


@pytest.mark.slow
def test_drawn_along() -> None:
    """The vertical force all along is Hartmann's to 2 %, with the material as it is published."""
    found = ironed(100, 100, normals="smooth")
    assert_allclose([found[t][0] for t in TIMES], HARTMANN, rtol=0.02)
    ratio = found[1.5][1] / found[1.5][0]
    assert 0.30 < ratio < 0.35  # P&R 0.30, code_aster 0.34: the friction of 0.3 and what the ridge before the die adds


@pytest.mark.slow
def test_by_nodes_with_friction_it_begins_to_slide() -> None:
    """Nodes that stick in valleys of the block while the first of them slip: vertical forces are Hartmann's to 2 %."""
    found = ironed(40, 22)
    assert_allclose([found[t][0] for t in TIMES[2:4]], HARTMANN[2:4], rtol=0.02)


def test_poulios_renard_pressed_without_friction() -> None:
    """What Poulios and Renard and Kratos show lies 14 to 17 % below all others from the first load on, whatever the rule of contact, the
    cells, their order: their material is softer. Plane stress' lambda* in Ciarlet's energy, which GetFEM has as its neo-Hooke, meets it;
    lambda* alone is 4 % above, the energy alone 15 %, plane stress with it 3 %, plane stress without it 4 %."""
    found = ironed(20, 10, mu=0.0, law=ciarlet_by_plane_stress, normals="smooth")
    assert_allclose(found[1.0], KRATOS[1.0], rtol=0.02)
    published = ironed(20, 10, mu=0.0, normals="smooth")
    assert_allclose(published[1.0][0] / KRATOS[1.0][0], 1.16, atol=0.02)


@pytest.mark.slow
def test_poulios_renard_drawn_without_friction() -> None:
    found = ironed(40, 40, mu=0.0, law=ciarlet_by_plane_stress, normals="smooth")
    for t, (vertical, horizontal) in KRATOS.items():
        assert_allclose(found[t][0], vertical, rtol=0.02)
        assert_allclose(found[t][1], horizontal, atol=0.02)


@pytest.mark.slow
def test_poulios_renard_drawn_along() -> None:
    """With friction: the vertical force to 2.5, the horizontal one to 5 %."""
    found = ironed(40, 40, law=ciarlet_by_plane_stress, normals="smooth")
    reached, meant = np.array([found[t] for t in POULIOS_RENARD]), np.array(list(POULIOS_RENARD.values()))
    assert_allclose(reached[:, 0], meant[:, 0], rtol=0.025)
    assert_allclose(reached[:, 1], meant[:, 1], rtol=0.05)


@pytest.mark.slow
def test_poulios_renard_drawn_along_on_quadratic_cells() -> None:
    """Poulios and Renard's cells have quadratic displacements, too: the vertical force to 2 %, the horizontal one to 0.021, 2 % of what it
    is while the die slides (the curves are read off a figure of 3.4 in height)."""
    found = ironed(200, 200, law=ciarlet_by_plane_stress, elements="Q2", normals="smooth")
    reached, meant = np.array([found[t] for t in POULIOS_RENARD]), np.array(list(POULIOS_RENARD.values()))
    assert_allclose(reached[:, 0], meant[:, 0], rtol=0.02)
    assert_allclose(reached[:, 1], meant[:, 1], rtol=0, atol=0.021)


@pytest.mark.slow
def test_on_quadratic_cells_long_steps_lose_no_contact() -> None:
    """A third a step, more than three facets between nodes: the forces of full sliding are those of short steps."""
    found = ironed(60, 60, law=ciarlet_by_plane_stress, elements="Q2", normals="smooth")
    for t in (1.5, 1.9, 2.0):
        assert_allclose(found[t], POULIOS_RENARD[t], rtol=0.02, atol=0.021)
