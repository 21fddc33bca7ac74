"""What is said of glue between deformable bodies whose points are too far apart for the zone in which it breaks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Contacts, Detection
from fcsim.contact_law import Cohesive
from fcsim.contact_law.cohesive import BONDED_WITHIN
from fcsim.contact_law.table import LawTable
from fcsim.mesh.part import Body
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.scheme import Scheme

WITHIN = 3.0
"""Points in the zone: with fewer the joints break one by one, by jumps."""


def coarse_glue(model: Model, scheme: Scheme, detector: Detection, positions: FloatArray) -> Iterator[str]:
    """The remark on the two bodies whose glue has the fewest points in the zone.

    Ahead of a crack glue of the strength f_t yields along l = E G_I / f_t^2 of a thick body, and along (E G_I / f_t^2)^(1/4) t^(3/4) of
    one of thickness t where that is less.
    Sources: A. Hillerborg, M. Modeer, P. Petersson, Cem. Concr. Res. 6, 1976; Q. Yang, B. Cox, Int. J. Fract. 133, 2005; three elements:
    A. Turon, C. Davila, P. Camanho, J. Costa, Eng. Fract. Mech. 74, 2007.
    """
    if not any(isinstance(law, Cohesive) for law in single_laws(scheme.law)):
        return
    contacts, found = detector(positions), list[tuple[float, float, float, list[int]]]()
    contacts = contacts.take(contacts.gap <= BONDED_WITHIN * model.extents[contacts.bodies].min(axis=1))
    for law, glued in _glued(scheme.law, contacts):
        length = _energy(law) / law.tension**2
        for pair in np.unique(np.sort(glued.bodies, axis=1), axis=0).tolist():
            zones = [zone for number in pair if (zone := _zone(model, number, length)) is not None]
            apart = _spacing(glued.take(np.all(np.sort(glued.bodies, axis=1) == pair, axis=1)))
            if zones and min(zones) < WITHIN * apart:
                found.append((min(zones) / apart, min(zones), apart, pair))
    if found:
        _, zone, apart, pair = min(found)
        one, other = (model.bodies[number].name for number in pair)
        yield (
            f"the glue between {one!r} and {other!r} breaks over {zone:.3g} m ahead of a crack, by the stiffness of what it holds, its "
            f"fracture energy and strength, and its points are {apart:.3g} m apart: joints break one by one, by jumps, which statics take "
            f"hundreds of problems a step for, if they follow them. What helps: facets so short that {WITHIN:.0f} points are within that, "
            "or, with the same energy, a lower strength"
        )


def _glued(law: object, contacts: Contacts) -> Iterator[tuple[Cohesive, Contacts]]:
    """Each glue among a law and those in it, with its own contacts."""
    if isinstance(law, Cohesive):
        yield law, contacts
    elif isinstance(law, LawTable):
        number = law.number_of(contacts)
        for k, one in enumerate(law.laws):
            yield from _glued(one, contacts.take(number == k))
    elif (beside := getattr(law, "law", None)) is not None:
        yield from _glued(beside, contacts)


def _energy(law: Cohesive) -> float:
    """[J/m^2] What opening takes until all is broken, with what its springs hold at the strength."""
    return law.mode_1 + (0.5 * law.tension**2 / law.springs.normal if law.springs else 0.0)


def _zone(model: Model, number: int, length: float) -> float | None:
    """[m] Of a body, with length = G_I / f_t^2 [m/Pa]; None where it is rigid or no modulus is known."""
    body = model.bodies[number]
    E = _modulus(body.part.material) if isinstance(body, Body) else None
    if E is None:
        return None
    bulk, thickness = E * length, float(model.extents[number])
    return min(bulk, bulk**0.25 * thickness**0.75)


def _modulus(material: object) -> float | None:
    """Young's modulus E, the smallest of several; of hyperelastic materials by their Lame's constants."""
    E = getattr(material, "E", None)
    if isinstance(E, int | float | tuple):
        return float(np.min(E))
    constants = getattr(material, "parameters", {})
    if "lambda" in constants and "mu" in constants:
        lame, mu = constants["lambda"], constants["mu"]
        return float(mu * (3 * lame + 2 * mu) / (lame + mu))
    return None


def _spacing(contacts: Contacts) -> float:
    """The median distance [m] from a contact to the next one beside it; 0 for a single one."""
    points = np.unique(contacts.point, axis=0)
    return float(np.median(cKDTree(points).query(points, 2)[0][:, 1])) if len(points) > 1 else 0.0
