"""What is said of round bodies of exact shape that dent facets which are too long for them."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection import Detection, ExactContacts
from fcsim.contact_detection.detection import innermost
from fcsim.contact_detection.exact.dents import FINE, around
from fcsim.contact_detection.exact.mesh_skin import MeshSkin
from fcsim.contact_detection.exact.solids import Placed, leaves_by_its_side, placed
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.timestep.remarks.coarse import looked_at
from fcsim.timestep.step import Step

OF_DENT = 0.05
"""Of the dent a^2 / R that a round body of radius R has at a distance a from where it is pressed (H. Hertz 1881)."""
OF_RADIUS = 1e-4
"""Of the radius: a vertex less deep is none that had to bear."""
DEEPEST = 0.5
"""Of the radius: what lies deeper is another part of the body."""
FACING = 0.5
"""Cosine between the way out of a solid and a facet around the vertex."""


def dented(step: Step, detection: Detection, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the deepest vertex of a deformable body that, at the end of a step, lies in a sphere, a capsule or the side of a
    cylinder which presses that body elsewhere; {} where there is none.

    Depths are those below the core, R - |x - core|, less that of the body's nearest point which is pressed: what both are too deep by is a
    matter of the step. It counts beyond OF_DENT a^2 / R, a the distance of the two points across the core, where no contact is at the
    vertex and a facet around it is longer than a tenth of R: shorter ones bear with their vertices, see `fcsim.contact_detection.exact`.
    Steps 1, 4, 16, ... and the last are looked at.
    """
    if "dented" in said or not (looked_at(step.number) or step.number == steps):
        return {}
    detection = innermost(detection)
    skin = detection.skin if isinstance(detection, ExactContacts) else None
    if not isinstance(detection, ExactContacts) or skin is None or not skin.deforms.any() or not len(step.contacts):
        return {}
    x = step.model.positions(step.state.x)
    now, count = placed(detection.solids, x), len(step.model.bodies)
    body = np.zeros(len(skin.vertices), dtype=np.int64)
    body[skin.vertex] = skin.body[:, None]
    at, pairs, touching = _pressed(step, x, now)
    if not len(pairs):
        return {}
    k, v, depth, longest = _buried(now, skin, x)
    mine = now.solids.body[k] * count + body[v]
    keep = np.isin(mine, pairs) & ~np.isin(mine * len(x) + skin.vertices[v], touching) & (longest > FINE * now.solids.radius[k])
    worst = (0.0, -1)
    for n in np.flatnonzero(keep)[np.argsort(-depth[keep], kind="stable")][:_LOOKED]:
        of_pair, solid = at[pairs == mine[n]], np.array([k[n]])
        across = of_pair - x[skin.vertices[v[n]]]
        axial = now.along[k[n]] if now.solids.kind[k[n]] != "sphere" else np.zeros(x.shape[1])
        a = np.linalg.norm(across - (across @ axial)[:, None] * axial, axis=1)
        near = int(np.argmin(np.linalg.norm(across, axis=1)))
        excess = depth[n] - max(float(_depth(now, solid, of_pair[near : near + 1])[0][0]), 0.0)
        radius = now.solids.radius[k[n]]
        if excess > max(OF_DENT * a[near] ** 2, OF_RADIUS * radius**2) / radius and excess > worst[0]:
            worst = (excess, int(n))
    excess, n = worst
    if n < 0:
        return {}
    one, other = (step.model.bodies[int(b)].name for b in (now.solids.body[k[n]], body[v[n]]))
    return {
        "dented": f"{when}: {one!r} of radius {now.solids.radius[k[n]]:.3g} m dents {other!r} between facets of up to {longest[n]:.3g} m, "
        f"one of whose vertices lies {excess:.2g} m in it and bears nothing: the dent is too soft there. What helps: facets shorter than a "
        "tenth of the radius, or a mesh in place of the exact shape (docs/contact_rules.md)"
    }


_LOOKED = 100  # deepest vertices of a step: where none of them counts, none of those above does


def _pressed(step: Step, x: FloatArray, now: Placed) -> tuple[FloatArray, IntArray, IntArray]:
    """Of contacts with exact shapes that bear: the meshed body's points (n, d) at the end of the step, their pairs (n,), solid's body *
    bodies + other; and, of all contacts at a vertex alone, pair * nodes + node."""
    contacts, count = step.contacts, len(step.model.bodies)
    exact = np.isin(contacts.bodies, now.solids.body)
    one = np.flatnonzero(exact[:, 0] != exact[:, 1])
    solid = np.where(exact[one, 0], contacts.bodies[one, 0], contacts.bodies[one, 1])
    pair = solid * count + contacts.bodies[one].sum(axis=1) - solid
    nodes, weights = contacts.nodes[one], contacts.weights[one]
    of_solid = (nodes[..., None] == now.solids.node[np.searchsorted(now.solids.body, solid)][:, None]).any(axis=2)
    share = np.where((nodes >= 0) & ~of_solid, np.abs(weights), 0.0)
    total = share.sum(axis=1)
    place = np.einsum("ak,akd->ad", share, x[nodes]) / np.where(total > 0, total, 1.0)[:, None]
    alone = share.max(axis=1, initial=0.0) > (1 - 1e-9) * total
    node = nodes[np.arange(len(one)), share.argmax(axis=1)] if len(one) else np.empty(0, dtype=np.int64)
    bears = (step.contact_force[one, 0] > 0) & (total > 0)
    return place[bears], pair[bears], (pair * len(x) + node)[alone]


def _depth(now: Placed, k: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Depths (n,) of points in the round bodies k, the ways out (n, d), and how far along the axes they are (n,) [m]."""
    arm = points - now.centre[k]
    along = np.einsum("nd,nd->n", arm, now.along[k])
    s = np.clip(along, -now.solids.half[k], now.solids.half[k])
    away = s[:, None] * now.along[k] - arm
    distance = np.linalg.norm(away, axis=1)
    return now.solids.radius[k] - distance, away / np.maximum(distance, 1e-300)[:, None], along


def _buried(now: Placed, skin: MeshSkin, x: FloatArray) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Vertices of deformable bodies in round bodies: the solids, the vertices, depths and the longest sides around them (n,) [m]."""
    solids = now.solids
    chosen, soft = solids.of("sphere", "capsule", "cylinder"), np.unique(skin.vertex[skin.deforms])
    reach = float((solids.radius + solids.half)[chosen].max(initial=0.0))
    i, j = near_pairs(now.centre[chosen], x[skin.vertices[soft]], np.full(len(soft), reach))
    k, v = chosen[i], soft[j]
    depth, direction, along = _depth(now, k, x[skin.vertices[v]])
    flat = np.isin(k, solids.of("cylinder"))
    keep: BoolArray = (depth > OF_RADIUS * solids.radius[k]) & (depth < DEEPEST * solids.radius[k])
    keep &= ~flat | ((np.abs(along) <= solids.half[k]) & leaves_by_its_side(now, k, along, -depth))
    k, v, depth, direction = k[keep], v[keep], depth[keep], direction[keep]
    facing, _, longest = around(skin, x, v, direction, direction)
    keep = facing > FACING
    return k[keep], v[keep], depth[keep], longest[keep]
