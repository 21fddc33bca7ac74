"""From where the interior points of `auto` begin, and with which velocities."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fcsim.solvers import solve
from fcsim.solvers.automatic import interior
from fcsim.solvers.base import Iterate, Status
from fcsim.solvers.turns import Turns
from tests.unit.solvers.automatic.states import FACES_HELD, LOOSE, NEAR, Shown, state
from tests.unit.solvers.automatic.test_stages import local

SWEPT = np.full(30, 2.0)
"""The best reactions of sweeps; those of all are one, the start's as well."""
Begun = list[tuple[float, float, int]]


class Sweeps(Shown):
    """Sweeps whose best iterate is known."""

    @property
    def monitor(self) -> Any:
        monitor = super().monitor
        monitor.best_r = SWEPT
        return monitor


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> Begun:
    """Reaction, velocity and paths of each run of interior points, none of which arrives."""
    runs: Begun = []

    def turns(problem: Any, r: np.ndarray, monitor: Any, options: Any, told: Any) -> Turns:
        runs.append((float(r[0]), options.velocity, options.paths))
        return Iterate(r, Status.STAGNATED)
        yield

    monkeypatch.setattr(interior, "interior_point_turns", turns)
    return runs


def followed(race: Any) -> None:
    for _ in interior.interior(race, Shown()) or ():  # type: ignore[arg-type]
        pass


@pytest.mark.usefixtures("what_is_held_is_written_down")
@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"in_velocities": False}, [(2.0, 0.1, 1), (2.0, 0.03, 1), (0.0, 1.0, 6)]),  # 10 and 3 sqrt(1e-4)
        ({"in_velocities": True}, [(0.0, 1.0, 6)]),
        ({"in_velocities": False, "small": True}, [(0.0, 1.0, 6)]),
        ({"in_velocities": False, "holds": FACES_HELD}, [(1.0, 1.0, 3)]),
    ],
)
def test_beds_in_W_begin_from_sweeps(changes: dict[str, Any], expected: Begun, begun: Begun) -> None:
    followed(state(runners={"sweeps": Sweeps(best=NEAR)}, **{"best": 1e-6, "holds": LOOSE, **changes}))
    assert [run[::2] for run in begun] == [run[::2] for run in expected]
    np.testing.assert_allclose([run[1] for run in begun], [run[1] for run in expected], rtol=1e-12)


@pytest.mark.usefixtures("what_is_held_is_written_down")
def test_without_sweeps_from_the_best_iterate_of_all_and_never_with_more_than_from_zero(begun: Begun) -> None:
    followed(state(best=0.04, in_velocities=False))
    assert begun[0] == (1.0, 1.0, 1) and begun[1][:2] == (1.0, pytest.approx(0.6))


@pytest.mark.parametrize("seed", [22001, 22003, 22008])
def test_a_path_from_sweeps_arrives_where_one_from_zero_does_not(seed: int, error_of: Callable[..., float]) -> None:
    p = local("spheres", 300, seed)
    options: dict[str, Any] = {"paths": 1, "weights": interior.INTERIOR_FROM_SWEEPS.weights}
    swept = solve(p, "NNCG", max_iterations=850)
    assert swept.error > 1e-8
    result = solve(p, "IPM-COULOMB", swept.r, velocity=interior.NEAR * np.sqrt(swept.error), **options)
    assert result.solved and error_of(p, result.r) <= 1.01e-8
    assert not solve(p, "IPM-COULOMB", **options).solved
