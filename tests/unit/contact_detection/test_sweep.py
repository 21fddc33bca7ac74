"""Contacts that are met on the way of a step: by the face through which a body comes, and no deeper than bodies overlap."""

import numpy as np
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.contact_detection import Everything
from fcsim.contact_detection.sweep import bounded, brought_back
from fcsim.mesh import rigid_box, rigid_polyhedron


def tip_over_a_box(start: tuple[float, float, float]) -> Model:
    """A tetrahedron that stands on its tip at `start` above a cube of 1 m whose top is at z = 0 and whose rim is at x = 0."""
    tip = np.array(start)
    tetrahedron = rigid_polyhedron("tip", tip + np.array([(0, 0, 0), (0.3, 0, 0.8), (-0.2, 0.3, 0.8), (-0.2, -0.3, 0.8)]), 1000.0)
    return build_model([rigid_box("box", (1, 1, 1), (-0.5, 0, -0.5), 1.0), tetrahedron])


def test_a_tip_that_comes_through_the_top_near_the_rim_is_held_by_the_top() -> None:
    """At the end of its way it is 10 cm below the top and 1 cm inside the side, its least way out: by that alone it would come in."""
    model = tip_over_a_box((-0.01, 0.0, 0.1))
    way = np.zeros((model.n_nodes, 3))
    way[model.node_offset[1] :, 2] = -0.2
    found = Everything(model, 0.5)(model.reference, way)
    own = np.flatnonzero(found.nodes[:, 0] == model.node_offset[1] + int(np.argmin(model.bodies[1].points[:, 2])))
    assert len(own) == 1
    assert_allclose(found.frame[own[0], 0], [0, 0, 1], atol=1e-12)
    assert_allclose(found.gap[own[0]], 0.1, atol=1e-12)


def test_what_is_brought_back_is_no_deeper_than_what_overlaps() -> None:
    """A contact found elsewhere whose gap at the beginning is negative although nothing overlaps there: it begins closed, not open."""
    model = tip_over_a_box((-0.5, 0.0, 1e-3))
    detection = Everything(model, 0.5)
    here = detection(model.reference)
    lower = model.reference.copy()
    lower[model.node_offset[1] :, 2] -= 5e-3
    deeper = detection(lower)
    assert deeper.gap.min() < -3e-3
    assert_allclose(bounded(deeper, here).gap, 0.0)  # nothing overlaps here
    assert_allclose(bounded(deeper, deeper).gap, deeper.gap)  # what does, stays
    assert_allclose(brought_back(deeper, model.reference).gap.min(), 1e-3, atol=1e-12)
