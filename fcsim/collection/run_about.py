"""What a run's folder says of all problems that came of it: in the files' info, in the README, on the terminal."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fcsim.collection.manifest import AT_REST, Entry
from fcsim.running.description import Description
from fcsim.running.folder import RunFolder


@dataclass(frozen=True)
class RunAbout:
    """What a run's folder says of all its problems."""

    title: str
    description: str
    software: str
    parameters: Mapping[str, object]
    run: Description

    @classmethod
    def of(cls, run: RunFolder) -> RunAbout:
        about = run.description
        software = ", ".join(f"{name} {version}" for name, version in about.versions.items())
        return cls(run.title, about.description, software, about.parameters, about)

    @property
    def seed(self) -> str:
        return str(self.parameters.get("seed", "none, no random numbers are used"))

    @property
    def parameters_text(self) -> str:
        """As the manifest has them."""
        return json.dumps(dict(self.parameters), sort_keys=True) if self.parameters else ""

    @property
    def of_each_file(self) -> str:
        parts = [self.description, f"software: {self.software}", f"parameters: {json.dumps(dict(self.parameters))}", f"seed: {self.seed}"]
        return "; ".join(part for part in parts if part)

    def facts(self, authors: str) -> dict[str, str]:
        given = {"authors": authors} if authors else {}
        return {**given, "software": self.software, "required accuracy": f"{math.nan if self.run.tol is None else self.run.tol:g}"}

    def text(self, every: int, iterations: bool = False) -> str:
        run = self.run
        kept = math.lcm(every, _every(run))
        sets = "".join(f" --set {shlex.quote(f'{name}={value}')}" for name, value in run.assignments.items())
        parameters = ", ".join(f"{name} = {value}" for name, value in self.parameters.items())
        steps = "every step" if kept == 1 else f"every {kept} steps"
        flag = " --iterations" if iterations else ""
        if iterations:
            steps += ", with all linearised problems of each (sets -newton00, -newton01, ...),"
        simulated = f"{run.steps if run.steps_done is None else run.steps_done} steps of {run.h} s"
        return (
            f"{self.description or self.title}. The problems of {steps} of a simulation of {simulated}, each solved by {run.solver} "
            f"to {run.tol} from the reactions of the steps before; the iterations in the files' names are those of that solve.\n\n"
            f"Parameters: {parameters}. Seed: {self.seed}.\n\n"
            "To make it again:\n\n"
            f"    fcsim collection build cases/{run.case}{sets} --every {kept}{flag} --out DIR"
        )


def _every(run: Description) -> int:
    """Every how many steps the run wrote FCLIB files."""
    every = run.options.get("export_every")
    return every if isinstance(every, int) and every > 0 else 1


def notes_on(run: RunFolder, entries: Sequence[Entry]) -> list[str]:
    """What a user of the collection should know: a run that did not end well, steps at rest, a missing form."""
    notes = []
    about = run.description
    if about.status != "finished":
        notes.append(f"The run is {about.status}{': ' if about.message else ''}{about.message}. The collection holds the steps before.")
    notes += [note[:1].upper() + note[1:] for note in about.notes if note.startswith("resumed although")]
    at_rest = sorted({str(entry.step) for entry in entries if entry.status == AT_REST})
    if at_rest:
        notes.append(
            f"At rest in step {', '.join(at_rest)}: q is the round-off of a state without load, its answer is r = 0, and a relative error "
            f"says nothing there (status {AT_REST})."
        )
    if not any(entry.form == "global" for entry in entries):
        notes.append("The run exported local files only: there is no global form.")
    return notes
