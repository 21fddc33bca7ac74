"""Bobs on cables at theta = 1/2 and 1: free swings against uniform motion on a circle and the elliptic period."""

import numpy as np
import pytest
from scipy.special import ellipk

import fcsim
from fcsim.linkage import Cable, Linkage, WithCables
from fcsim.mesh import Body, Material, brick, rigid_box
from fcsim.timestep.creation import EnergyCreated

LENGTH, SPEED = 0.5, 2.0


def swing(
    theta: float,
    steps: int,
    *,
    h: float = 0.01,
    g: float = 9.81,
    unit: float = 1.0,
    soft: bool = False,
    beside: float = 0.0,
    **options: float,
) -> list[fcsim.Step]:
    """A bob of 1 kg that hangs by 0.5 m, on one cable or on two to (+-beside), and is struck by 2 m/s along x."""
    a, low = 0.04 * unit, (0.0, 0.0, -LENGTH * unit)
    if soft:
        part = brick("bob", (a, a, a), (1, 1, 1), Material(1e7 / unit, 0.3, 1 / a**3), origin=(-a / 2, -a / 2, low[2] - a / 2))
        bob: object = Body("bob", part)
    else:
        bob = rigid_box("bob", (a, a, a), low, 1.0)
    model = fcsim.build_model([bob], gravity=lambda t: (0.0, 0.0, -g * unit))
    along = np.zeros(model.n_dofs)
    if soft:
        along[0::3] = SPEED * unit
    else:
        along[0] = SPEED * unit
    sides = (-beside, beside) if beside else (0.0,)
    cables = [Cable(f"cable {k}", "bob", None, (low, (0.0, y * unit, 0.0))) for k, y in enumerate(sides)]
    linkage = Linkage(model, cables)
    detection = WithCables(fcsim.Everything(model, mu=0.3), linkage)
    state = fcsim.State(0.0, np.zeros(model.n_dofs), along)
    return list(fcsim.Simulation(model, detection, fcsim.Theta(h, theta=theta), steps, linkage=linkage, initial=state, **options))


def energy(steps: list[fcsim.Step]) -> np.ndarray:
    """Kinetic, elastic and of gravity, relative to that of the blow."""
    before = steps[0].energy.at_beginning
    work = np.cumsum([step.energy.load_work for step in steps])
    return (np.array([step.energy.kinetic + step.energy.elastic for step in steps]) - work) / before


@pytest.mark.parametrize(("theta", "unit", "soft"), [(0.5, 1.0, False), (1.0, 1.0, False), (1.0, 1e3, False), (1.0, 1.0, True)])
def test_a_bob_that_goes_round_without_gravity_keeps_its_energy(theta: float, unit: float, soft: bool) -> None:
    """At theta = 1 velocities lie along chords; each step turned them by work of the cable that theta took at once, (omega h)^2 of the
    energy, which added up to 5 % after 32 steps and ended the run. Energy is 1 + (omega h / 2)^2 of the chords, created is no more."""
    steps = swing(theta, 50, g=0.0, unit=unit, soft=soft)
    order = (SPEED / LENGTH * 0.01) ** 2
    assert len(steps) == 50
    assert np.abs(energy(steps) - 1).max() < order
    assert steps[-1].ledger.created < order * steps[-1].ledger.supplied


@pytest.mark.parametrize(("theta", "beside"), [(0.5, 0.0), pytest.param(1.0, 0.0, marks=pytest.mark.slow), (1.0, 0.3)])
def test_a_bob_swings_with_the_elliptic_period(theta: float, beside: float) -> None:
    """Half a period is 2 sqrt(L / g) K(sin^2(phi / 2)), v^2 = 2 g L (1 - cos phi); two cables swing about the line of their ends."""
    h = 0.01
    steps = swing(theta, 80, h=h, beside=beside)
    x = np.array([step.state.x[0] for step in steps])
    k = int(np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))[0])
    half = h * (k + 1 + x[k] / (x[k] - x[k + 1]))
    sine = SPEED**2 / (4 * 9.81 * LENGTH)  # of phi / 2, squared
    assert half == pytest.approx(2 * np.sqrt(LENGTH / 9.81) * ellipk(sine), rel=1e-3)
    assert np.abs(energy(steps) - 1).max() < (0.05 if theta == 1 else 0.002)  # of first order, and it swings
    assert energy(steps)[k] == pytest.approx(1, abs=0.002)


def test_what_ends_a_run_names_the_cable() -> None:
    """It said that 's' was in 's': a cable to the ground has one body."""
    with pytest.raises(EnergyCreated, match="cable 'cable 0', longer than it is by"):
        swing(0.5, 5, h=0.05, g=0.0, created=1e-6)
