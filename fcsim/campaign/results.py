"""results.csv and results.json of a sweep: parameters, status and key numbers of every run, those that failed included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fcsim.campaign.key_numbers import NUMBERS, Number
from fcsim.campaign.plan import Plan, Planned
from fcsim.campaign.record import Record
from fcsim.files import replacing_for_good
from fcsim.records import json_text
from fcsim.tables import cell, line

CSV, JSON = "results.csv", "results.json"
FIRST = ("run", "status")
OF_PROCESS = ("message", "seconds", "peak_memory")
"""Columns of what the last process of a run said, took [s] and held [MiB]."""


@dataclass(frozen=True)
class Row:
    """A run as the table has it."""

    run: Planned
    record: Record
    numbers: Mapping[str, Number] = field(default_factory=dict)


def write_results(directory: Path, plan: Plan, rows: Sequence[Row]) -> None:
    """Write directory/results.csv and results.json, each whole.

    A parameter whose name is a column's already stands under "NAME (set)".
    """
    sensors = tuple(dict.fromkeys(name for row in rows for name in row.numbers if name not in NUMBERS))
    taken = {*FIRST, *NUMBERS, *OF_PROCESS, *sensors}
    varied = {name: f"{name} (set)" if name in taken else name for name in plan.varied}
    columns = (*FIRST, *varied.values(), *NUMBERS, *sensors, *OF_PROCESS)
    tables = [_cells(row, varied) for row in rows]
    with replacing_for_good(directory / CSV) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.write(line(columns))
        file.writelines(line(cell(given.get(column)) for column in columns) for given in tables)
    with replacing_for_good(directory / JSON) as temporary:
        temporary.write_text(json_text(results_of(plan, rows)), encoding="utf-8")


def results_of(plan: Plan, rows: Sequence[Row]) -> dict[str, object]:
    """What results.json holds."""
    return {
        "case": plan.case,
        "assignments": plan.assignments,
        "varied": plan.varied,
        "runs": [
            {
                "run": row.run.name,
                "folder": f"runs/{row.run.name}",
                "values": row.run.values,
                "status": row.record.status,
                "message": row.record.message,
                "seconds": row.record.seconds,
                "peak_memory": row.record.peak_memory,
                "numbers": row.numbers,
            }
            for row in rows
        ],
    }


def _cells(row: Row, varied: Mapping[str, str]) -> dict[str, object]:
    about = row.record
    return {
        "run": row.run.name,
        "status": about.status,
        **{column: row.run.values.get(name, "") for name, column in varied.items()},
        **row.numbers,
        "message": about.message,
        "seconds": about.seconds,
        "peak_memory": about.peak_memory,
    }
