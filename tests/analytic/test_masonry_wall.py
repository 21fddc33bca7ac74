"""The masonry wall against its references: published contact counts, statics, another program, the friction bound.

References: 544-contact wall (head joints off) computed by LMGC90 with Siconos' Newton at 1e-8 on the same mesh, loads and laws: at the
bottom platen R_x = 6743 / 10 710 / 12 811 N and R_z = 30 451.5 / 30 431.4 / 30 419.9 N at steps 40 / 80 / 120. The whole wall:
horizontal reaction 7.0 / 12.1 / 14.2 / 15.2 / 15.9 kN at steps 40 / 100 / 200 / 300 / 400 of a first model, weight of wall and platen
30 412 N, friction bounds 15.97 kN (0.53, upper bed) and 15.90 kN (the paper's 0.53 at the platens).
"""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.running.case import CaseScript, load_case
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

CASE = Path(__file__).parents[2] / "cases" / "masonry_wall"
H = 1e-3
WALL_WEIGHT = 0.7 * 0.1 * 0.3 * 2000 * 9.81
WEIGHT = WALL_WEIGHT + 30_000


@cache
def script() -> CaseScript:
    return load_case(CASE)


def simulation(**parameters: Any) -> Simulation:
    return script().build(script().parameters(**parameters)).simulation


class Record(NamedTuple):
    """What the checks need of a step, forces in N by statics alone: from H r, M v, f and the support reactions."""

    bottom: np.ndarray
    top: np.ndarray
    change: np.ndarray
    balance: float
    penetration: float
    error: float
    attempts: int
    dissipation: float
    energy: float


class Balance:
    """Momentum of every body from M and v alone, and what changes it from H r, the loads and the support reactions."""

    def __init__(self, model: Any) -> None:
        self.model = model
        self.mass = model.mass
        self.before = np.zeros((len(model.bodies), 3))

    def sums(self, dofs: np.ndarray) -> np.ndarray:
        """Resultants (nbodies, 3) of a vector on all dofs: sums over a block's nodes, the first three dofs of a platen."""
        model = self.model
        own = [dofs[model.dof_offset[k] : model.dof_offset[k + 1]] for k in range(len(model.bodies))]
        return np.array([o.reshape(-1, 3).sum(axis=0) if k < len(model.deformable) else o[:3] for k, o in enumerate(own)])

    def __call__(self, step: Step) -> Record:
        model = self.model
        contact = self.sums(step.H @ step.result.r) / H
        momentum = self.sums(self.mass @ step.state.v)
        change = (momentum - self.before) / H
        self.before = momentum
        external = self.sums(model.load(step.previous.t) + model.load(step.state.t)) / 2  # theta = 1/2
        support = self.sums(np.where(np.isin(np.arange(model.n_dofs), model.driven_dofs), step.support_impulse, 0.0)) / H
        bottom, top = model.number["bottom platen"], model.number["top platen"]
        x = step.state.x
        return Record(
            bottom=-contact[bottom],
            top=-contact[top],
            change=change,
            balance=float(np.abs(change - contact - external - support).max()),
            penetration=step.penetration,
            error=step.result.error,
            attempts=len(step.attempts),
            dissipation=step.friction_dissipation,
            energy=float(x @ model.apply_stiffness(x)),
        )


@cache
def history(steps: int, **parameters: Any) -> list[Record]:
    """Computed once for all tests of a session."""
    run = simulation(steps=steps, **parameters)
    record = Balance(run.model)
    return [record(step) for step in run]


def check_every_step(records: list[Record], steps: int) -> None:
    """What holds at every step of every run, whatever the parameters."""
    assert len(records) == steps
    for record in records:
        assert record.error <= 1e-8
        assert record.penetration <= 1e-9
        assert record.balance <= 1e-6 * max(abs(record.bottom[2]), 1.0)
        assert record.energy >= 0
        assert record.dissipation >= -1e-9
        blocks = record.change[:-2].sum(axis=0)
        scale = max(abs(record.bottom[2]), 1.0)
        # the blocks lie between the platens: what differs between top and bottom is their weight and their change of momentum
        assert abs(record.bottom[0] + record.top[0] - blocks[0]) <= 1e-6 * scale
        assert abs(record.bottom[1] + record.top[1] - blocks[1]) <= 1e-6 * scale


def check_vertical_balance(records: list[Record]) -> None:
    """After the ramp: reaction = weight of wall and platen + change of vertical momentum (the bottom platen is held)."""
    for record in records[19:]:
        assert_allclose(record.bottom[2], WEIGHT + record.change[:, 2].sum(), rtol=1e-6)
        assert_allclose(record.bottom[2] + record.top[2], WALL_WEIGHT + record.change[:-2, 2].sum(), atol=1e-6 * WEIGHT)


def horizontal(records: list[Record], step: int) -> float:
    return abs(records[step - 1].bottom[0])


def test_size_and_contacts_of_the_wall() -> None:
    """12 blocks, 2400 nodes, two platens of 6 dofs kept as rows of the identity; 224 + 144 + 320 contacts."""
    run = simulation(steps=1)
    assert run.model.n_dofs == 7212 and run.model.n_elastic == 7200 and len(run.model.deformable) == 12
    step = next(iter(run))
    assert step.problem.n == 7212
    assert len(step.contacts) == 688
    numbers, counts = np.unique(step.contacts.mu, return_counts=True)
    assert dict(zip(numbers.tolist(), counts.tolist(), strict=True)) == {0.53: 224 + 144, 0.83: 320}
    np.linalg.cholesky(step.reduction.local.W.toarray())  # full rank, 2064: not hyperstatic


