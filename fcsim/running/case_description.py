"""What a case, its parameters and this machine's packages put into run.json."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from fcsim.brief import of_any_process
from fcsim.running.case import Case, CaseScript, History, Sensor
from fcsim.running.description import FORMAT, Bound, Column, Description, HistoryPlot, Plots
from fcsim.running.resume import model_digest
from fcsim.runtime import threads
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta
from fcsim.version import __version__

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

PACKAGES = ("numpy", "scipy", "numba", "fenics-dolfinx", "dolfinx-solver-real", "gmsh")


def describe(
    case: Case,
    script: CaseScript,
    parameters: DataclassInstance,
    assignments: Mapping[str, str],
    options: Mapping[str, object],
    read: Mapping[str, str],
) -> Description:
    """What run.json holds, apart from the status; `read`: the meshes and tables that the case read, with their digests."""
    simulation = case.simulation
    return Description(
        format=FORMAT,
        case=script.name,
        title=case.title,
        description=case.description,
        parameters=asdict(parameters),
        assignments=dict(assignments),
        scheme=of_any_process(repr(simulation.scheme)),
        notes=(*simulation.notes, *ignored(simulation)),
        h=simulation.scheme.h,
        steps=simulation.steps,
        solver=simulation.solver.name,
        tol=simulation.solver.tol,
        fclib_set=case.fclib_set,
        bodies=tuple(body.name for body in simulation.model.bodies),
        options=options,
        plots=_plots(case),
        versions=versions(),
        threads=threads(),
        sources={script.path.name: script.sha256, **read},
        model=model_digest(simulation.model),
    )


def ignored(simulation: Simulation) -> tuple[str, ...]:
    """What the model has and the scheme has no use for, and what both lack."""
    model, scheme = simulation.model, simulation.scheme
    if model.beta and isinstance(scheme, QuasiStatic):
        return (f"the model's damping (beta = {model.beta:g} s) does nothing in statics",)
    if isinstance(scheme, Theta) and scheme.theta == 0.5 and not (model.beta or model.alpha) and model.deformable and not model.nonlinear:
        return (
            "nothing damps the bodies (beta = 0, theta = 0.5): vibrations that impacts leave do not end. Where they are not meant, "
            "build_model(beta=...), some ten steps h, takes them away",
        )
    return ()


def _plots(case: Case) -> Plots:
    sensors = {sensor.column: _column(sensor) for sensor in case.sensors}
    imposed, bound = case.plots.get("imposed"), case.plots.get("bound")
    return Plots(
        imposed=None if imposed is None else sensors[imposed],
        reaction=tuple(sensors[column] for column in case.plots.get("reaction", ())),
        bound=None if bound is None else Bound(float(bound[0]), str(bound[1])),
        histories=tuple(_history(history, sensors) for history in case.plots.get("histories", ())),
    )


def _column(sensor: Sensor) -> Column:
    return Column(sensor.column, sensor.label, sensor.unit)


def _history(history: History, sensors: Mapping[str, Column]) -> HistoryPlot:
    against = Column("t", "time", "s") if history.against == "t" else sensors[history.against]
    return HistoryPlot(history.name, against, tuple(sensors[column] for column in history.columns))


def versions() -> dict[str, str]:
    """Versions of fcsim, Python and the packages that matter to a result."""
    found = {"fcsim": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
