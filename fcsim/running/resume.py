"""Going on with a run: only where it is the same run, or where the user accepts what has changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from fcsim.assembly.model import Model
from fcsim.brief import of_any_process
from fcsim.errors import InputError
from fcsim.mesh.cell_type import ELEMENTS
from fcsim.mesh.part import Body
from fcsim.records import from_json, json_text
from fcsim.running.case import CaseScript
from fcsim.running.description import FILE, Description, read_description
from fcsim.running.outputs import RunOptions
from fcsim.running.parameters import parse_parameters
from fcsim.timestep.step import Moment

LENGTH_DIGITS = 9
"""Nodes are the same where they agree in so many digits of the model's size: machines round differently."""


def resumed_assignments(directory: Path, script: CaseScript, given: Mapping[str, str]) -> tuple[dict[str, str], Description]:
    """The parameters of the run to go on with and those given now, and the run itself; only the number of steps may differ."""
    if not (directory / FILE).is_file():
        raise InputError(f"{directory}: expected the folder of an earlier run to resume, found no {FILE}")
    stored = read_description(directory)
    if stored.case != script.name:
        raise InputError(f"{directory}: expected a run of case {script.name!r} to resume, found {stored.case!r}")
    assignments = {**stored.assignments, **given}
    now = json.loads(json_text(asdict(parse_parameters(script, assignments))))  # tuples become lists, as in the file
    for name in [name for name in (*stored.parameters, *now) if name != "steps"]:
        if stored.parameters.get(name) != now.get(name):
            raise InputError(f"--resume: expected the first run's {name} = {stored.parameters.get(name)}, got {now.get(name)}")
    return assignments, stored


def resumed_options(stored: Description | None, given: Mapping[str, object]) -> RunOptions:
    """The options that are given now, and for the others those of the run to go on with; None: of no run, by default."""
    kept = RunOptions() if stored is None else from_json(RunOptions, dict(stored.options), f"{FILE}, options")
    return replace(kept, **given)  # type: ignore[arg-type]  # whose types are those of the command line


def changes(stored: Description, now: Description) -> list[str]:
    """What is not as it was when the run began: script, meshes and tables, the model, the step, versions."""
    found = []
    for path in sorted({*stored.sources, *now.sources}):
        before, after = stored.sources.get(path), now.sources.get(path)
        if before != after:
            how = "is read now" if before is None else "is not read now" if after is None else "has changed"
            found.append(f"{path} {how}")
    for name in ("model", "h", "scheme", "solver", "tol"):
        before, after = getattr(stored, name), getattr(now, name)
        if name == "scheme" and stored.h != now.h:  # whose h is told by itself
            before = before.replace(f"h={stored.h!r}", f"h={now.h!r}")
        if name == "scheme":  # earlier versions wrote where a law's function was
            before, after = of_any_process(before), of_any_process(after)
        if before != after:
            found.append("the model's mesh has changed" if name == "model" else f"{name} was {before}, is {after}{_why(name, stored, now)}")
    for name in sorted({*stored.versions, *now.versions}):
        before, after = stored.versions.get(name, "absent"), now.versions.get(name, "absent")
        if before != after:
            found.append(f"{name} was {before}, is {after}")
    return found


def _why(name: str, stored: Description, now: Description) -> str:
    """Of a length of step that changes with the number of steps, which the user may well ask to be larger."""
    if name != "h" or stored.steps == now.steps:
        return ""
    why = "where the case divides its time by them more steps are another run, in another --out"
    return f" with {now.steps} steps in place of {stored.steps}: {why}"


def accepted(changed: list[str], accept: bool) -> tuple[str, ...]:
    """Notes on the changes where these are accepted; InputError where there are some and they are not."""
    if changed and not accept:
        raise InputError(f"--resume: expected the run as it began; {'; '.join(changed)} (go on all the same with --accept-changes)")
    return tuple(f"resumed although {change}" for change in changed)


def check_moments(moments: tuple[Moment, Moment], model: Model, steps: int, path: Path) -> None:
    """InputError where a checkpoint cannot be of this model: shapes, numbers that are none, a step beyond the last."""
    for moment in moments:
        arrays = {name: getattr(moment.state, name) for name in ("x", "v", "rate", "inertia")}
        internal = moment.state.internal
        if internal is not None and internal.shape != model.nonlinear.initial.shape:
            count = len(model.nonlinear.initial)
            raise InputError(f"{path}, internal: expected {count} internal variables as the model's materials have, got {internal.shape}")
        arrays["internal"] = internal
        for name, values in {k: arrays[k] for k in ("x", "v", "rate", "inertia")}.items():
            if values is not None and values.shape != (model.n_dofs,):
                raise InputError(f"{path}, {name}: expected {model.n_dofs} degrees of freedom as in the model, got {values.shape}")
        for name, values in (*arrays.items(), ("t", moment.state.t), *((f"r of memory {k}", m.r) for k, m in enumerate(moment.memory))):
            if values is not None and not np.all(np.isfinite(values)):
                raise InputError(f"{path}, {name}: expected finite numbers")
        if not 0 <= moment.number <= steps:
            raise InputError(f"--resume: expected at least the {moment.number} steps that {path.parent} holds, got {steps}")


def model_digest(model: Model) -> str:
    """SHA-256 of a model's bodies: nodes, to nine digits of the whole's size, cells, and elements that are not the cells' default."""
    digest = hashlib.sha256()
    reference = model.reference
    size = float(np.ptp(reference, axis=0).max(initial=0.0)) or 1.0
    digest.update(np.round(reference / size, LENGTH_DIGITS).astype(np.float64).tobytes() + f"{size:.9g}".encode())
    for body in model.bodies:
        digest.update(body.name.encode())
        if isinstance(body, Body):
            digest.update(np.ascontiguousarray(body.part.cells, dtype=np.int64).tobytes())
            if body.part.elements != ELEMENTS[body.part.cell_type][0]:  # checkpoints older than the choice stay valid
                digest.update(body.part.elements.encode())
    return digest.hexdigest()
