"""An interior point that goes first, from zero, where faces of many bodies hold one another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from fcsim.solvers import solve
from fcsim.solvers.automatic import later, stages
from fcsim.solvers.automatic.race import Race, ShareOfMonitor, Stage
from fcsim.solvers.turns import Turns
from tests.unit.solvers.automatic.states import AFAR, EDGES_HELD, ENDED, FACES_HELD, LOOSE, NEAR, Shown, newton, state
from tests.unit.solvers.automatic.test_stages import local

DEAR = Shown(iterations=100, spent=100.0, needed=1e6)
"""Sweeps that need more than any other method."""


@pytest.mark.usefixtures("what_is_held_is_written_down")
@pytest.mark.parametrize(
    ("changes", "runners", "leads"),
    [
        ({}, {}, True),
        ({"newton_price": 10.6}, {}, False),  # 15 for an iteration of an interior point
        ({"holds": LOOSE}, {}, False),
        ({"holds": EDGES_HELD, "dimension": 2}, {}, False),
        ({"points": 2.9}, {}, False),
        ({"best": 1e-4}, {}, False),
        ({"best": 1.1e-4}, {}, True),
        ({"warm": True}, {}, False),
        ({"joints": object()}, {}, False),
        ({"in_velocities": False}, {}, False),
        ({"without": ("interior point first",)}, {}, False),
        ({}, {"proximal Newton": newton()}, False),
        ({"best": NEAR}, {"interior point first": Shown(paths=[[1.0]])}, True),  # under way
        ({}, {"interior point first": Shown(result=ENDED)}, False),
    ],
)
def test_it_goes_first_in_faces_where_it_costs_little_more_than_proximal_newton(
    changes: dict[str, Any], runners: dict[str, Shown], leads: bool
) -> None:
    race = state(runners={"sweeps": DEAR, **runners}, **{"best": AFAR, "holds": FACES_HELD, "newton_price": 10.8, **changes})
    assert later.interior_leads(race) is leads
    if not race.joints and not race.warm and "proximal Newton" not in runners:
        enters = {stage.name: stage.enters for stage in stages.STAGES}
        assert enters["interior point first"](race) is leads
        assert not (leads and enters["proximal Newton"](race))


@pytest.mark.usefixtures("what_is_held_is_written_down")
def test_it_waits_like_proximal_newton_as_long_as_sweeps_cost_less() -> None:
    soon = Shown(iterations=100, spent=100.0, needed=1.0)
    enters = {stage.name: stage.enters for stage in stages.STAGES}["interior point first"]
    assert not enters(state(runners={"sweeps": soon}, best=AFAR, holds=FACES_HELD, newton_price=10.8))


@pytest.mark.parametrize(
    ("paths", "best", "left"),
    [([[1.0] * 19], 1.1e-4, False), ([[1.0] * 19], 1e-4, True), ([[1.0] * 20], 1.1e-4, True), ([[1.0, 0.1], []], 1.1e-4, True)],
)
def test_it_is_left_off_its_path_and_below_the_error_from_which_proximal_newton_is_the_quicker(
    paths: list[list[float]], best: float, left: bool
) -> None:
    leaves = {stage.name: stage.left for stage in stages.STAGES}["interior point first"]
    assert leaves(state(), Shown(paths=paths, best=best)) is left  # type: ignore[arg-type]


@pytest.fixture
def entered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The stages in the order in which they begin."""
    names: list[str] = []

    def noted(stage: Stage) -> Stage:
        def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
            names.append(stage.name)
            return stage.turns(race, monitor)

        return replace(stage, turns=turns)

    monkeypatch.setattr(stages, "STAGES", tuple(noted(stage) for stage in stages.STAGES))
    return names


@pytest.mark.parametrize(
    ("seed", "names", "most"),
    [
        (15, ["sweeps", "interior point first"], 100),  # 1357 iterations of six methods where proximal Newton goes first
        (1, ["sweeps", "interior point first", "proximal Newton"], 150),  # whose first path does not arrive: the others follow
    ],
)
def test_layers_of_boxes(seed: int, names: list[str], most: int, entered: list[str], error_of: Callable[..., float]) -> None:
    p = local("boxes", 2000, seed)
    result = solve(p, "auto", tol=1e-4)
    assert result.solved and entered[: len(names)] == names and result.iterations < most
    assert (seed == 15) == (len(entered) == len(names))
    assert error_of(p, result.r) <= 1.01e-4
