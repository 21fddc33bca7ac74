"""Paths in W of few contacts, where bodies have too many velocities to eliminate in these: rods with large friction."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fcsim.problem import GlobalProblem
from fcsim.solvers import Status, solve
from fcsim.solvers.automatic import methods, stages
from fcsim.solvers.automatic.race import Race
from fcsim.solvers.base import Iterate
from fcsim.solvers.turns import Turns, to_the_end


def rods_in_points(seed: int, rods: int = 6, contacts: int = 12) -> GlobalProblem:
    """Rods in the plane that touch in single points anywhere along them, friction from 1 to 10 000."""
    rng = np.random.default_rng(seed)
    H = np.zeros((3 * rods, 2 * contacts))
    along = rng.uniform(0, 2 * np.pi, rods)
    for a in range(contacts):
        n = rng.standard_normal(2)
        n /= np.linalg.norm(n)
        frame = np.array([n, [-n[1], n[0]]]).T
        for body, sign in zip(rng.choice(rods, 2, replace=False), (1, -1), strict=True):
            x, y = rng.uniform(-1, 1) * np.array([np.cos(along[body]), np.sin(along[body])])
            H[3 * body : 3 * body + 3, 2 * a : 2 * a + 2] = sign * np.vstack([frame, x * frame[1] - y * frame[0]])
    M = np.diag(np.repeat(10 ** rng.uniform(-1, 1, rods), 3) * np.tile([1, 1, 1 / 3], rods))
    f = M @ rng.standard_normal(3 * rods)
    mu = 10 ** rng.uniform(0, 4, contacts)
    return GlobalProblem(M, H, f, np.zeros(2 * contacts), mu, dimension=2)


OTHERS = tuple(stage.name for stage in stages.STAGES if stage.name not in ("sweeps", "Newton", "proximal Newton", "proof", "paths"))


def test_rods_with_large_friction_are_solved_along_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where proximal Newton does not get on, which on single ones last bits decide, other ones on each kind of processor; the answers by
    Coulomb's law itself."""
    entered: list[bool] = []
    run = stages.run_with_pauses

    def noted(race: Race, *arguments: object) -> object:
        iterate = run(race, *arguments)  # type: ignore[arg-type]
        entered.append("paths" in race.runners)
        return iterate

    monkeypatch.setattr(stages, "run_with_pauses", noted)
    for seed in (17, 39, 55, 82):
        p = rods_in_points(seed)
        found = solve(p, "auto", max_iterations=2500, without=OTHERS)
        assert found.solved, seed
        u, r = found.u.reshape(-1, 2), found.r.reshape(-1, 2)
        size, impulse = np.abs(found.u).max(), np.abs(found.r).max()
        assert u[:, 0].min() >= -1e-6 * size and np.all(np.abs(r[:, 1]) <= p.mu * r[:, 0] + 1e-6 * impulse)
        assert np.abs(r[:, 0] * u[:, 0]).max() <= 1e-6 * impulse * size
        assert np.abs(r[:, 1] * u[:, 1] + p.mu * r[:, 0] * np.abs(u[:, 1])).max() <= 1e-5 * impulse * size
    assert sum(entered) >= 2


@pytest.mark.parametrize(("warm", "ends", "order"), [(True, 9, "aabbaab"), (True, 3, "aabbabb"), (False, 9, "aaaaaaaaa")])
def test_paths_from_a_warm_start_take_turns_with_those_from_zero(
    warm: bool, ends: int, order: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By two pieces each; where one stagnates the other goes on to its end."""
    monitor, done = SimpleNamespace(iterations=0), []

    def run(name: str, most: int, status: Status) -> Turns:
        for _ in range(most):
            monitor.iterations += 1
            done.append(name)
            yield
        return Iterate(np.zeros(1), status)

    monkeypatch.setattr(methods, "ANEW", 2)
    monkeypatch.setattr(methods, "_anew_where_overtaken", lambda *_: run("a", ends, Status.STAGNATED))
    monkeypatch.setattr(methods, "_paths_from_zero", lambda *_: run("b", 3 if ends > 3 else 4, Status.SOLVED))
    race = SimpleNamespace(warm=warm, options=SimpleNamespace(max_iterations=100))
    found = to_the_end(methods.paths(race, monitor))  # type: ignore[arg-type]
    assert "".join(done) == order
    assert found.status is (Status.SOLVED if warm else Status.STAGNATED)
