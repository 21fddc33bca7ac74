"""Bodies on a base that follows an acceleration record: Newmark's sliding block, and the wall of cases/wall_earthquake.

N. M. Newmark, "Effects of earthquakes on dams and embankments", Géotechnique 15, 1965: a block on a base with the acceleration a(t) sticks
while |a| <= mu g; it slides with the acceleration mu g sign(base's velocity - its own) until the velocities are equal.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.assembly.time_functions import AccelerationRecord, read_acceleration_record
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rigid_box
from fcsim.running.case import load_case
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

G = 9.81
CASE = Path(__file__).parents[2] / "cases" / "wall_earthquake"
SCRIPT = load_case(CASE)


def sliding_block(record: AccelerationRecord, mu: float, end: float, n: int = 20_000) -> np.ndarray:
    """Slip (n,) [m] of Newmark's block relative to the base, by small explicit steps of its two states, stick and slip."""
    h = end / n
    slip, rate = np.zeros(n), 0.0
    for k in range(1, n):
        a = record((k - 0.5) * h)
        if rate == 0 and abs(a) <= mu * G:
            slip[k] = slip[k - 1]
            continue
        direction = np.sign(rate) if rate else -np.sign(a)
        new = rate + h * (-a - mu * G * direction)
        new = 0.0 if rate and new * rate < 0 else new
        slip[k] = slip[k - 1] + 0.5 * h * (rate + new)
        rate = new
    return slip


@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_sliding_block(mu: float) -> None:
    """Slip at all times to the distance that the base's largest speed makes in a step."""
    record = read_acceleration_record(CASE / "ricker.csv")
    h, end = 4e-3, 0.8
    block, base = rigid_box("block", (0.4, 0.4, 0.02), (0, 0, 0.01), 5.0), rigid_box("base", (5, 5, 1), (0, 0, -0.5), 1.0)
    supports = [Support("base", ("y", "z", "rx", "ry", "rz")), Support("base", ("x",), velocity=record.velocity)]
    model = build_model([block, base], supports=supports, gravity=lambda t: (0, 0, -G))
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("base", "z+")]), mu, 1e-2)
    steps = list(Simulation(model, Detector([pair], model.n_nodes), Theta(h), round(end / h), SolverSettings(name="auto", floor=1e-5)))
    slip = np.array([step.state.x[0] - step.state.x[6] for step in steps])
    exact = sliding_block(record, mu, end)[np.minimum(np.arange(1, len(slip) + 1) * 20_000 // len(slip), 19_999)]
    speed = max(abs(record.velocity(t)) for t in record.times)
    assert np.abs(exact).max() > 3 * speed * h
    assert_allclose(slip, exact, atol=speed * h)
    shear = np.array([step.contact_force_on(0)[0] for step in steps])
    assert np.abs(shear).max() <= mu * 5.0 * G * (1 + 1e-6)
    assert_allclose([step.state.x[6] for step in steps], [record.displacement(step.state.t) for step in steps], atol=speed * h / 10)
    work = sum(step.energy.support_work - step.energy.tangential_dissipation for step in steps)
    assert_allclose(work, steps[-1].energy.kinetic, atol=1e-6)
    largest = max(step.energy.kinetic for step in steps)
    assert min(step.energy.friction_dissipation for step in steps) >= -1e-9 * largest


def shaken(steps: int, **changes: Any) -> tuple[Any, list[Step], dict[str, np.ndarray], np.ndarray]:
    p = SCRIPT.parameters(courses=3, blocks=1.5, load_steps=2, steps=steps, **changes)
    case = SCRIPT.build(p)
    done = list(case.simulation)
    return case, done, {s.column: np.array([s.measure(step) for step in done]) for s in case.sensors}, np.array([s.state.t for s in done])


MASS = 2000.0 * 0.3 * 0.1 * 0.3


def test_the_wall_begins_at_rest() -> None:
    """Statics first: without shaking nothing moves, the base carries the weight from the first step on.

    The regularisation of the statics takes 1e-5 of the weight at its end, about which the wall then swings.
    """
    _, steps, sensors, _ = shaken(20, scale=0.0)
    assert_allclose(sensors["base_Rz"], -MASS * G, rtol=1e-4)
    assert max(np.abs(step.state.v).max() for step in steps) < 1e-5


def test_weak_shaking_moves_the_wall_as_a_whole() -> None:
    """Below 0.53 g nothing slides: the force on the base is mass times acceleration, to the elastic waves of the blocks."""
    case, steps, sensors, t = shaken(100, h=4e-3, scale=0.3)
    record = read_acceleration_record(CASE / "ricker.csv").scaled(0.3)
    # the step's mean force is mass times mean acceleration
    expected = -MASS * np.array([(record.velocity(s) - record.velocity(s - 4e-3)) / 4e-3 for s in t])
    assert_allclose(sensors["base_shear"], expected, atol=0.02 * np.abs(expected).max())
    assert np.abs(sensors["top_u"] - sensors["base_u"]).max() < 1e-4
    assert max(np.abs(sensors[name]).max() for name in ("bottom_joint", "top_joint")) < 2e-5
    assert case.simulation.model.n_dofs > 100 and all(step.result.solved for step in steps)


@pytest.mark.slow
def test_strong_shaking_obeys_coulomb_and_the_balances() -> None:
    """Shear on the base never above friction times its normal force, momentum and energy in balance, rest at the end."""
    case, steps, sensors, _ = shaken(350, h=2e-3)
    model = case.simulation.model
    base = model.number["base"]
    assert np.all(np.abs(sensors["base_shear"]) <= 0.83 * -sensors["base_Rz"] + 1e-3)
    for step in steps[::20]:
        momentum = (model.apply_mass(step.state.v - step.previous.v)[: model.n_elastic]).reshape(-1, 3).sum(axis=0)
        force = -step.contact_force_on(base) + [0, 0, -MASS * G]
        assert_allclose(momentum / 2e-3, force, atol=1e-6 * MASS * G)
    given = sum(step.energy.support_work + step.energy.load_work for step in steps)
    scale = sum(abs(step.energy.support_work) for step in steps)
    lost = sum(step.energy.tangential_dissipation + step.energy.normal_dissipation + step.energy.damping_dissipation for step in steps)
    start = steps[0].previous
    before = 0.5 * start.x @ model.apply_stiffness(start.x)
    assert_allclose(given - lost, steps[-1].energy.kinetic + steps[-1].energy.elastic - before, atol=1e-9 * scale)
    assert min(step.energy.friction_dissipation for step in steps) >= -1e-9 * scale
    assert sum(step.energy.tangential_dissipation for step in steps) > 0.1 * given
    assert steps[-1].energy.kinetic < 1e-3 * max(step.energy.kinetic for step in steps)
    assert np.abs(sensors["top_u"][-1]) > 1e-3
    assert 1e-5 < sensors["top_joint"].max() < 1e-3  # courses slide as one


def test_a_record_is_found_from_where_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was looked for beside the script alone; a wall of one course was refused."""
    (tmp_path / "mine.csv").write_text("t [s],a [g]\n0,0\n0.1,0.3\n0.2,0\n")
    monkeypatch.chdir(tmp_path)
    small = {"courses": 1, "blocks": 2.0, "divisions": (2, 1, 1), "steps": 1, "load_steps": 1}
    case = SCRIPT.build(SCRIPT.parameters(record="mine.csv", scale=1.0, **small))
    *_, last = case.simulation
    assert case.sensors[0].measure(last) == pytest.approx(0.3 * 9.80665 * last.state.t / 0.1)
