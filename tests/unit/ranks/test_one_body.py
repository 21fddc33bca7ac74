"""A body that ranks have together, its matrices by rows and its factor by MUMPS over their communicator, against one process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.over_ranks.pieces import spread_over
from fcsim.mesh.blocks import brick
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from tests.unit.ranks import one_body
from tests.unit.ranks.conftest import LAUNCHER, OnRanks

PROGRAM = Path(one_body.__file__)


@cache
def of_one_process(name: str) -> dict[str, Any]:
    return json.loads(json.dumps(one_body.found(name)))  # type: ignore[no-any-return]


def close(got: object, wanted: object, share: float) -> bool:
    """Whether vectors agree to a share of the largest entry."""
    a, b = np.array(got), np.array(wanted)
    return a.shape == b.shape and bool(np.abs(a - b).max() <= share * np.abs(b).max())


RANKS = [2, pytest.param(3, marks=pytest.mark.slow)]


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", one_body.SCENARIOS)
def test_matrices_and_solutions_agree_to_round_off(on_ranks: OnRanks, name: str, ranks: int) -> None:
    wanted = of_one_process(name)
    for answer in on_ranks("one_body", ranks):
        assert sum(answer[name]["spread"]) == 1 and not any(wanted["spread"])
        for operator in ("K x", "M x", "A x", "largest force", "load"):
            assert close(answer[name][operator], wanted[operator], 1e-13), operator
        assert close(answer[name]["A^-1 x"], wanted["A^-1 x"], 1e-9)
        assert close(answer[name]["left out"], wanted["left out"], 1e-7) and max(wanted["left out"]) > 1e-3


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", one_body.SCENARIOS)
def test_steps_agree_within_the_tolerance(on_ranks: OnRanks, name: str, ranks: int) -> None:
    """Contacts and statuses are the same; all ranks have the same bits, and one that computes alone finds them again to round-off."""
    wanted = of_one_process(name)
    assert len({answer[name]["digest"] for answer in on_ranks("one_body", ranks)}) == 1
    for got, step in zip(on_ranks("one_body", ranks)[0][name]["steps"], wanted["steps"], strict=True):
        assert got["contacts"] == step["contacts"] and got["status"] == step["status"] and len(got["contacts"]) > 0
        assert close(got["r"], step["r"], 1e-6) and close(got["x"], step["x"], 1e-6)
        assert close(got["energy"], step["energy"], 1e-7)
        assert got["momentum"] <= 1e-10 and got["again"] <= 1e-9


@pytest.mark.parametrize("ranks", RANKS)
def test_the_plane_bears_the_weight(on_ranks: OnRanks, ranks: int) -> None:
    """Less what the fall gains, for 1 ms a step."""
    heap = on_ranks("one_body", ranks)[0]["heap"]
    for step in heap["steps"]:
        assert step["push"][2] == pytest.approx(-(heap["weight"] + step["gain"] / 1e-3), rel=1e-9)


def test_a_singular_matrix_is_refused_on_all_ranks(on_ranks: OnRanks) -> None:
    for answer in on_ranks("one_body", 2):
        assert (
            "part 'block': its system matrix is singular" in answer["singular"] and "in statics a body needs supports" in answer["singular"]
        )


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_block_of_200_000_degrees_of_freedom() -> None:
    """On a plane, by one process and by two ranks: its weight, the same reactions and displacements, 0.8 of the memory at most."""
    if not LAUNCHER.exists():
        pytest.skip("no mpiexec beside this Python")
    root = PROGRAM.parents[3]
    command = [sys.executable, str(root / "benchmarks/one_body.py"), "16", "16", "230", "--ranks", "1", "2", "--json"]
    found = subprocess.run(command, env={**os.environ, "PYTHONPATH": str(root)}, capture_output=True, text=True, check=True, timeout=1700)
    one, two = json.loads(found.stdout)
    assert one["dofs"] == two["dofs"] == 17 * 17 * 231 * 3 and one["contacts"] == two["contacts"] == 17 * 17
    assert two["weight"] == pytest.approx(1, abs=1e-9)
    assert two["r apart"] <= 1e-6 and two["x apart"] <= 1e-6
    assert two["memory"] <= 0.8 * one["memory"]


def test_without_ranks_nothing_is_spread() -> None:
    part = brick("block", (1, 1, 1), (2, 2, 2), Material(1e7, 0.3, 2000.0))
    assert spread_over(BodyLayout((Body("block", part),))) == {}
