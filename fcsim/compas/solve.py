"""Statics or dynamics of a compas_dem problem.

Statics follow the loads and motions in steps of a time from 0 to 1 and go on until the structure is at rest. Rigid blocks are regularised
by a mass: what moves by dx is out of balance by its weight times dx over the structure's extent, so that blocks that come to rest are in
equilibrium to as much as they still move, and a structure that goes on moving does not stand.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fcsim.assembly.model import Model
from fcsim.compas.problem import Pairs, Posed, posed
from fcsim.compas.results import Written, results_of
from fcsim.contact_detection import Everything
from fcsim.contact_law.as_built import AsBuilt
from fcsim.contact_law.coulomb import NO_GAP
from fcsim.errors import InputError, MissingDependency, NotConverged
from fcsim.masonry.problem import GRAVITY
from fcsim.masonry.structure import BlocksAre, Stone, as_built, structure
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta
from fcsim.witness import Witness

if TYPE_CHECKING:
    from compas_dem.models import BlockModel
    from compas_dem.problem import Problem, Results

AT_REST = 1e-7
"""Of the structure's extent: blocks that move by less in a step of statics are at rest, and out of balance by that part of their weight."""
LOAD_STEPS, REST_STEPS, LOST = 10, 100, 0.3
_RAMP = 0.98
"""Share of the duration in which loads ramp up, as in compas_dem's other backends."""

Watch = Callable[[Step], None]


def solve(
    problem: Problem,
    model: BlockModel | None = None,
    *,
    blocks: BlocksAre = "rigid",
    n_steps: int | None = None,
    duration: float | None = None,
    dt: float | None = None,
    theta: float = 0.7,
    mu: float | None = None,
    mu_between: Pairs | None = None,
    density: float | None = None,
    E: float | None = None,
    nu: float | None = None,
    cells: float = 0.5,
    solver: str = "PPA-NSN-AC",
    tol: float = 1e-9,
    witness: Witness | None = Witness(),  # noqa: B008 - a frozen value
    watch: Watch = lambda step: None,
) -> Results:
    """Solve a problem of compas_dem; its units: m, N, kg, s, rad. Long because it has the options of compas_dem's solvers.

    Statics, unless two of duration [s], n_steps and dt [s] ask for dynamics with the theta scheme, in which gravity and instantaneous loads
    act from the beginning and are held, others and motions grow. model: by default the problem's own; blocks: "rigid", "deformable" or
    "mixed" (every second one), of E [Pa], nu (by default the material's), cells of that share of a block's smallest edge; mu, mu_between
    ({(node, node): mu}): in place of the contact model's; density [kg/m^3]: of blocks without a material; witness: what overlap is
    borne; watch(step): called after each step.

    InputError for what cannot be read or meant; NotConverged where statics find no state at rest: what is returned is in equilibrium.
    """
    began = time.perf_counter()
    model = problem.model if model is None else model
    asked = posed(problem, model, mu, mu_between, density)
    stone = _stone(asked, blocks, E, nu, cells)
    settings = SolverSettings(name=solver, tol=tol, floor=1e-6 * asked.masonry.size)
    times = _times(duration, n_steps, dt)
    if times is None:
        steps, remarks = _statics(asked, blocks, stone, _load_steps(asked, n_steps), settings, witness)
    else:
        steps, remarks = _dynamics(asked, blocks, stone, times, theta, settings, witness)
    history: list[dict[str, float]] = []
    last = None
    for step in steps:
        last = step
        history.append({"t": step.state.t, "displacement": _displacement(step), "error": step.result.error})
        watch(step)
    assert last is not None
    solved = Written(
        metadata={
            "solver": "fcsim",
            "mu": asked.masonry.mu,
            "statics": times is None,
            "blocks": blocks,
            "converged": True,  # or an exception
            "error": last.result.error,
            "steps": len(history),
            "seconds": time.perf_counter() - began,
            "penetration": last.penetration,
            "speed": 0.0 if times is None else _moved(last),
            "history": history,
            "remarks": [*asked.remarks, *remarks],
        },
        step=last,
        closed=1e-4 * asked.masonry.smallest,
    )
    return results_of(problem, model, solved)


def from_analysis(path: str | Path, name: str | None = None) -> Problem:
    """Return a problem of an analysis' file (`compas.json_dump`), with its model: the one of this name, by default the only one."""
    try:
        import compas
        from compas_dem.models import Analysis
    except ImportError as error:
        raise MissingDependency(f"compas_dem is not installed ({error}): pip install 'fcsim[compas]'") from None
    if not Path(path).is_file():
        raise InputError(f"{path}: expected an analysis of compas_dem in JSON, found no such file")
    analysis: Any = compas.json_load(path)  # what a file holds
    if not isinstance(analysis, Analysis) or analysis.model is None:
        raise InputError(f"{path}: expected an analysis of compas_dem with a model, got {type(analysis).__name__}")
    named = [problem for problem in analysis.problems if name is None or problem.name == name]
    if len(named) != 1:
        names = ", ".join(repr(problem.name) for problem in analysis.problems)
        raise InputError(f"{path}, name: expected one of the problems {names or '(none)'}, got {name!r}")
    return named[0]


