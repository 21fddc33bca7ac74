"""A wall whose W is shared by the ranks, and what each rank finds. `main` has each rank write it as JSON into
a folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from fcsim.problem.distributed import DistributedDelassus
from fcsim.ranks import alone, sharing
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers import SOLVERS
from fcsim.solvers.newton.systems.two_level.over_ranks.system import TwoLevelOverRanks
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

WALL = Path(__file__).parents[3] / "cases" / "masonry_wall"
TOLERANCE, RHO = 1e-7, 1e-2
METHODS: dict[str, Mapping[str, object]] = {
    "ADMM": {"initial_rho": "norm", "rho": 3e-5, "rho_update": "constant"},
    "EG-VI-UPK": {"max_iterations": 3},  # does not get there: Newton's method on all of W takes over
    "NSN-AC": {},
    "auto": {},
}


def simulation(name: str, steps: int) -> tuple[Simulation, dict[str, object]]:
    """The wall under its weight, and its sensors by column."""
    script = load_case(WALL)
    case = script.build(parse_parameters(script, {"steps": str(steps), "gravity_last": "2", "divisions": "8,2,2"}))
    settings = SolverSettings(name=name, tol=TOLERANCE, options=METHODS[name], fallback=("NSN-AC",))
    return replace(case.simulation, solver=settings), {sensor.column: sensor.measure for sensor in case.sensors}


def digest(array: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def seen(step: Step, sensors: Mapping[str, object]) -> dict[str, object]:
    """What a step has come to; of W its products, diagonal blocks and the factor of W + rho I."""
    operator = step.reduction.local.delassus
    refused = False
    with alone():
        try:
            operator @ np.zeros(operator.size)
        except RuntimeError as error:
            refused = "expected all ranks" in str(error)
    x = np.random.default_rng(1).standard_normal(operator.size)
    rho, whole = RHO * operator.norm, step.reduction.local.whole.W
    solved = np.zeros_like(x)
    factor = operator.factor(rho, symmetric=True)
    for _ in range(4):  # a factor in single precision is one step of refinement
        solved = solved + factor.solve(x - operator @ solved - rho * solved)
    measured = {name: sensors[name](step) for name in ("bottom_Rz", "inertia_z")}  # type: ignore[operator]
    return {
        "contacts": step.contacts.identity.tolist(),
        "r": step.result.r.tolist(),
        "digest": digest(np.concatenate([step.result.r, step.state.x, step.state.v])),
        "error": step.result.error,
        "methods": [attempt.solver for attempt in step.attempts],
        "refused": refused,
        "distributed": isinstance(step.reduction.local.W, DistributedDelassus),
        "whole": digest(whole.toarray()),
        "product": (operator @ x).tolist(),
        "diagonal": operator.diagonal_blocks.ravel().tolist(),
        "solved": solved.tolist(),
        **measured,
    }


def found(name: str, steps: int) -> list[dict[str, object]]:
    posed, sensors = simulation(name, steps)
    return [seen(step, sensors) for step in posed if step.number > 1]


def main(folder: Path) -> None:
    on_any_wall = {name: replace(method, over_ranks_from=0.0) for name, method in SOLVERS.items()}  # so small a one is not worth it
    with sharing() as ranks, mock.patch.dict(SOLVERS, on_any_wall):
        assert ranks is not None
        answer = {name: found(name, 3) for name in METHODS}
        # where GMRES does not get there on any rank, all go on with all of W
        with mock.patch.object(TwoLevelOverRanks, "solve", lambda *arguments: None):
            answer["NSN-AC with all of W"] = found("NSN-AC", 3)
        (folder / f"{ranks.number}.json").write_text(json.dumps(answer), encoding="utf-8")
