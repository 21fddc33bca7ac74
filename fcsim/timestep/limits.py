"""Where a run leaves what the kinematics of its bodies covers: it is named, and the run ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.assembly.model import Model
from fcsim.errors import InputError, Unphysical

NAMED_ROTATION, NAMED_STRAIN = 2.0, 0.05
"""Degrees of a body of linear kinematics, and strain of any body of small strain, from which a run says so."""


class KinematicsLeft(Unphysical):
    """A body has turned or is strained by more than `Limits` allow, or has an inverted cell."""


@dataclass(frozen=True)
class Limits:
    """What ends a run: rotation [degrees] of bodies of linear kinematics, strain of all bodies but those of finite strain, and inverted
    cells
    unless `inversion` allows them. infinity: never. Half of the error that a limit stands for is there long before: from 2 degrees and 5
    % the run says so."""

    rotation: float = 10.0
    strain: float = 0.2
    inversion: bool = False

    def __post_init__(self) -> None:
        for name in ("rotation", "strain"):
            if not getattr(self, name) > 0:
                raise InputError(f"Limits, {name}: expected a number > 0 (inf: never stop), got {getattr(self, name)}")


def remarks(model: Model, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
    """What is to be said of a step's deformation by kind of remark, of those kinds that are not among the `said`."""
    bodies, degrees, texts = model.deformable, np.where(found.turning, 0.0, np.degrees(found.rotation)), {}
    strain = np.where(found.finite, 0.0, found.strain)
    if "rotation" not in said and degrees.max(initial=0.0) > NAMED_ROTATION:
        worst, count = int(degrees.argmax()), int(np.count_nonzero(degrees > NAMED_ROTATION))
        texts["rotation"] = (
            f"{when}: body {bodies[worst].name!r}{_others(count)} of linear kinematics has turned by {degrees[worst]:.3g} degrees, "
            f"more than the {NAMED_ROTATION:g} that small rotations cover: forces are wrong by about {_sine(degrees[worst]):.2g} of "
            'themselves, and the rotation strains it; kinematics="turning" has no such error'
        )
    if "strain" not in said and strain.max(initial=0.0) > NAMED_STRAIN:
        worst, count = int(strain.argmax()), int(np.count_nonzero(strain > NAMED_STRAIN))
        texts["strain"] = (
            f"{when}: body {bodies[worst].name!r}{_others(count)} is strained by {100 * strain[worst]:.3g} %, more than the "
            f"{100 * NAMED_STRAIN:g} % that small strains cover"
        )
    if "inversion" not in said and found.inverted.any():
        texts["inversion"] = f"{when}: body {bodies[int(found.inverted.argmax())].name!r} has an inverted cell"
    return texts


def refuse_beyond(limits: Limits, model: Model, found: Deformation, when: str) -> None:
    """Raise KinematicsLeft where a body is beyond the limits; `when` begins the message."""
    bodies, degrees = model.deformable, np.where(found.turning, 0.0, np.degrees(found.rotation))
    strain = np.where(found.finite, 0.0, found.strain)
    if degrees.max(initial=0.0) > limits.rotation:
        worst = int(degrees.argmax())
        raise KinematicsLeft(
            f"{when}: body {bodies[worst].name!r} of linear kinematics has turned by {degrees[worst]:.3g} degrees, allowed are "
            f'{limits.rotation:g}: its stresses and forces are not to be used. What helps: kinematics="turning" for the body or the '
            "model; Simulation(limits=Limits(rotation=...)) allows more (inf: all)"
        )
    if found.inverted.any() and not limits.inversion:
        name = bodies[int(found.inverted.argmax())].name
        raise KinematicsLeft(
            f"{when}: body {name!r} has an inverted cell. What helps: a stiffer material, a smaller load, a smaller h, a finer mesh where "
            "forces act on single nodes; Simulation(limits=Limits(inversion=True)) goes on all the same"
        )
    if strain.max(initial=0.0) > limits.strain:
        worst = int(strain.argmax())
        raise KinematicsLeft(
            f"{when}: body {bodies[worst].name!r} is strained by {100 * strain[worst]:.3g} %, allowed are {100 * limits.strain:g} %: "
            "laws of small strain do not describe it. What helps: a stiffer material or smaller loads (are the units of E right?), a "
            "material of finite strain (see docs/bodies.md); Simulation(limits=Limits(strain=...)) allows more (inf: all)"
        )


def _others(count: int) -> str:
    return f" (and {count - 1} more)" if count > 1 else ""


def _sine(degrees: float) -> float:
    return float(np.sin(np.radians(degrees)))
