"""Newton's method over ranks on models that are no walls: as few iterations as one process needs, the same answer, and an end of all where
one rank fails amid exchanges."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fcsim.problem import scaled_error
from fcsim.timestep.step import Step
from tests.unit.ranks.conftest import OnRanks, Program
from tests.unit.ranks.test_shared_run import seconds_since
from tests.unit.ranks.unlike import FAILING, MODELS

PROGRAM = Path(__file__).with_name("unlike.py")
ENVIRONMENT = {"PYTHONPATH": str(Path(__file__).parents[3])}


@cache
def alone(name: str) -> list[Step]:
    return list(MODELS[name]())


@pytest.mark.parametrize("name", MODELS)
def test_the_answer_is_one_of_one_process_problem(on_ranks: OnRanks, name: str) -> None:
    first, answers = alone(name)[0], on_ranks("unlike", 2)
    for rank in (answer[name][0] for answer in answers):
        # M and W sum in another order, and inner forces are linearised at another end of the step: by their round-off, some 1e-16 E L dx, a
        # node of the lever's steel is 1e-8 m/s faster or slower, a millionth of the 0.01 m/s by which it falls in a step
        assert scaled_error(first.reduction.local, np.array(rank["r"])) <= 100 * first.attempts[-1].tol
    for step, *ranks in zip(alone(name), *(answer[name] for answer in answers), strict=True):
        expected = -step.contact_force_on(step.model.number["floor"])
        for rank in ranks:
            assert rank["distributed"] and rank["digest"] == ranks[0]["digest"]
            assert rank["contacts"] == step.contacts.identity.tolist()
            assert np.linalg.norm(rank["force"] - expected) <= 1e-5 * np.linalg.norm(expected)


def test_joints_of_few_contacts_take_no_more_iterations_than_in_one_process(on_ranks: OnRanks) -> None:
    """Where the preconditioner magnifies what it does not know, its defect says nothing: by that alone Newton's method took fifty times as
    many."""
    taken = sum(attempt.iterations for step in alone("lever") for attempt in step.attempts)
    assert sum(step["iterations"] for step in on_ranks("unlike", 2)[0]["lever"]) <= 2 * taken


def test_what_hardly_resists_is_solved_for_more_sharply_where_newton_stalls(on_ranks: OnRanks) -> None:
    """Corners of quadratic cells: Newton's method by itself, in fewer iterations than it may take (200)."""
    assert on_ranks("unlike", 2)[0]["tower of quadratic cells"][0]["iterations"] < 200


@pytest.mark.parametrize("error", ["MemoryError", pytest.param("SingularMatrix", marks=pytest.mark.slow)])
def test_an_error_of_one_rank_within_gmres_ends_all(mpiexec: Program, tmp_path: Path, error: str) -> None:
    """Also one that others take for theirs where all ranks have it."""
    ended = mpiexec(2, PROGRAM, tmp_path, error, env=ENVIRONMENT)
    assert ended.code != 0 and f"rank {FAILING} of 2 has ended: RankFailed: GMRES over ranks: {error}" in ended.err
    assert seconds_since(tmp_path / "failed") < 30
