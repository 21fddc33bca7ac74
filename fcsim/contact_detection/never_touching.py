"""Explicit pairs that cannot find a contact as they stand: a wrong face named, surfaces seen from behind, slave and master swapped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.candidates import candidates, placed
from fcsim.contact_detection.surfaces.facets import FacetGeometry
from fcsim.contact_detection.surfaces.surface import OPPOSING, SurfacePair

_SEEN = 300  # facets of each side, evenly taken, stand for all: what is said is a remark
_INTEGRAL = ("mortar", "mortar-faces", "segments")


def never_touching(pairs: Sequence[SurfacePair], positions: FloatArray, names: Sequence[str]) -> tuple[str, ...]:
    """Say of each pair that finds nothing as its bodies stand at `positions` (n_nodes, d) [m] why; names of the bodies by number.

    Three things are seen: no facet of the slave faces one of the master on another body; the slave lies wholly behind the master, farther
    than a facet; each slave facet is larger than the master surface of any body, and no candidate lies over one. Bodies that
    turn or slide may change that, so this is a remark and no error.
    """
    said = []
    for number, pair in enumerate(pairs):
        if not (len(pair.slave.facets) and len(pair.master.facets)):
            continue
        slave, master = (contact_facets.geometry(contact_facets.join([s]), positions) for s in (pair.slave, pair.master))
        why = _why(pair, slave, master, positions)
        if why:
            first = names[int(pair.slave.bodies[0])], names[int(pair.master.bodies[0])]
            called = f" {pair.name!r}" if pair.name else f" {number + 1}"
            said.append(f"pair{called} (slave {first[0]!r} ..., master {first[1]!r} ...) finds no contact as its bodies stand: {why}")
    return tuple(said)


def _why(pair: SurfacePair, slave: FacetGeometry, master: FacetGeometry, positions: FloatArray) -> str:
    i, j = (np.unique(np.linspace(0, len(part.centre) - 1, _SEEN).astype(np.int64)) for part in (slave, master))
    facing = slave.normal[i] @ master.normal[j].T < OPPOSING
    facing &= pair.slave.bodies[i][:, None] != pair.master.bodies[j]
    if not facing.any():
        return "the surfaces look the same way (or are of one body); is each the face that looks at the other body?"
    height = slave.centre[i] @ master.normal[j].T - np.einsum("jd,jd->j", master.centre[j], master.normal[j])
    behind = height < -np.minimum(slave.size[i][:, None], master.size[j])
    if behind[facing].all():
        return "the slave lies behind the master, on the side of its body and beyond; is each the face that looks at the other body?"
    if pair.candidates in _INTEGRAL:
        return ""
    masters = [master.corners[pair.master.bodies == b].reshape(-1, positions.shape[1]) for b in np.unique(pair.master.bodies)]
    largest = max(float(np.linalg.norm(np.ptp(points, axis=0))) for points in masters)
    if slave.size.min() > largest and not _over(pair, positions, masters):
        return "every facet of the slave is larger than the master; swap the two, or divide the slave's facets"
    return ""


def _over(pair: SurfacePair, positions: FloatArray, masters: Sequence[FloatArray]) -> bool:
    """Whether a candidate lies over the master surface of a body (corners (., d)), along the candidate's normal: within a sphere around it,
    so that nothing is said where it is not certain."""
    point, outward, _ = placed(candidates(pair.slave, pair.candidates), contact_facets.join([pair.slave]), positions)
    for corners in masters:
        away = 0.5 * (corners.min(axis=0) + corners.max(axis=0)) - point
        across = away - np.einsum("nd,nd->n", away, outward)[:, None] * outward
        if np.linalg.norm(across, axis=1).min() <= 0.5 * float(np.linalg.norm(np.ptp(corners, axis=0))):
            return True
    return False