def _stone(asked: Posed, blocks: str, E: float | None, nu: float | None, cells: float) -> Stone:
    own = asked.stone or (None, 0.2)
    E, nu = own[0] if E is None else E, own[1] if nu is None else nu
    if blocks != "rigid" and E is None:
        raise InputError("E: expected Young's modulus in Pa of deformable blocks, as their materials give none or several")
    return Stone(E=1e10 if E is None else E, nu=nu, cells=cells)


def _times(duration: float | None, n_steps: int | None, dt: float | None) -> tuple[int, float] | None:
    """Number and length [s] of steps of dynamics; None in statics."""
    for name, value in (("duration", duration), ("n_steps", n_steps), ("dt", dt)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a number > 0, got {value}")
    if duration is None and dt is None:
        return None
    if (duration, n_steps, dt).count(None) != 1:
        raise InputError(f"duration, n_steps, dt: expected two of them, got {duration}, {n_steps} and {dt}")
    if duration is None:
        assert n_steps is not None and dt is not None
        return n_steps, dt
    count = n_steps if n_steps is not None else max(round(duration / (dt or duration)), 1)
    return count, duration / count


def _load_steps(asked: Posed, n_steps: int | None) -> int:
    if n_steps is not None and n_steps != int(n_steps):
        raise InputError(f"n_steps: expected a whole number, got {n_steps}")
    moves = any(end for ends in asked.motions.values() for end in ends)
    return int(n_steps or (LOAD_STEPS if moves or asked.masonry.scaled else 1))


def _statics(
    asked: Posed, blocks: BlocksAre, stone: Stone, count: int, settings: SolverSettings, witness: Witness | None
) -> tuple[Iterator[Step], tuple[str, ...]]:
    def pace(end: float) -> Callable[[float], float]:
        return lambda t: end if t < 1.0 else 0.0

    h = 1.0 / count
    model, remarks = structure(asked.masonry, blocks, stone, multiplier=lambda t: min(t, 1.0), held=asked.supports(pace))
    scheme = QuasiStatic(h, GRAVITY / asked.masonry.size * h**2)
    if blocks == "rigid":
        law = as_built(asked.masonry, model)
        scheme, remarks = replace(scheme, law=law), (*remarks, *_closed_joints(law, asked.masonry.smallest))
    everything = Everything(model, asked.masonry.friction)
    simulation = Simulation(model, everything, scheme, count + REST_STEPS, settings, created=math.inf, witness=witness)
    return _until_rest(simulation, count, asked), remarks


def _closed_joints(law: AsBuilt, smallest: float) -> tuple[str, ...]:
    if max(law.closed, law.overlap) <= NO_GAP * smallest:
        return ()
    return (f"joints with gaps of up to {law.closed:.3g} m and overlaps of up to {law.overlap:.3g} m are taken as closed as they lie",)


def _until_rest(simulation: Simulation, count: int, asked: Posed) -> Iterator[Step]:
    """The steps of statics, `count` of them with loads and motions that grow; NotConverged where the structure goes on moving."""
    h, size = simulation.scheme.h, asked.masonry.size
    driven = max((abs(end or 0.0) for ends in asked.motions.values() for end in ends[:3]), default=0.0)
    step = None
    for step in simulation:
        yield step
        if step.number > count and h * _moved(step) <= AT_REST * size:
            return
        if _displacement(step) > LOST * size + driven:
            break
    assert step is not None
    worst = step.model.bodies[_fastest(step)].name
    raise NotConverged(
        f"{asked.masonry.name!r}: expected a structure that stands, got one that still moves by {h * _moved(step):.3g} m a step after "
        f"{step.number} steps, block {worst} the most: it falls or slides under these loads; duration= and dt= let it move"
    )


def _dynamics(
    asked: Posed, blocks: BlocksAre, stone: Stone, times: tuple[int, float], theta: float, settings: SolverSettings, witness: Witness | None
) -> tuple[Iterator[Step], tuple[str, ...]]:
    count, h = times
    end = count * h

    def grown(t: float) -> float:
        return min(t / (_RAMP * end), 1.0)

    model, remarks = structure(asked.masonry, blocks, stone, multiplier=grown, held=asked.supports(lambda motion: motion / end))
    everything = Everything(model, asked.masonry.friction)
    simulation = Simulation(model, everything, Theta(h, theta), count, settings, created=math.inf, witness=witness)
    return iter(simulation), remarks


def _speeds(step: Step) -> np.ndarray:
    """Speeds (n_nodes,) [m/s] of nodes, 0 of those that supports drive."""
    model: Model = step.model
    v = step.state.v.copy()
    v[model.driven_dofs] = 0.0
    speeds: np.ndarray = np.linalg.norm(model.node_velocity(v, step.state.x), axis=1)
    return speeds


def _moved(step: Step) -> float:
    return float(_speeds(step).max(initial=0.0))


def _fastest(step: Step) -> int:
    return int(np.searchsorted(step.model.node_offset, int(np.argmax(_speeds(step))), side="right")) - 1


def _displacement(step: Step) -> float:
    return float(np.linalg.norm(step.model.node_displacement(step.state.x), axis=1).max(initial=0.0))