@pytest.mark.parametrize(("candidates", "count"), [("faces", 688), ("nodes", 865), ("gauss", 1792)])
def test_contacts_of_the_three_rules(candidates: str, count: int) -> None:
    run = simulation(steps=1, candidates=candidates)
    assert len(run.detector(run.model.reference)) == count


def test_head_joints_off() -> None:
    run = simulation(steps=1, heads=False)
    assert len(run.detector(run.model.reference)) == 544


def test_eliminated_wall_is_the_same_problem() -> None:
    """The seven driven dofs apart."""
    kept, eliminated = simulation(steps=2, driven="identity"), simulation(steps=2, driven="eliminated")
    for one, other in zip(kept, eliminated, strict=True):
        assert (one.problem.n, other.problem.n) == (7212, 7205)
        assert_allclose(one.state.v, other.state.v, atol=1e-10)
        scale = np.abs(one.result.r).max()
        assert_allclose(one.result.r, other.result.r, atol=1e-5 * scale + 1e-12)


def test_first_steps_of_the_wall() -> None:
    """The ramp of gravity, then the shear: every step converges, every body obeys its momentum balance."""
    records = history(42)
    check_every_step(records, 42)
    check_vertical_balance(records)
    assert horizontal(records, 40) == pytest.approx(7.0e3, rel=0.02)
    assert records[0].bottom[2] == pytest.approx(0.0, abs=1e-6)  # no gravity yet
    assert all(record.attempts == 1 for record in records)


def test_against_another_program() -> None:
    """LMGC90 with Siconos' Newton, head joints off."""
    records = history(40, heads=False)
    check_every_step(records, 40)
    assert horizontal(records, 40) == pytest.approx(6743, rel=1e-3)
    assert records[39].bottom[2] == pytest.approx(30_451.5, rel=1e-3)
    # at step 2 the load has just begun: the scheme takes the mean of both ends of the step, LMGC90 (0.20 N) the end
    assert 2 * abs(records[1].bottom[0]) == pytest.approx(0.20, abs=0.006)
    assert abs(records[19].bottom[0]) == pytest.approx(5.59, abs=0.05)


def test_wall_of_rigid_blocks() -> None:
    """Statics at every step; nothing deforms, so that soon after the shear begins the wall slides at the friction bound of the upper
    bed and stays there. Two facets a block face are enough: four Gauss points of each carry."""
    records = history(60, blocks_are="rigid", divisions=(2, 1, 1), candidates="gauss")
    check_every_step(records, 60)
    check_vertical_balance(records)
    assert all(record.attempts == 1 for record in records)
    bound = 0.53 * (30_000 + WALL_WEIGHT / 3)
    horizontals = [abs(record.bottom[0]) for record in records]
    assert max(horizontals) <= bound * (1 + 1e-6)
    assert horizontals[-1] == pytest.approx(bound, rel=1e-6)


def test_wall_of_mixed_blocks() -> None:
    """Every second block is rigid."""
    run = simulation(steps=1, blocks_are="mixed")
    assert (len(run.model.deformable), len(run.model.rigid)) == (6, 6 + 2)
    assert len(run.detector(run.model.reference)) == 688
    records = history(42, blocks_are="mixed", divisions=(2, 1, 1), candidates="gauss")
    check_every_step(records, 42)
    check_vertical_balance(records)
    assert all(record.attempts == 1 for record in records)
    for record in records[19:]:  # no bed can carry more than 0.53 of what stands on it; the wall settles, so that this is not the weight
        assert abs(record.bottom[0]) <= 0.53 * record.bottom[2]


@pytest.mark.slow
def test_whole_run() -> None:
    records = history(500)
    check_every_step(records, 500)
    check_vertical_balance(records)
    for step, expected in ((40, 7.0e3), (100, 12.1e3), (200, 14.2e3), (300, 15.2e3), (400, 15.9e3)):
        assert horizontal(records, step) == pytest.approx(expected, rel=0.02), step
    bound = 0.53 * (30_000 + WALL_WEIGHT / 3)
    assert max(abs(record.bottom[0]) for record in records) < bound * (1 + 1e-4)
    assert horizontal(records, 500) == pytest.approx(15.96e3, rel=2e-3)
    # The platen settles viscously after the ramp; once its acceleration has died out the reaction is the weight alone, but for the few
    # steps in which contacts let go (the balance above is exact in them too).
    vertical = np.array([record.bottom[2] for record in records[260:]])
    assert np.mean(np.abs(vertical - WEIGHT) < 1.0) > 0.95


@pytest.mark.slow
def test_against_another_program_for_longer() -> None:
    records = history(120, heads=False)
    check_every_step(records, 120)
    for step, rx, rz in ((40, 6743, 30_451.5), (80, 10_710, 30_431.4), (120, 12_811, 30_419.9)):
        assert horizontal(records, step) == pytest.approx(rx, rel=1e-3)
        assert records[step - 1].bottom[2] == pytest.approx(rz, rel=1e-3)


@pytest.mark.slow
def test_friction_of_the_paper() -> None:
    """The top platen slides first: 0.53 x 30 000 N."""
    records = history(500, friction="paper")
    check_every_step(records, 500)
    assert max(abs(record.bottom[0]) for record in records) < 0.53 * 30_000 * (1 + 1e-3)
    assert horizontal(records, 500) == pytest.approx(15.90e3, rel=2e-3)
