"""Contact surfaces of a model's bodies, by name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_detection.skin.skin import SMOOTH
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces import parents
from fcsim.contact_detection.surfaces.sharp_edges import smooth_patches
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.curves.bulges import bulges, bulges_of_all_edges
from fcsim.mesh.curves.patches import ROUND
from fcsim.mesh.part import Body


def contact_surface(model: Model, members: Iterable[tuple[str, str]]) -> ContactSurface:
    """Return the union of named surfaces, members (body name, surface name), as one contact surface of the model. Facets of second order
    are cut at their nodes into linear ones, which know their `Parents`; facets that meet at less than 23 degrees in the reference
    configuration stand for a curved surface, and know how far it bulges over them.

    InputError: an unknown body or surface, what is no pair of names, or no member at all.
    """
    members = list(members) if isinstance(members, Iterable) and not isinstance(members, str) else [members]
    for member in members:
        if not (isinstance(member, tuple | list) and len(member) == 2 and all(isinstance(name, str) for name in member)):
            raise InputError(f"contact_surface: expected a list of (body, surface), as [('block', 'z-')], got {shown(member)} in it")
    if not members:
        raise InputError("contact_surface: expected at least one (body, surface), got none")
    facets = [model.facets(body, surface) for body, surface in members]
    width = max(f.shape[1] for f in facets)
    padded = [np.pad(f, ((0, 0), (0, width - f.shape[1])), constant_values=-1) for f in facets]
    bodies = np.repeat([model.number[body] for body, _ in members], [len(f) for f in facets])
    plain = ContactSurface(np.concatenate(padded), bodies, _parents(model, members, facets))
    bulge = bulges_of_surface(model, plain)
    if bulge is None or plain.parents is None:
        return replace(plain, bulge=bulge)
    _, sides, x, normal, _, _ = _chords(model, plain, float(np.arccos(ROUND)))
    return replace(plain, bulge=bulge, parents=parents.with_surface(plain.parents, bulge, sides, x, normal))


def bulges_of_surface(model: Model, surface: ContactSurface) -> FloatArray | None:
    """How far a surface whose facets meet at less than 23 degrees bulges over them in the reference configuration, see `bulges`."""
    return bulges(*_chords(model, surface, float(np.arccos(ROUND)))) if len(surface.facets) else None


def bulges_of_all_chords(model: Model, surface: ContactSurface) -> FloatArray | None:
    """The same where all facets that meet at less than 45 degrees are chords, see `bulges_of_all_edges`."""
    return bulges_of_all_edges(*_chords(model, surface, float(np.arccos(SMOOTH)))) if len(surface.facets) else None


def _chords(model: Model, surface: ContactSurface, angle: float) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """What `bulges` is asked with of a surface that edges of less than `angle` [rad] do not part."""
    joined = contact_facets.join([surface])
    patch, shape = smooth_patches(joined, model.reference, angle)
    return joined.closed, (joined.nodes >= 0).sum(axis=1), model.reference, shape.normal, shape.size, patch


def _parents(model: Model, members: list[tuple[str, str]], facets: list[IntArray]) -> parents.Parents | None:
    """The parents of the members' linear facets; None where all are of first order."""
    found, second = [], False
    for (name, surface), linear in zip(members, facets, strict=True):
        number = model.number[name]
        body = model.bodies[number]
        cell = CELL_TYPES[body.part.cell_type] if isinstance(body, Body) else None
        if isinstance(body, Body) and cell is not None and cell.order == 2:
            found.append(parents.of_pieces(body.part.surfaces[surface] + model.node_offset[number], cell))
            second = True
        else:
            found.append(parents.of_first_order(linear))
    return parents.join(found) if second else None
