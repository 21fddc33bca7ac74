"""What is said of bodies that spin on few points: the friction torque of point contacts depends on which points they are."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection import Detection, Detector
from fcsim.contact_detection.detection import innermost
from fcsim.problem import SLIP
from fcsim.timestep.step import Step

FEW, LEAST = 12, 3
"""Contacts of a flat joint: more are a mesh of it, fewer are no face."""
FLAT = 0.999
"""Cosine between normals of one flat joint."""
TURN = 1e-9
"""[rad] Turns by less in a step are what solvers leave of bodies at rest."""


def spinning(step: Step, detection: Detection, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the first flat joint of few points that spins about its normal more than it slides; {} where there is none.

    With p the points of a pair's contacts, u their relative velocities and c, v the means, the spin is
    omega = sum N . (p - c) x (u - v) / sum |p - c|^2, and it counts where omega times the mean radius exceeds |v|, and the turn in a step
    `TURN`. Where more than one point sticks the joint does not spin: the others creep, as bodies strain. Points without friction have no
    torque. Detectors are left out whose contacts stand for areas (see docs/contact_laws.md), and laws with spinning resistance.
    """
    contacts, met = step.contacts, step.encounter
    if "spinning" in said or len(contacts) < LEAST or contacts.dimension < 3 or met.terms.spinning is not None:
        return {}
    within = innermost(detection)
    if isinstance(within, Detector) and any(pair.candidates != "nodes" for pair in within.pairs):
        return {}
    loaded = step.contact_force[:, 0] > 0
    slips = (step.contact_status == SLIP) & loaded & (contacts.mu > 0)
    if np.count_nonzero(slips) < LEAST:
        return {}
    count = len(step.model.bodies)
    both = contacts.bodies.min(axis=1) * count + contacts.bodies.max(axis=1)
    key = np.where(slips, both, -1)
    pairs, first, pair = np.unique(key, return_index=True, return_inverse=True)
    up = np.where(contacts.bodies[:, 0] < contacts.bodies[:, 1], 1.0, -1.0)[:, None]
    N = up * contacts.frame[:, 0]
    local = (step.H.T @ step.state.v).reshape(contacts.frame.shape[:2])
    u = up * np.einsum("ad,adk->ak", local[:, 1:], contacts.frame[:, 1:])
    flat = np.bincount(pair, np.einsum("ad,ad->a", N, N[first][pair]) < FLAT, len(pairs)) == 0
    number = np.bincount(pair, minlength=len(pairs))
    arm, beside = contacts.point - _mean(contacts.point, pair)[pair], u - _mean(u, pair)[pair]
    square = np.bincount(pair, np.einsum("ad,ad->a", arm, arm), len(pairs))
    swept = np.bincount(pair, np.einsum("ad,ad->a", N, np.cross(arm, beside)), len(pairs))
    spin, radius = swept / np.where(square > 0, square, 1.0), np.sqrt(square / number)
    slide = np.linalg.norm(_mean(u, pair), axis=1)
    stuck = np.bincount(np.searchsorted(pairs, both[loaded & ~slips & np.isin(both, pairs)]), minlength=len(pairs))
    spins = (pairs >= 0) & (stuck <= 1) & flat & (number >= LEAST) & (number <= FEW) & (np.abs(spin) * radius > slide)
    spins &= np.abs(spin) * met.meeting.timing.length_per_u > TURN
    if not spins.any():
        return {}
    worst = int(np.flatnonzero(spins)[0])
    one, other = (step.model.bodies[k].name for k in divmod(int(pairs[worst]), count))
    return {
        "spinning": f"{when}: {one!r} and {other!r} spin on each other on {number[worst]} points; the friction torque of a face "
        "that is carried by points depends on which they are, 0.77 to 1.85 of that of uniform pressure for a square. Where it matters: "
        "surface pairs with candidates='faces' or 'mortar-faces', or the law Spinning (docs/contact_laws.md)"
    }


def _mean(values: FloatArray, group: np.ndarray) -> FloatArray:
    """Means (groups, 3) of vectors (n, 3)."""
    number = np.bincount(group)[:, None]
    return np.stack([np.bincount(group, column) for column in values.T], axis=1) / number
