"""sweep.json: which case a folder varies, by which parameters, and the runs that this makes."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import cast

from fcsim.arrays import Json
from fcsim.errors import InputError
from fcsim.files import sha256
from fcsim.records import read_record, to_json, write_record
from fcsim.running.case import CaseScript
from fcsim.running.parameters import parse_parameters

FILE = "sweep.json"
FORMAT = "fcsim sweep"
NAME_LENGTH = 70


@dataclass(frozen=True)
class Planned:
    """A run: the name of its folder, and the values of the varied parameters as they were given."""

    name: str
    values: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What a sweep's folder holds.

    case         name and script of the case; sources: SHA-256 of the script and of plugins, by their paths
    assignments  the parameters that all runs share, where they are not the case's own
    varied       the names of the others
    runs         in the order of the combinations; those of later commands behind those of earlier ones
    """

    format: str = ""
    case: str
    script: str
    sources: Mapping[str, str] = field(default_factory=dict)
    assignments: Mapping[str, str] = field(default_factory=dict)
    varied: tuple[str, ...] = ()
    runs: tuple[Planned, ...] = ()

    def of_run(self, run: Planned) -> dict[str, str]:
        """All parameters of a run that are not the case's own."""
        return {**self.assignments, **run.values}


def make_plan(
    script: CaseScript, assignments: Mapping[str, str], chosen: Sequence[Mapping[str, str]], plugins: Sequence[Path] = ()
) -> Plan:
    """The plan of one run for each combination; those of equal values are one run, whether they are written 0.5 or 0.50.

    Raises InputError where a name is none of the case's, a text no value of its type, or a name both shared and varied.
    """
    varied = tuple(chosen[0])
    both = [name for name in varied if name in assignments]
    if both:
        raise InputError(f"--set, --over: expected each parameter in one of them, got {', '.join(both)} in both")
    runs: dict[str, Planned] = {}
    for number, values in enumerate(chosen, 1):
        try:
            parameters = cast(Mapping[str, object], asdict(parse_parameters(script, {**assignments, **values})))
        except InputError as error:
            raise InputError(f"combination {number} of {len(chosen)}: {error}") from None
        name = _name({name: _unsigned(to_json(parameters[name])) for name in varied})
        runs.setdefault(name, Planned(name, dict(values)))
    sources = {str(path.resolve()): sha256(path) for path in plugins}
    return Plan(
        format=FORMAT,
        case=script.name,
        script=str(script.path.resolve()),
        sources={str(script.path.resolve()): script.sha256, **sources},
        assignments=dict(assignments),
        varied=varied,
        runs=tuple(runs.values()),
    )


def _name(values: Mapping[str, Json]) -> str:
    """A run's folder: what can be read of its values, and eight digits of the digest of all of them."""
    readable = re.sub(r"[^\w.+=-]+", "-", "_".join(f"{name}={_shown(value)}" for name, value in values.items()), flags=re.ASCII)
    digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
    return f"{readable[:NAME_LENGTH].lstrip('-.+=') or 'run'}-{digest[:8]}"


def _unsigned(value: Json) -> Json:
    """The value with 0.0 in place of -0.0."""
    if isinstance(value, list):
        return [_unsigned(entry) for entry in value]
    return value + 0.0 if isinstance(value, float) else value


def _shown(value: Json) -> str:
    if isinstance(value, list):
        return "x".join(map(_shown, value))
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def joined(directory: Path, plan: Plan, accept_changes: bool = False) -> Plan:
    """The plan of a folder with that of this command: runs that are there stay, others come behind them.

    Raises InputError where the folder holds something else, another case, other parameters, or where the case's script or a plugin is not
    as it was, unless that is accepted.
    """
    if not (directory / FILE).is_file():
        _refuse_others(directory)
        return plan
    stored = read_record(Plan, directory / FILE)
    if stored.format != FORMAT:
        raise InputError(f"{directory / FILE}: expected what fcsim sweep wrote, got the format {stored.format!r}")
    for what, before, now in (
        ("case", stored.case, plan.case),
        ("varied parameters", ", ".join(sorted(stored.varied)), ", ".join(sorted(plan.varied))),
        ("--set", _texts(stored.assignments), _texts(plan.assignments)),
    ):
        if before != now:
            raise InputError(
                f"{directory}: expected a sweep of the same {what}, {before or 'none'}, got {now or 'none'}; choose another --out"
            )
    if sorted(stored.sources.values()) != sorted(plan.sources.values()) and not accept_changes:
        raise InputError(
            f"{directory}: expected the case and plugins as they were when the sweep began, {plan.script} or a plugin has changed; choose "
            "another --out, or go on all the same with --accept-changes (finished runs stay as they are)"
        )
    known = {run.name for run in stored.runs}
    return replace(plan, runs=(*stored.runs, *(run for run in plan.runs if run.name not in known)))


def _texts(assignments: Mapping[str, str]) -> str:
    return ", ".join(f"{name}={value}" for name, value in sorted(assignments.items()))


def _refuse_others(directory: Path) -> None:
    """Nothing is written beside what is not a sweep's."""
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: expected a folder for the sweep, found a file")
    found = sorted(entry.name for entry in directory.iterdir() if not entry.name.endswith(".partial")) if directory.exists() else []
    if found:
        raise InputError(f"{directory}: expected an empty or new folder, or a sweep's, found {', '.join(found[:5])}")


def write_plan(directory: Path, plan: Plan) -> None:
    """Write directory/sweep.json."""
    write_record(directory / FILE, plan)
