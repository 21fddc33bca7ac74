"""Bodies far from the origin: digits of coordinates that count beside what contact deforms are named."""

import numpy as np
import pytest

from fcsim import (
    Body,
    Cohesive,
    Detector,
    Everything,
    Material,
    QuasiStatic,
    Simulation,
    Support,
    SurfacePair,
    Traction,
    build_model,
    contact_surface,
)
from fcsim.mesh import rectangle

STEEL = Material(E=210e9, nu=0.3, density=7800.0)


@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize(("off", "pressure", "named"), [(0.0, 1e6, False), (1e3, 1e6, False), (1e6, 1e6, True), (1e6, 1e9, False)])
def test_a_digit_that_counts_is_named(off: float, pressure: float, named: bool, unit: float) -> None:
    """A digit at 1e6 is 1.2e-10; steel of 2 cm under 1 MPa gives by 1e-7 m, under 1 GPa by 1e-4 m. At 1e3 a digit is 1.1e-13."""
    steel = Material(E=STEEL.E / unit, nu=STEEL.nu, density=STEEL.density / unit**3)
    at, size = np.full(2, off * unit), 0.01 * unit
    bodies = [
        Body("above", rectangle("above", (size, size), (4, 4), steel), translation=at + np.array([0.0, size])),
        Body("below", rectangle("below", (size, size), (4, 4), steel), translation=at),
    ]
    held = [Support("below", ("x", "y"), "y-"), Support("above", ("x",), "y+")]
    model = build_model(bodies, supports=held, loads=[Traction("above", "y+", (0.0, -pressure / unit))])
    (step,) = Simulation(model, Everything(model, 0.0), QuasiStatic(1.0, eta=1e5), 1)
    assert any("digits" in said for said in step.remarks) == named


@pytest.mark.parametrize("p", [100.0, -100.0])
def test_a_joint_that_bends_presses_and_draws(p: float) -> None:
    """Forces of a pure couple cancel: their sum is round-off of either sign, beside which every deformation is large, or negative."""
    soft = Material(E=1e7, nu=0.0, density=2000.0)
    bodies = [
        Body(name, rectangle(name, (1.0, 1.0), (2, 4), soft), translation=(1e6, 1e6 + y)) for name, y in (("below", 0.0), ("above", 1.0))
    ]
    couple = [Traction("above", "x+", (0.0, p)), Traction("above", "x-", (0.0, -p))]
    model = build_model(bodies, supports=[Support("below", ("x", "y"), "y-")], loads=couple)
    pair = SurfacePair(contact_surface(model, [("above", "y-")]), contact_surface(model, [("below", "y+")]), 0.3, 0.02, "nodes")
    scheme = QuasiStatic(1.0, law=Cohesive(tension=1e6, mode_1=1e3, mode_2=1e3), eta=1.0)
    (step,) = Simulation(model, Detector([pair], model.n_nodes), scheme, 1)
    force = step.contact_force[:, 0]
    assert force.max() > 99.0 and force.min() < -99.0  # p 1 m^2 in all, on an arm of 1 m
    assert not any("digits" in said or "between its points" in said for said in step.remarks)
