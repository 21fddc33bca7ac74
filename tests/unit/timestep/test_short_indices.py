"""Matrices of a step have indices of 32 bits, whatever they are made of: kernels and products of SciPy are for one kind of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fcsim
from fcsim.linear.over_ranks.implicit_matrix import with_entries
from fcsim.mesh import brick, rigid_plane, rigid_sphere
from tests.unit.timestep.test_going_on import linked

HELD = ("x", "y", "z", "rx", "ry", "rz")


def of_links(name: str) -> fcsim.Simulation:
    return linked(name, 0.5)


def of_driven_axes(_: str) -> fcsim.Simulation:
    """A block that is driven along its support's own axes over a plane on which a ball rolls."""
    part = brick("block", (0.2, 0.2, 0.1), (2, 2, 1), fcsim.Material(1e7, 0.2, 2000.0))
    bodies = [fcsim.Body("block", part), rigid_sphere("ball", 0.1, (0.6, 0.0, 0.1), 1.0), rigid_plane("plane", (0, 0, 0), (0, 0, 1))]
    turned = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) / np.sqrt([[2.0], [2.0], [1.0]])
    drive = fcsim.Support("block", ("x",), "z+", velocity=0.1, axes=turned)
    model = fcsim.build_model(bodies, supports=[fcsim.Support("plane", HELD), drive], gravity=lambda t: (0.0, 0.0, -9.81))
    return fcsim.Simulation(model, fcsim.ExactContacts(model, 0.3), fcsim.Theta(1e-3), 2, witness=None)


SCENES = {"hinge of a rigid and a deformable body": of_links, "hinge of rubber": of_links, "driven along axes of its own": of_driven_axes}


def wide(matrix: Any) -> bool:
    return sp.issparse(matrix) and any(part.dtype != np.int32 for part in (matrix.indices, matrix.indptr))


@pytest.mark.parametrize("name", SCENES)
def test_of_a_step(name: str) -> None:
    *_, step = SCENES[name](name)
    p, model = step.reduction.problem, step.model
    made = {"M": with_entries(p.M), "H": p.H, "G": p.G, "H of all dofs": step.H, "A": step.reduction.factor.matrix()}
    groups = {f"{what} of group {k}": getattr(group, what) for k, group in enumerate(model.groups) for what in ("K", "M", "axes_matrix")}
    given = sp.coo_array((np.ones(2), (np.array([0, 1]), np.array([0, 1]))), shape=(model.positions(step.state.x).size, 3))
    assert wide(given.tocsc())
    gates = {"model.contact_matrix": model.contact_matrix(given, step.state.x), "G of links": step.linked and step.linked.G}
    assert not [what for what, matrix in {**made, **groups, **gates}.items() if matrix is not None and wide(matrix)]
