"""Shallow ironing: a stiff die pressed into a block of rubber and drawn along it (problem B6 of the references of issue 16)."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.mesh.part import Body, Part
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

E = 68.96e7
TIMES = (0.5, 0.8, 1.0, 1.1, 1.5, 1.9, 2.0)
HARTMANN = (0.951, 2.213, 3.195, 3.955, 4.084, 3.793, 3.421)
"""Vertical reactions [1e8 N/m], read from the curves of S. Hartmann et al., as code_aster's test ssnp153 quotes them."""


def die(cells: tuple[int, int]) -> Part:
    """Its foot an arc of radius 0.75 about (0.8, 0.95) from x = 0.2 to 1.4, its top at 1.4."""
    square = rectangle("die", (1.0, 1.0), cells, neo_hooke(10 * E, 0.32, 1.0))
    s, t = square.points.T
    angle = (2 * s - 1) * np.arcsin(0.8)
    foot = np.stack([0.8 + 0.75 * np.sin(angle), 0.95 - 0.75 * np.cos(angle)])
    top = np.stack([0.2 + 1.2 * s, np.full_like(s, 1.4)])
    return Part("die", (foot * (1 - t) + top * t).T, square.cells, square.cell_type, square.surfaces, square.material)


def ironed(steps: int, last: int, block_slave: bool = False, mu: float = 0.3, **rule: Any) -> dict[float, tuple[float, float]]:
    """Vertical and horizontal reactions [1e8 N/m] of the die's top by time: 1 down for t < 1, then 10 along for t < 2."""
    block = rectangle("block", (12.0, 4.0), (60, 15), neo_hooke(E, 0.32, 1.0), origin=(0.0, -4.0))
    supports = [
        Support("block", ("x", "y"), "y-"),
        Support("die", ("y",), "y+", velocity=lambda t: -1.0 if t < 1 else 0.0),
        Support("die", ("x",), "y+", velocity=lambda t: 10.0 if t > 1 else 0.0),
    ]
    model = build_model([Body("block", block), Body("die", die((8, 6)))], supports=supports)
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


@pytest.mark.slow
def test_drawn_along() -> None:
    """The vertical force all along is Hartmann's to 2 %. Published curves of this problem spread by 25 % (at t = 1.5: 3.38 of Poulios and
    Renard to 4.21 of code_aster); what lies 16 % below, in the vertical and in the horizontal alike, is not found with any of four rules
    of contact, two meshes or elements of second order, but to 2 % at t = 1 with nu = 0, so it is another problem's."""
    found = ironed(100, 100, normals="smooth")
    assert_allclose([found[t][0] for t in TIMES], HARTMANN, rtol=0.02)
    ratio = found[1.5][1] / found[1.5][0]
    assert 0.30 < ratio < 0.35  # P&R 0.30, code_aster 0.34: the friction of 0.3 and what the ridge before the die adds
