"""The steps of a wall of deformable bricks go by products with W: its entries are summed for its factor, not at every step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fcsim.arrays import FloatArray
from fcsim.linear import joints
from fcsim.linear.elimination_tree import EliminationTree
from fcsim.linear.late.late_rows import source_of
from fcsim.problem.bodies.late import LateSum
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers.base import Status
from fcsim.timestep.chain import SolverSettings

WALL = Path(__file__).resolve().parents[3] / "cases" / "masonry_wall"


def test_entries_are_summed_for_a_factor_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first loaded step factors W, the next ones go on with that factor."""
    sums: list[int] = []
    entries, number = LateSum.entries, 1

    def counted(shares: LateSum) -> FloatArray:
        sums.append(number)
        return entries(shares)

    monkeypatch.setattr(LateSum, "entries", counted)
    script = load_case(WALL)
    case = script.build(parse_parameters(script, {"steps": "8"}))
    for step in case.simulation:
        assert step.result.status is Status.SOLVED
        number = step.number + 1
    assert sums == [2]


def test_two_levels_take_joints_from_the_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where GMRES solves Newton's systems no entry of W is summed, from zero neither."""

    def read(shares: LateSum) -> FloatArray:
        raise AssertionError("entries of W are summed")

    monkeypatch.setattr(LateSum, "entries", read)
    script = load_case(WALL)
    simulation = script.build(parse_parameters(script, {"steps": "3"})).simulation
    settings = SolverSettings(name="NSN-AC", tol=1e-6, options={"linear": "two-level"}, fallback=())
    assert [step.result.status for step in replace(simulation, solver=settings)] == [Status.SOLVED] * 3


def test_auto_sums_entries_no_more_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once Newton's method has answered a step as a stage of `auto` it goes on by products, too: W is summed from zero alone, and the
    pattern of its contacts is analysed once."""
    sums: list[int] = []
    trees: list[int] = []
    add, analysed, number = DelassusSum.add, joints.elimination_tree, 1

    def added(W: DelassusSum, *given: Any, **named: Any) -> None:
        sums.append(number)
        add(W, *given, **named)

    def tree(*given: Any) -> EliminationTree:
        trees.append(number)
        return analysed(*given)

    monkeypatch.setattr(DelassusSum, "add", added)
    monkeypatch.setattr(joints, "elimination_tree", tree)
    script = load_case(WALL)
    case = script.build(parse_parameters(script, {"steps": "4", "solver": "auto"}))
    for step in case.simulation:
        assert step.result.status is Status.SOLVED
        number = step.number + 1
    assert max(sums) == max(trees) == 2


def test_what_preconditions_has_the_shares_that_w_is_made_of() -> None:
    """They are not sorted by bodies a second time."""
    script = load_case(WALL)
    step = next(iter(script.build(parse_parameters(script, {"steps": "1"})).simulation))
    operator = step.reduction.local.delassus
    source = source_of(operator.W)
    assert isinstance(source, LateSum)
    assert operator.shares is not None
    assert operator.shares.make() is source.shares
