"""Beds of few grains: told by W's rows, where the compiled front door leaves them early and an interior point comes next."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim.bench.families import problems
from fcsim.linear._block_rows_kernels import block_rows_of_dense, row_patterns
from fcsim.problem.reduction import reduced
from fcsim.solvers import solve
from fcsim.solvers.automatic import closed, methods
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.race import Race, Runner, Stage
from fcsim.solvers.automatic.stages import AutomaticOptions
from fcsim.solvers.base import Monitor
from fcsim.solvers.memory import Memory
from fcsim.solvers.small import door

BEDS, BLOCKS = (
    ("spheres", "disks", "rocks", "frictions", "mass-ratios"),
    ("walls", "boxes", "towers", "walls-2D", "arches", "near-singular"),
)


def race_of(family: str, size: int, *, warm: bool = False, memory: Memory | None = None) -> Race:
    """A race on the problem of that family, before any method has begun."""
    p = reduced(problems(family, size, 10_005)).local
    monitor = Monitor(p.q, p.mu, p.dimension, 1e-8, compliance=p.compliance, memory=memory)
    return Race(p, p, monitor, AutomaticOptions(), Prices.of(p, p.delassus, None), warm, None, np.zeros(p.m))


@pytest.mark.parametrize(("family", "grains"), [*((family, True) for family in BEDS), *((family, False) for family in BLOCKS)])
@pytest.mark.parametrize("size", [30, 100])
def test_grains_are_told_from_blocks(family: str, grains: bool, size: int) -> None:
    assert closed.in_small_bed(race_of(family, size)) is grains


def test_a_small_bed_begins_at_zero_and_has_few_contacts() -> None:
    assert not closed.in_small_bed(race_of("rocks", 100, warm=True))
    assert not closed.in_small_bed(race_of("rocks", 160))


def test_a_step_of_elastic_bodies_is_no_bed() -> None:
    """A dense W without bodies' velocities behind it, and a memory."""
    assert closed.in_small_bed(race_of("spheres", 60))
    assert not closed.in_small_bed(race_of("spheres", 60, memory=Memory(np.arange(reduced(problems("spheres", 60, 10_005)).local.nc))))


def test_contacts_of_the_same_bodies_have_rows_of_one_pattern() -> None:
    """Two bodies on the ground that touch in two points: three pairs of six contacts; and a body apart from them in one."""
    bodies = [(0,), (0,), (1,), (1,), (0, 1), (0, 1), (2,)]
    coupled = np.array([[bool(set(one) & set(other)) for other in bodies] for one in bodies], dtype=float)
    starts, columns, _ = block_rows_of_dense(np.kron(coupled, np.ones((2, 2))), 2)
    assert row_patterns(starts, columns) == 4


def test_the_front_door_leaves_a_bed_for_an_interior_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of this bed IPM-COULOMB makes 16 iterations by itself, while proximal Newton and sweeps take hundreds and thousands."""
    begun, calls, begin, kernel = [], [], Runner.__init__, door._automatic_kernels.solve_automatically

    def noted(runner: Runner, stage: Stage, race: Race) -> None:
        begun.append(stage.name)
        begin(runner, stage, race)

    def called(*arguments: Any) -> Any:
        calls.append(kernel(*arguments))
        return calls[-1]

    monkeypatch.setattr(Runner, "__init__", noted)
    monkeypatch.setattr(door._automatic_kernels, "solve_automatically", called)
    found = solve(problems("frictions", 100, 10_001), tol=1e-6)
    assert found.solved and found.error <= 1e-6
    assert begun == ["interior point"]
    assert calls[0][1] < 2500  # sweeps and Newton's iterations: with two Newtons and the sweeps between and after them 4157


@pytest.mark.parametrize(("family", "seed", "after"), [("spheres", 13_006, False), ("mass-ratios", 13_005, True)])
def test_the_front_door_sweeps_after_newton_where_masses_are_unlike(
    family: str, seed: int, after: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Told by its history: sweeps are looked at after 25 each, Newton once."""
    kernel, rows = door._automatic_kernels.solve_automatically, []

    def called(*arguments: Any) -> Any:
        out = kernel(*arguments)
        rows.append(arguments[-1][: out[2], 0].copy())
        return out

    monkeypatch.setattr(door._automatic_kernels, "solve_automatically", called)
    assert solve(problems(family, 100, seed), tol=1e-8).solved
    steps = np.diff(rows[0])
    assert np.any(steps[-2:] % 25) is np.bool_(not after)


def test_no_proof_is_looked_for_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bed that the front door leaves above 1e-3, where it has found no proof that there is no solution."""
    looked: list[str] = []

    def noted(name: str) -> Any:
        return lambda problem: looked.append(name)

    for place in (door, methods):
        monkeypatch.setattr(place, "certificate", noted(place.__name__.rpartition(".")[2]))
    assert solve(problems("noise", 100, 13_010), tol=1e-8).solved
    assert looked == ["door"]
