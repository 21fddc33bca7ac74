"""What is said of one step, each kind once in a run."""

from __future__ import annotations

from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.contact_detection import Detection
from fcsim.timestep.limits import remarks
from fcsim.timestep.remarks.coarse import coarse
from fcsim.timestep.remarks.spinning import spinning
from fcsim.timestep.step import Step


def step_remarks(step: Step, detection: Detection, found: Deformation, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
    """Remarks by kind, of those kinds that are not among the `said`; steps: how many the run has."""
    return remarks(step.model, found, when, said) | spinning(step, detection, when, said) | coarse(step, found, steps, when, said)
