"""What compas_dem and its viewers read: where blocks stand, and per edge of the graph the contact, its forces and their resultant.

Of an edge (u, v) the forces are those on u, and the frame's z axis points into u, so that pressure is positive along it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.errors import MissingDependency
from fcsim.timestep.step import Step

if TYPE_CHECKING:
    from compas_dem.models import BlockModel
    from compas_dem.problem import Problem, Results

STATUS = ("open", "stick", "slip")
_NOTHING = 1e-10
"""Of the largest pressure."""


@dataclass(frozen=True, eq=False)
class Written:
    """The last step, what is said of the run, and the gap [m] up to which contacts without force are closed."""

    metadata: Mapping[str, object]
    step: Step
    closed: float


@dataclass(frozen=True, eq=False)
class _Joint:
    """Contacts of one pair: points (k, 3) [m], forces on the first block (k, 3) [N], gaps (k,) [m], status (k,), frames (k, 3, 3) with rows
    T1, T2, N into that block, and the one frame (3, 3) of all of them."""

    points: FloatArray
    force: FloatArray
    gap: FloatArray
    status: NDArray[np.int8]
    frames: FloatArray
    frame: FloatArray


def results_of(problem: Problem, model: BlockModel, solved: Written) -> Results:
    """Write a step as `Results`."""
    try:
        import compas.geometry as cg
        from compas_dem.problem import Results as Answer
    except ImportError as error:
        raise MissingDependency(f"compas_dem is not installed ({error}): pip install 'fcsim[compas]'") from None
    results = Answer(model_id=str(model.guid), problem_id=str(problem.guid))
    results.metadata.update(solved.metadata)
    step = solved.step
    names = [int(body.name) for body in step.model.bodies]
    for node, matrix in zip(names, _placements(step), strict=True):
        results.set_node(node, "transformation", cg.Transformation.from_matrix(matrix.tolist()))
    added = []
    for pair in _pairs(step, solved.closed):
        edge = names[pair[0]], names[pair[1]]
        if not model.graph.has_edge(edge):
            if model.graph.has_edge(edge[::-1]):
                edge, pair = edge[::-1], pair[::-1]
            else:
                added.append(list(edge))
        joint = _joint(step, pair, solved.closed)
        for key, value in _described(joint, cg).items():
            results.set_edge(edge, key, value)
    if added:
        results.metadata["added_edges"] = added
    return results


def _placements(step: Step) -> list[FloatArray]:
    """Motions (4, 4) of the blocks from where they were given; of deformable ones the nearest rigid (W. Kabsch, Acta Cryst. A32, 1976)."""
    model = step.model
    now = model.positions(step.state.x)
    found = []
    for first, last in zip(model.node_offset[:-1], model.node_offset[1:], strict=True):
        before, after = model.reference[first:last], now[first:last]
        c, moved = before.mean(axis=0), after.mean(axis=0)
        U, _, Vt = np.linalg.svd((before - c).T @ (after - moved))
        R = (U * [1.0, 1.0, np.sign(np.linalg.det(U @ Vt))] @ Vt).T
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = R, moved - R @ c
        found.append(matrix)
    return found


def _pairs(step: Step, closed: float) -> list[tuple[int, int]]:
    """Pairs of bodies (smaller number first) with a contact that is closed or bears."""
    bodies = np.sort(step.contacts.bodies[_touching(step, closed)], axis=1)
    return [(int(one), int(other)) for one, other in np.unique(bodies, axis=0)]


def _gap(step: Step) -> FloatArray:
    """Gaps (nc,) [m] at the end of the step."""
    u_N = step.result.u.reshape(-1, step.contacts.dimension)[:, 0]
    return step.contacts.gap + step.scheme.timing.length_per_u * u_N if len(u_N) else step.contacts.gap


def _touching(step: Step, closed: float) -> np.ndarray:
    return (_gap(step) <= closed) | (step.contact_force[:, 0] > 0)


def _joint(step: Step, pair: tuple[int, int], closed: float) -> _Joint:
    slave, master = step.contacts.bodies.T
    rows = np.flatnonzero(
        (((slave == pair[0]) & (master == pair[1])) | ((slave == pair[1]) & (master == pair[0]))) & _touching(step, closed)
    )
    into = np.where(slave[rows] == pair[0], 1.0, -1.0)
    largest = np.abs(step.contact_force[:, 0]).max(initial=1e-300)
    bears = step.contact_force[rows, 0] > _NOTHING * largest  # less is the solver's round-off, which a reader would take for tension
    force = np.where(bears[:, None], into[:, None] * step.force_in_space[rows], 0.0)
    normal = into[:, None] * step.contacts.frame[rows, 0]
    first = step.contacts.frame[rows, 1]
    frames = np.stack([first, np.cross(normal, first), normal], axis=1)
    weight = np.maximum(np.abs(step.contact_force[rows, 0]), 1e-12 * largest)
    mean = weight @ normal  # of joints of several faces; of a plane one its normal
    mean = mean / np.linalg.norm(mean) if np.linalg.norm(mean) > 1e-6 * weight.sum() else normal[0]
    across = first[0] - (first[0] @ mean) * mean
    if np.linalg.norm(across) < 1e-3:
        across = np.cross(mean, np.eye(3)[np.argmin(np.abs(mean))])
    across = across / np.linalg.norm(across)
    frame = np.stack([across, np.cross(mean, across), mean])
    points = step.contacts.point[rows]
    arm = (points - points.mean(axis=0)) @ frame.T
    order = np.argsort(np.arctan2(arm[:, 1], arm[:, 0]), kind="stable")  # around the polygon, seen from where z points
    rows = rows[order]
    return _Joint(points[order], force[order], _gap(step)[rows], step.contact_status[rows], frames[order], frame)


def _described(joint: _Joint, cg: Any) -> dict[str, object]:  # cg: the module compas.geometry, which has no types
    """The attributes of an edge."""
    from compas_dem.interactions import EdgeContact, FrictionContact, VertexContact

    local = joint.force @ joint.frame.T
    points = [cg.Point(*point) for point in joint.points.tolist()]
    normal = np.maximum(local[:, 2], 0.0)
    where = (normal @ joint.points / normal.sum() if normal.sum() > 0 else joint.points.mean(axis=0)).tolist()
    frame = cg.Frame(joint.points.mean(axis=0).tolist(), joint.frame[0].tolist(), joint.frame[1].tolist())
    forces = [{"c_np": max(n, 0.0), "c_nn": max(-n, 0.0), "c_u": u, "c_v": v} for u, v, n in local.tolist()]
    total = joint.force.sum(axis=0)
    entry: dict[str, object] = {
        "face_contact": len(points) >= 3,
        "edge_contact": len(points) == 2,
        "point_contact": len(points) == 1,
        "contact_points": joint.points.tolist(),
        "contact_frame": frame,
        "contact_frames": [cg.Frame(p, f[0], f[1]) for p, f in zip(joint.points.tolist(), joint.frames.tolist(), strict=True)],
        "force_normal": local[:, 2].tolist(),
        "force_tangent1": local[:, 0].tolist(),
        "force_tangent2": local[:, 1].tolist(),
        "force_vector": joint.force.tolist(),
        "gap": joint.gap.tolist(),
        "status": [STATUS[k] for k in joint.status],
        "resultant_local": local.sum(axis=0).tolist(),
        "resultant_global": total.tolist(),
        "force_point": where,
        "force_magnitude": float(np.linalg.norm(total)),
        "nodal_force_magnitudes": np.linalg.norm(joint.force, axis=1).tolist(),
    }
    if len(points) >= 3:
        return entry | {"contact_polygon": cg.Polygon(points), "contact_data": FrictionContact(points=points, frame=frame, forces=forces)}
    if len(points) == 2:
        return entry | {"contact_geometry": cg.Line(*points), "contact_data": EdgeContact(points=points, frame=frame, forces=forces)}
    return entry | {"contact_geometry": points[0], "contact_data": VertexContact(point=points[0], frame=frame, forces=forces)}
