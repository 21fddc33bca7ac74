"""Three barrels wedged exactly between rigid walls: statics leaves the squeeze of the lower two open, and no step changes it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Gap, Simulation, SolverSettings, Support, Theta, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.contact_detection import ExactContacts
from fcsim.mesh import rigid_plane, rigid_sphere

SI, TONNE_MM, KILOMETRE = (1.0, 1.0), (1e3, 1e-3), (1e-3, 1.0)
"""Metre and kilogram; millimetre and tonne; kilometre and kilogram: (units of length in a metre, units of mass in a kilogram)."""


@pytest.mark.each_value
@pytest.mark.parametrize(("length", "mass"), [SI, TONNE_MM, KILOMETRE], ids=["m, kg", "mm, t", "km, kg"])
@pytest.mark.parametrize("h", [5e-3, 2e-2])
@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0])
def test_what_statics_leaves_open_stays_as_it_began(mu: float, h: float, length: float, mass: float) -> None:
    """Two barrels on a floor, the third of weight P on top of both. Without friction its two forces have the horizontal part
    P / (2 sqrt 3), so that a wall bears that and the squeeze s >= 0 between the lower two, of any size; the floor bears 3 P.

    A Newton step from the last answer, whose error is that of the solver, took s from 0 to 1.2 P, or 9 P, since round-off alone says how
    far it goes along the null space of W; by 0.01 P where it was a little short of the length at which that is told (0.0, 5e-3, km).
    """
    r, high = 0.5 * length, np.sqrt(3) * 0.5 * length
    places = {"left barrel": (r, r), "right barrel": (3 * r, r), "upper barrel": (2 * r, r + high)}
    barrels = [rigid_sphere(name, r, place, 10.0 * mass) for name, place in places.items()]
    planes = {"floor": ((0, 0), (0, 1)), "left": ((0, 0), (1, 0)), "right": ((4 * r, 0), (-1, 0))}
    sides = [rigid_plane(name, at, normal) for name, (at, normal) in planes.items()]
    model = build_model(
        [*barrels, *sides], supports=[Support(name, DIRECTIONS[2]) for name in planes], gravity=lambda t: np.array([0, -9.81 * length])
    )
    solver = SolverSettings(name="auto", tol=1e-8)
    steps = list(Simulation(model, ExactContacts(model, mu), Theta(h, 0.5, Gap()), 40, solver))
    weight = 9.81 * length * 10.0 * mass
    on = {name: np.array([step.contact_force_on(model.number[name]) for step in steps]) / weight for name in planes}
    assert_allclose(sum(forces[:, 1] for forces in on.values()), -3, rtol=1e-6)
    assert_allclose(on["left"] + on["right"] + on["floor"], [[0, -3]] * 40, atol=1e-6)
    assert np.ptp(on["left"], axis=0).max() < 1e-4
    assert np.abs(on["left"]).max() < 0.5
    if mu == 0:
        assert on["left"][:, 0].max() < -1 / (2 * np.sqrt(3)) + 1e-6
        assert_allclose(on["floor"][:, 1], -3, rtol=1e-6)
