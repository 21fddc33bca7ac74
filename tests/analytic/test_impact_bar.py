"""The impacting elastic bar against d'Alembert's solution; data of code_aster's SDNV100, and of Doyen, Ern and Piperno (2011).

Contact from gap / v0 for 2 L / c with the pressure rho c v0, kinetic energy to elastic and back, then -v0. A jump of stress runs through a
mesh of second-order elements as a front whose width grows like n^(1/3) elements over n: (element / L)^(2/3) of the bar's length in all.
"""

import sys
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.running.case import load_case

SCRIPT = load_case(Path(__file__).parents[2] / "cases" / "impact_bar")
MODULE = sys.modules[SCRIPT.build.__module__]


class Impact(NamedTuple):
    exact: Any
    h: float
    t: np.ndarray
    force: np.ndarray  # over rho c v0 A
    velocity: np.ndarray  # over v0, towards the wall
    kinetic: np.ndarray  # over the energy before, as all energies
    elastic: np.ndarray
    friction: np.ndarray


@cache
def impact(**changes: Any) -> Impact:
    p = SCRIPT.parameters(**{"elements": 40, **changes})
    case, exact = SCRIPT.build(p), MODULE.ExactSolution(p)
    steps = list(case.simulation)
    sensors = {sensor.column: np.array([sensor.measure(step) for step in steps]) for sensor in case.sensors}
    E = exact.impact_energy
    return Impact(
        exact,
        case.simulation.scheme.h,
        np.array([step.state.t for step in steps]),
        sensors["force"] / exact.force_in_contact,
        sensors["velocity"] / p.speed,
        np.array([step.energy.kinetic for step in steps]) / E,
        np.array([step.energy.elastic for step in steps]) / E,
        np.array([step.energy.friction_dissipation for step in steps]) / E,
    )


DOYEN = {"E": 900.0, "nu": 0.0, "density": 1.0, "length": 10.0, "side": 1.0, "gap": 5.0, "speed": 10.0}
SCHEMES = [
    {"scheme": "theta", "law": "gap"},
    {"scheme": "theta", "law": "velocity"},
    {"scheme": "generalised-alpha", "rho": 0.5, "law": "gap"},
    {"scheme": "generalised-alpha", "rho": 0.8, "law": "velocity"},
]
LONGER = pytest.param(DOYEN, SCHEMES[2], marks=pytest.mark.slow)


def test_numbers_of_the_two_sources() -> None:
    """Published: 5801.2 m/s, 20 us, 68.95 us; and c = 30, p = 300 on the area 1, contact from 0.5 to 1.1667."""
    steel = MODULE.ExactSolution(SCRIPT.parameters())
    assert_allclose([steel.wave_speed, steel.start, steel.end - steel.start], [5801.2, 20e-6, 68.95e-6], rtol=1e-4)
    assert_allclose(steel.force_in_contact, 8000 * 5801.2 * 100 * 0.02**2, rtol=1e-4)
    soft = MODULE.ExactSolution(SCRIPT.parameters(**DOYEN))
    assert_allclose([soft.wave_speed, soft.force_in_contact, soft.start, soft.end], [30, 300, 0.5, 1.1667], rtol=1e-4)


@pytest.mark.parametrize(("data", "change"), [*(({}, change) for change in SCHEMES), (DOYEN, SCHEMES[0]), LONGER])
def test_contact_force_and_its_time(data: dict[str, float], change: dict[str, Any]) -> None:
    """Begins within two steps, ends within the front's width, and is rho c v0 A in between."""
    got = impact(**data, **change)
    exact, crossing = got.exact, 2 * got.h  # the wave's time through an element
    closed = got.t[got.force > 0.02]
    assert_allclose(closed[0], exact.start, atol=2 * got.h)
    assert_allclose(closed[-1], exact.end, atol=2 * crossing)
    duration = exact.end - exact.start
    during = got.force[(got.t > exact.start + 0.1 * duration) & (got.t < exact.end - 0.1 * duration)]
    assert_allclose(during.mean(), 1, atol=2e-3)
    assert during.std() < 0.01
    assert np.count_nonzero(np.diff((got.force > 0.02).astype(int)) == 1) == 1  # once, and it does not come again
    assert_allclose(got.force.sum() * got.h / duration, (1 - got.velocity[-1]) / 2, rtol=1e-9)  # impulse = change of momentum


@pytest.mark.parametrize(("data", "change"), [*(({}, change) for change in SCHEMES), (DOYEN, SCHEMES[0]), LONGER])
def test_energies(data: dict[str, float], change: dict[str, Any]) -> None:
    """Kinetic to elastic and back, but for the mass of the nodes that meet the wall, half an element, and the front's vibrations."""
    got = impact(**data, **change)
    middle = np.argmin(np.abs(got.t - 0.5 * (got.exact.start + got.exact.end)))
    assert got.kinetic[middle] < 0.03 and got.elastic[middle] > 0.95
    front = (1 / 40) ** (2 / 3)
    assert_allclose(got.elastic, got.exact.elastic_energy(got.t) / got.exact.impact_energy, atol=0.5 * front)
    assert np.abs(got.friction).max() == 0


def test_the_speed_at_the_end_converges_like_the_front() -> None:
    counts = np.array([10, 20, 40])
    missing = np.array([1 + impact(elements=int(n)).velocity[-1] for n in counts])
    assert np.all(missing > 0) and missing[-1] < 0.04
    slopes = np.diff(np.log(missing)) / np.diff(np.log(1 / counts))
    assert_allclose(slopes, 2 / 3, atol=0.1)


def total(got: Impact) -> np.ndarray:
    """Energy after each step, over that before the impact, with which it begins."""
    return np.concatenate([[1.0], got.kinetic + got.elastic])


@pytest.mark.each_value
@pytest.mark.parametrize("courant", [0.5, 1.0])
@pytest.mark.parametrize("lumped", [True, False])
def test_restitution_one_keeps_the_energy(courant: float, lumped: bool) -> None:
    """Asked for: 1 %. The scheme's identity says exactly, for theta = 1/2 without damping."""
    energy = total(impact(scheme="theta", law="velocity", restitution=1.0, elements=20, courant=courant, lumped=lumped))
    assert_allclose(energy, 1, rtol=1e-9)


@pytest.mark.each_value
@pytest.mark.parametrize("restitution", [0.0, 0.4, 0.6])
@pytest.mark.parametrize("theta", [0.5, 0.6])
def test_energy_never_grows(theta: float, restitution: float) -> None:
    """For 1/2 <= theta <= 1/(1+e), with impacts that come again and again where e > 0."""
    assert theta <= 1 / (1 + restitution)
    energy = total(impact(elements=20, scheme="theta", theta=theta, law="velocity", restitution=restitution))
    assert np.diff(energy).max() < 1e-10
    assert energy[-1] < 0.995


@pytest.mark.parametrize("theta", [0.5, pytest.param(0.7, marks=pytest.mark.slow), 1.0])
def test_energy_never_grows_with_the_gap_law(theta: float) -> None:
    energy = total(impact(elements=20, scheme="theta", theta=theta, law="gap"))
    assert np.diff(energy).max() < 1e-10


@pytest.mark.parametrize("change", [{"speed": 0.0}, {"speed": -1.0}, {"courant": 0.0}, {"gap": -1e-3}])
def test_a_bar_that_does_not_come_is_refused(change: dict[str, float]) -> None:
    """It was run, and ended by a division by zero in a sensor."""
    with pytest.raises(InputError, match=r"expected speed > 0, courant > 0 and gap >= 0, got"):
        SCRIPT.build(SCRIPT.parameters(**change))
