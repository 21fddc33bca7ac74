"""Contacts and the rows of links as points."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.running.series.vtk import VTK, in_space

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    from fcsim.assembly.model import Model
    from fcsim.contact_detection.contacts import Contacts
    from fcsim.timestep.links.linked import Linked
    from fcsim.timestep.step import Step


def link_points(vtk: VTK, step: Step, linked: Linked) -> vtkPolyData:
    """A point for each row, where the weights of its first body are: the mean of the nodes of positive weight."""
    model, rows, multiplier = step.model, linked.rows, step.result.multiplier
    assert multiplier is not None  # a step with links has one
    positive = rows.weights.multiply(rows.weights > 0).tocsr()
    total = np.asarray(positive.sum(axis=1)).ravel()
    points = vtk.data.vtkPolyData()
    points.SetPoints(vtk.points((positive @ model.positions(step.state.x)) / np.where(total > 0, total, 1.0)[:, None]))
    points.SetVerts(vtk.cells(np.arange(len(total) + 1), np.arange(len(total))))
    forces = step.force_per_reaction * multiplier[:, None] * rows.direction
    for name, values in {"force": in_space(forces), "link": linked.linkage.of_row.astype(np.int32), "gap": rows.gap}.items():
        points.GetPointData().AddArray(vtk.array(name, values))
    return points


def contact_points(vtk: VTK, step: Step, displacement: NDArray) -> vtkPolyData:
    """The contacts of a step as points: forces, sliding, status, moments, what laws remember; where bodies overlap most, if they do."""
    contacts, nc = step.contacts, len(step.contacts)
    force = np.asarray(step.contact_force).reshape(nc, contacts.dimension)
    sliding = np.asarray(step.result.u).reshape(nc, -1 if nc else contacts.dimension)[:, 1 : contacts.dimension]
    borne = _Borne(force, sliding, np.asarray(step.contact_status))
    points = _points(vtk, step.model, contacts, displacement, borne, step.state.t)
    if (moment := step.rolling_moment) is not None:
        points.GetPointData().AddArray(vtk.array("rolling_moment", np.hypot(*moment.T)))
        points.GetPointData().AddArray(vtk.array("rolling", step.rolling.astype(np.int8)))
    if (about_normal := step.spinning_moment) is not None:
        points.GetPointData().AddArray(vtk.array("spinning_moment", about_normal))
        points.GetPointData().AddArray(vtk.array("spinning", step.spinning.astype(np.int8)))
    for name, values in step.law_variables.items():
        points.GetPointData().AddArray(vtk.array(name, values if values.ndim == 1 else in_space(values)))
    seen = step.overlap
    if seen is not None and seen.bodies is not None:
        points.GetFieldData().AddArray(vtk.array("overlap", np.array([seen.depth])))
        points.GetFieldData().AddArray(vtk.array("overlap_place", in_space(np.array([seen.point]))))
    return points


def found_points(vtk: VTK, model: Model, contacts: Contacts, displacement: NDArray, t: float) -> vtkPolyData:
    """Contacts as they were found, of a step that has no answer: no forces, all of them open."""
    nothing = np.zeros((len(contacts), contacts.dimension))
    return _points(vtk, model, contacts, displacement, _Borne(nothing, nothing[:, 1:], nothing[:, 0]), t)


class _Borne(NamedTuple):
    """What contacts do, in their frames: force (nc, d) [N], sliding (nc, d - 1) [m/s], status (nc,)."""

    force: FloatArray
    sliding: FloatArray
    status: NDArray


def _points(vtk: VTK, model: Model, contacts: Contacts, displacement: NDArray, borne: _Borne, t: float) -> vtkPolyData:
    """What contacts have whatever their law; displacement (n_nodes, d) [m]; t [s]."""
    nc, (force, sliding, status) = len(contacts), borne
    points = vtk.data.vtkPolyData()
    points.SetPoints(vtk.points(contacts.point))
    points.SetVerts(vtk.cells(np.arange(nc + 1), np.arange(nc)))
    for name, values in {
        "reaction": in_space(np.einsum("ai,aij->aj", force, contacts.frame)),
        "reaction_normal": force[:, 0],
        "reaction_tangential": np.linalg.norm(force[:, 1:], axis=1),
        "gap": contacts.gap,
        "status": status.astype(np.int8),
        "sliding_velocity": np.linalg.norm(sliding, axis=1),
        "mu": contacts.mu,
        "slave": contacts.bodies[:, 0].astype(np.int32),
        "master": contacts.bodies[:, 1].astype(np.int32),
        "identity": contacts.identity.astype(np.int64),
        "normal": in_space(contacts.frame[:, 0]),
        # the master's, there: so that `scene` draws a point where the surface is on which it lies
        "displacement": in_space(np.einsum("ak,akj->aj", contacts.on_master, displacement[contacts.nodes])),
    }.items():
        points.GetPointData().AddArray(vtk.array(name, values))
    points.GetFieldData().AddArray(vtk.texts("body_names", (body.name for body in model.bodies)))
    if model.gravity is not None:
        points.GetFieldData().AddArray(vtk.array("gravity", in_space(np.array([model.gravity(t)], dtype=float))))
    return points
