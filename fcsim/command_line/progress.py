"""A bar over the steps of a simulation, in a script or a notebook."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fcsim.brief import shown
from fcsim.command_line.terminal import Bar
from fcsim.errors import InputError

if TYPE_CHECKING:
    from fcsim.timestep.simulation import Simulation
    from fcsim.timestep.step import Step


def progress(simulation: Simulation) -> Iterator[Step]:
    """The simulation's steps, with a bar on a terminal or in a notebook (there with `pip install 'fcsim[notebook]'`), and each remark
    of a step as a line above it:

        for step in progress(simulation): ...
    """
    if not hasattr(simulation, "steps"):
        raise InputError(f"progress: expected Simulation(...) itself, whose steps are made as they are asked for, got {shown(simulation)}")
    with Bar("step") as bar:
        for step in simulation:
            show_step(bar, simulation.steps, step)
            yield step


def show_step(bar: Bar, steps: int, step: Step) -> None:
    """Show the step that has just ended, and above the bar what was out of the ordinary in it."""
    for remark in step.remarks:
        bar.say(remark)
    if step.substeps > 1:
        bar.say(f"step {step.number}: cut into {step.substeps} parts")
    elif step.fell_back:
        tried = "; ".join(f"{a.way}: {a.status}" for a in step.attempts)
        bar.say(f"step {step.number}: fallback chain used ({tried})")
    found, done = len(step.contacts), step.iterations
    text = f"{found} contact{'' if found == 1 else 's'}, {done} iteration{'' if done == 1 else 's'}, error {step.result.error:.1e}"
    bar.update(step.number, steps, text)
