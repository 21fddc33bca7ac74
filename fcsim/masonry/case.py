"""A file of blocks as a case: what `fcsim run MODEL.json` runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Unpack

import numpy as np

from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.files import sha256
from fcsim.masonry.models import MODELS, ModelOptions, read_model
from fcsim.masonry.problem import MasonryProblem
from fcsim.masonry.pushes import pushed, tilted
from fcsim.masonry.structure import BlocksAre, Stone, free_nodes, structure
from fcsim.running.case import Case, CaseScript, History, PlotWishes, Sensor, load_case
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta


@dataclass(frozen=True)
class Parameters:
    """How a masonry problem is run; SI units. `--set name=value` changes one.

    multiplier: of the loads that grow, reached after `ramp` s and held; push: the weight in this direction takes their place (0,0,0: not)
    tilt: degrees a second by which the table goes down in the direction `push` (0: it does not)
    friction: factor on every mu
    blocks_are: rigid, deformable or mixed; E, nu, beta (Rayleigh, on the stiffness), cells (their size, as a share of a block's smallest
    edge) of deformable blocks
    """

    multiplier: float = 0.0
    ramp: float = 0.0
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tilt: float = 0.0
    friction: float = 1.0
    blocks_are: BlocksAre = "rigid"
    E: float = 1e10
    nu: float = 0.2
    beta: float = 1e-4
    cells: float = 0.5
    h: float = 5e-3
    theta: float = 0.5
    steps: int = 200
    solver: str = "auto"
    tol: float = 1e-8


def masonry_case(path: str | Path, mu: float | None = None, **options: Unpack[ModelOptions]) -> CaseScript:
    """Return the case of a file of blocks, for `fcsim.running.run.run_case`, as a script's; mu and the options: see `read_model`."""
    path = Path(path)
    signature(read_model).bind(path, mu=mu, **options)  # a TypeError for a name that it does not know: here, not once the case is built
    if not path.is_file():
        raise InputError(f"case {str(path)!r}: expected a model of blocks, found no such file")

    def built(parameters: Parameters) -> Case:
        return build(read_model(path, mu=mu, **options), parameters)

    return CaseScript(path.stem, path, Parameters, built, sha256(path))


def any_case(path: str | Path) -> CaseScript:
    """The case of a script, of a folder that holds one, of a known case by its name where no such path is there, or of a masonry problem
    in JSON, solids or a mesh (z up, on a floor, mu 0.6, 2000 kg/m^3)."""
    return masonry_case(path) if Path(path).suffix.lower() in MODELS else load_case(path)


def build(problem: MasonryProblem, p: Parameters) -> Case:
    """Return the case of a problem with the given parameters."""
    if not (p.friction >= 0 and math.isfinite(p.friction)):
        raise InputError(f"friction: expected a factor >= 0, got {p.friction}")
    if not (p.ramp >= 0 and p.multiplier >= 0):
        raise InputError(f"multiplier, ramp: expected numbers >= 0, got {p.multiplier} and {p.ramp}")
    if p.tilt and p.multiplier:
        raise InputError(f"tilt, multiplier: expected one of them, got {p.tilt} degrees/s and {p.multiplier}")
    rate = math.radians(p.tilt)
    question = problem
    if p.tilt:
        question = tilted(problem, p.push if any(p.push) else (1.0, 0.0, 0.0))
    elif any(p.push):
        question = pushed(problem, p.push)

    def grown(t: float) -> float:
        return math.sin(rate * t) if p.tilt else p.multiplier * (min(t / p.ramp, 1.0) if p.ramp else 1.0)

    stone = Stone(p.E, p.nu, p.cells, p.beta)
    staying: Callable[[float], float] = (lambda t: math.cos(rate * t)) if p.tilt else (lambda t: 1.0)
    model, remarks = structure(question, p.blocks_are, stone, multiplier=grown, staying=staying, over=p.h)
    mu = problem.friction
    friction = {pair: p.friction * value for pair, value in mu.items()} if isinstance(mu, dict) else p.friction * mu
    solver = SolverSettings(name=p.solver, tol=p.tol)
    simulation = Simulation(model, Everything(model, friction), Theta(p.h, p.theta), p.steps, solver, created=math.inf)
    free = free_nodes(problem, model)

    def displacement(step: Step) -> float:
        return float(np.linalg.norm(model.node_displacement(step.state.x)[free], axis=1).max())

    def load(step: Step) -> float:
        return math.degrees(rate * step.state.t) if p.tilt else grown(step.state.t)

    loading = Sensor("tilt", "angle of the table", "degrees", load) if p.tilt else Sensor("multiplier", "load multiplier", "", load)
    plots: PlotWishes = {}
    if p.tilt or p.ramp:
        plots["histories"] = (History("displacement", ("displacement",), against=loading.column),)
    if p.tilt:
        plots["imposed"] = loading.column  # an angle, which films say; a multiplier has no unit
    sensors = (loading, Sensor("displacement", "largest displacement of a block", "m", displacement))
    return Case(
        name=problem.name,
        title=problem.title or problem.name,
        simulation=simulation,
        sensors=sensors,
        plots=plots,
        fclib_set="FCSIM_Masonry",
        description="; ".join((f"{len(problem.blocks)} blocks ({p.blocks_are}), {model.n_dofs} degrees of freedom", *remarks)),
    )
