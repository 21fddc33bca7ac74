"""Bodies that driven plates press until all of them flows: the force is yield stress times area, by statics.

Perfectly plastic bodies have no stiffness left at their limit, so that contact alone holds them; stiff ones that contact alone holds need a
regularisation eta that round-off does not hide, which a run that fails names.
"""

import re

import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.errors import FcsimError
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import FinitePlastic, LinearHardening, Material, Plastic
from fcsim.mesh.part import Body
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

YIELD, E, AREA = 2e8, 2e11, 0.04
SIDES = [Support("bar", ("x",), "x-"), Support("bar", ("y",), "y-"), Support("bar", ("z",), "z-")]


def pressed_bar(material: object) -> list[float]:
    """Forces [N] on a rigid wall that is driven 0.5 mm a step against a bar of 1 m on rollers."""
    bar = Body("bar", brick("bar", (1.0, 0.2, 0.2), (4, 2, 2), material))  # type: ignore[arg-type]
    wall = rigid_box("wall", (0.1, 1.0, 1.0), (1.05, 0.1, 0.1), 1.0)
    held = [Support("wall", ("y", "z", "rx", "ry", "rz")), Support("wall", ("x",), velocity=-2e-3)]
    model = build_model([bar, wall], supports=[*SIDES, *held])
    number = model.number["wall"]
    return [float(step.contact_force_on(number)[0]) for step in Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.25), 6)]


def test_a_perfectly_plastic_bar_bears_its_yield_stress() -> None:
    """Elastic to 1 mm, from there sy A, whatever the wall does."""
    assert_allclose(pressed_bar(Plastic(E, 0.3, 7800.0, YIELD)), [E * 5e-4 * AREA] + [YIELD * AREA] * 5, rtol=1e-9)


def test_a_bar_that_hardens_follows_its_modulus() -> None:
    """sy A + E H / (E + H) A (u / l - sy / E)."""
    H = 2e9
    expected = [E * 5e-4 * AREA, *((YIELD + E * H / (E + H) * (5e-4 * n - 1e-3)) * AREA for n in range(2, 7))]
    assert_allclose(pressed_bar(Plastic(E, 0.3, 7800.0, LinearHardening(YIELD, H))), expected, rtol=1e-8)


def test_finite_strain_gains_area_only() -> None:
    """Kirchhoff's stress is sy from where log l = -sy / E on: F = sy A L / l, bulging elastically by 2 nu sy / E."""
    forces = pressed_bar(FinitePlastic(E, 0.3, 7800.0, YIELD))
    expected = [YIELD * AREA / (1 - 5e-4 * n) for n in range(2, 7)]
    assert_allclose(forces[1:], expected, rtol=2e-4)


@pytest.mark.parametrize("material", [Material(E, 0.3, 7800.0), Plastic(E, 0.3, 7800.0, YIELD)], ids=["elastic", "plastic"])
@pytest.mark.parametrize("eta", [1e-7, 1e-2])
def test_the_named_eta_serves(material: Material | Plastic, eta: float) -> None:
    """A steel block between two plates, held by nothing else: with too faint a mass the run names an eta, with which the force is
    E u / l A, at most sy A (no friction: uniaxial stress)."""
    block = Body("bar", brick("bar", (0.2, 0.2, 0.2), (2, 2, 2), material))
    floor, plate = rigid_box("floor", (1.0, 1.0, 0.1), (0.1, 0.1, -0.05), 1.0), rigid_box("plate", (1.0, 1.0, 0.1), (0.1, 0.1, 0.25), 1.0)
    driven = [Support("plate", ("x", "y", "rx", "ry", "rz")), Support("plate", ("z",), velocity=-6e-4)]
    model = build_model([block, floor, plate], supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz")), *driven])

    def forces(eta: float) -> list[float]:
        simulation = Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.25, eta=eta), 3, cuttings=0)
        return [float(step.contact_force_on(model.number["plate"])[2]) for step in simulation]

    with pytest.raises(FcsimError) as told:
        forces(eta)
    text = str(told.value)
    times = re.search(r"a larger eta, about (\S+) times", text)
    named = eta * float(times.group(1)) if times else float(re.search(r"try eta = ([0-9.e+-]+)", text).group(1))  # type: ignore[union-attr]
    bound = YIELD if isinstance(material, Plastic) else float("inf")
    assert_allclose(forces(named), [min(E * 1.5e-4 * n / 0.2, bound) * AREA for n in (1, 2, 3)], rtol=1e-5)
