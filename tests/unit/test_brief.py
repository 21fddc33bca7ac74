"""What values show of themselves: a line each, whatever they hold."""

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.running.case import load_case
from fcsim.solvers import solve

CASES = Path(__file__).parents[2] / "cases"


def within(value: Any, seen: dict[int, Any]) -> dict[int, Any]:
    """All dataclasses that a value leads to."""
    if id(value) in seen:
        return seen
    if is_dataclass(value) and not isinstance(value, type):
        seen[id(value)] = value
        for field in fields(value):
            within(getattr(value, field.name, None), seen)
    elif isinstance(value, tuple | list):
        for entry in value:
            within(entry, seen)
    elif isinstance(value, dict):
        for entry in value.values():
            within(entry, seen)
    return seen


@pytest.mark.parametrize("name", ["stack", "impact_bar"])
def test_a_step_and_all_that_it_holds(name: str) -> None:
    script = load_case(CASES / name)
    case = script.build(script.parameters())
    step = next(iter(case.simulation))
    found = within([case, step, step.moment, step.reduction.local], {})
    assert len({type(value) for value in found.values()}) > 20
    assert {type(v).__name__: len(repr(v)) for v in found.values() if len(repr(v)) > 1000 or "\n" in repr(v)} == {}


def test_shapes_are_shown() -> None:
    problem = LocalProblem(np.eye(600), np.tile([-1.0, 0.5, 0.1], 200), np.full(200, 0.3))
    assert repr(problem).startswith("LocalProblem(W=float64 (600, 600), q=float64 (600,), mu=float64 (200,)")
    answer = repr(solve(problem, "NSN-AC"))
    assert len(answer) < 1000 and "status=Status.SOLVED" in answer
    q = np.zeros(600)
    whole = GlobalProblem(M=sp.eye_array(600, format="csc"), H=sp.eye_array(600, format="csc"), f=q, w=q, mu=np.ones(200))
    assert "M=csc float64 (600, 600)" in repr(whole)
