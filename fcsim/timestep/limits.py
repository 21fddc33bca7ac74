"""Where a run leaves what the kinematics of its bodies covers: it is named, and the run ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.errors import InputError, Unphysical
from fcsim.mesh.material.by_region import is_linear
from fcsim.mesh.part import Body

NAMED_ROTATION, NAMED_STRAIN, NAMED_LEFT_OUT = 2.0, 0.05, 0.025
"""From which a run says so: degrees of a body of linear kinematics, or of a part of a body of linear material from its frame; strain of any
body of small strain; share of energy that bending leaves out, see `fcsim.assembly.kinematics.left_out`."""

BENDS = 1.2
"""Largest rotation of a part over the body's, from which it bends rather than turns: 4/3 at the end of a cantilever."""


class KinematicsLeft(Unphysical):
    """A body has turned or is strained by more than `Limits` allow, or has an inverted cell."""


@dataclass(frozen=True)
class Limits:
    """What ends a run: rotation [degrees] of bodies of linear kinematics, their parts' too, and of parts of turning bodies of linear
    material from the body's frame; strain of all bodies but those of finite strain; left_out, the energy of the strains that bending
    leaves out, as a share of the body's; and inverted cells unless `inversion` allows them. infinity: never. Half of the error that a
    limit stands for is there long before: from 2 degrees, 5 % and 0.025 on the run says so."""

    rotation: float = 10.0
    strain: float = 0.2
    inversion: bool = False
    left_out: float = 0.5

    def __post_init__(self) -> None:
        if not isinstance(self.inversion, bool | np.bool_):
            raise InputError(f"Limits, inversion: expected True or False, got {shown(self.inversion)}")
        for name in ("rotation", "strain", "left_out"):
            if not (is_number(getattr(self, name), infinite=True) and getattr(self, name) > 0):
                raise InputError(f"Limits, {name}: expected a number > 0 (inf: never stop), got {shown(getattr(self, name))}")


def remarks(model: Model, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
    """What is to be said of a step's deformation by kind of remark, of those kinds that are not among the `said`."""
    bodies, degrees, texts = model.deformable, np.where(found.turning, 0.0, np.degrees(found.rotation)), {}
    strain, bent = np.where(found.finite, 0.0, found.strain), np.degrees(found.bent)
    if "bending" not in said and not degrees.max(initial=0.0) > NAMED_ROTATION and bent.max(initial=0.0) > NAMED_ROTATION:
        worst, name = _named(bodies, bent, NAMED_ROTATION)
        texts["bending"] = (
            f"{when}: {name} is bent: a part of it has turned by {bent[worst]:.3g} degrees from "
            f"{_base(found, worst)}, more than the {NAMED_ROTATION:g} that small rotations cover; {_bends(bodies[worst])} has no such error"
        )
    if "left out" not in said and found.left_out.max(initial=0.0) > NAMED_LEFT_OUT:
        worst, name = _named(bodies, found.left_out, NAMED_LEFT_OUT)
        texts["left out"] = (
            f"{when}: {name} is bent so far that it would be stretched, too: of that its kinematics "
            f"knows nothing, {100 * found.left_out[worst]:.3g} % of its energy, and forces are wrong by about twice as much; "
            f"{_bends(bodies[worst])} has no such error"
        )
    if "rotation" not in said and degrees.max(initial=0.0) > NAMED_ROTATION:
        worst, name = _named(bodies, degrees, NAMED_ROTATION)
        texts["rotation"] = (
            f"{when}: {name} of linear kinematics has turned by {degrees[worst]:.3g} degrees, "
            f"more than the {NAMED_ROTATION:g} that small rotations cover: forces are wrong by about {_chord(degrees[worst]):.2g} of "
            f"themselves, and the rotation strains it; {_covers(found, worst, bodies[worst])} has no such error"
        )
    if "strain" not in said and strain.max(initial=0.0) > NAMED_STRAIN:
        worst, name = _named(bodies, strain, NAMED_STRAIN)
        texts["strain"] = (
            f"{when}: {name} is strained by {100 * strain[worst]:.3g} %, more than the {100 * NAMED_STRAIN:g} % that small strains cover"
        )
    if "inversion" not in said and found.inverted.any():
        texts["inversion"] = f"{when}: body {bodies[int(found.inverted.argmax())].name!r} has an inverted cell"
    return texts


def refuse_beyond(limits: Limits, model: Model, found: Deformation, when: str) -> None:
    """Raise KinematicsLeft where a body is beyond the limits; `when` begins the message."""
    bodies, degrees = model.deformable, np.where(found.turning, 0.0, np.degrees(found.rotation))
    strain, bent = np.where(found.finite, 0.0, found.strain), np.degrees(found.bent)
    if degrees.max(initial=0.0) > limits.rotation:
        worst = int(degrees.argmax())
        raise KinematicsLeft(
            f"{when}: body {bodies[worst].name!r} of linear kinematics has turned by {degrees[worst]:.3g} degrees, allowed are "
            f"{limits.rotation:g}: its stresses and forces are not to be used. What helps: {_covers(found, worst, bodies[worst])}; "
            "Simulation(limits=Limits(rotation=...)) allows more (inf: all)"
        )
    if bent.max(initial=0.0) > limits.rotation:
        worst = int(bent.argmax())
        raise KinematicsLeft(
            f"{when}: body {bodies[worst].name!r} is bent: a part of it has turned by {bent[worst]:.3g} degrees from "
            f"{_base(found, worst)}, allowed are {limits.rotation:g}: its stresses and forces are not to be used. What helps: "
            f"{_bends(bodies[worst])}; Simulation(limits=Limits(rotation=...)) allows more (inf: all)"
        )
    if found.left_out.max(initial=0.0) > limits.left_out:
        worst = int(found.left_out.argmax())
        raise KinematicsLeft(
            f"{when}: body {bodies[worst].name!r} is bent so far that it would be stretched by {100 * found.left_out[worst]:.3g} % of its "
            f"energy, of which its kinematics knows nothing, allowed are {100 * limits.left_out:g} %: its stresses and forces are not to "
            f"be used. What helps: {_bends(bodies[worst])}; Simulation(limits=Limits(left_out=...)) allows more (inf: all)"
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


def _named(bodies: Sequence[Body], values: FloatArray, limit: float) -> tuple[int, str]:
    """The body of the largest of the values (n_deformable,), and what it is called where others are above the limit, too."""
    worst, others = int(values.argmax()), int(np.count_nonzero(values > limit)) - 1
    return worst, f"body {bodies[worst].name!r}" + (f" (and {others} more)" if others > 0 else "")


def _base(found: Deformation, body: int) -> str:
    return "the body's frame" if found.turning[body] else "the reference"


def _covers(found: Deformation, number: int, body: Body) -> str:
    """What covers the rotation of a linear body: of one that bends with it a floating frame does not."""
    if found.bent[number] > BENDS * found.rotation[number]:
        return _bends(body)
    return 'kinematics="turning" for the body or the model'


def _bends(body: Body) -> str:
    """The body that bends as far as it may."""
    if is_linear(body.part.material):
        return "a material of finite strain such as saint_venant_kirchhoff(E, nu, density)"
    return 'kinematics="turning" for the body or the model'


def _chord(degrees: float) -> float:
    """How far the end of a unit vector goes that turns by an angle."""
    return float(2 * np.sin(np.radians(degrees) / 2))
