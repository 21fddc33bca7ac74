"""What is put around a detection, cables or pairs that are left out, takes nothing away from how a step is looked at."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fcsim
from fcsim.contact_detection import Detection, Everything, ExactContacts
from fcsim.linkage import Cable, Linkage, WithCables, without_contact_of
from fcsim.mesh import rigid_box, rigid_sphere

ALL = ("x", "y", "z", "rx", "ry", "rz")


def with_cable(detection: Detection, model: fcsim.Model) -> tuple[Detection, Linkage]:
    """A cable from the post to the ground, which is slack."""
    linkage = Linkage(model, [Cable("slack", "post", None, ((9.0, 0, 0.5), (9.0, 0, 1.0)), length=5.0)])
    return WithCables(detection, linkage), linkage


def without_pairs(detection: Detection, model: fcsim.Model) -> tuple[Detection, None]:
    """Post and floor do not touch; and once more around that."""
    return without_contact_of(without_contact_of(detection, model, [("post", "floor")]), model, []), None


Wrapper = Callable[[Detection, fcsim.Model], tuple[Detection, Linkage | None]]
POST = rigid_box("post", (1.0, 1.0, 1.0), (9.0, 0.0, 0.5), 1.0)


@pytest.mark.parametrize("wrapper", [with_cable, without_pairs])
@pytest.mark.parametrize("exact", [False, True])
def test_what_a_load_carries_through_a_plate_is_held_by_it(wrapper: Wrapper, exact: bool) -> None:
    """10 kN that only eta holds, 0.2 m above a plate of 5 cm: it bears all but eta 0.2 m M, where the load flew on 10 km without force."""
    eta = 1e-3
    floor = rigid_box("floor", (4.0, 4.0, 0.05), (0.0, 0.0, -0.025), 1.0)
    load = rigid_sphere("load", 0.5, (0, 0, 0.7), mass=1e3) if exact else rigid_box("load", (1.0,) * 3, (0, 0, 0.7), 1e3)
    held = [fcsim.Support(name, ALL) for name in ("floor", "post")]
    model = fcsim.build_model([load, floor, POST], supports=held, gravity=lambda t: (0.0, 0.0, -10.0))
    detection, linkage = wrapper(ExactContacts(model, 0.5) if exact else Everything(model, 0.5), model)
    (step,) = fcsim.Simulation(model, detection, fcsim.QuasiStatic(1.0, eta=eta), 1, linkage=linkage)
    assert step.contact_force_on(0)[2] / 1e4 == pytest.approx(1 - 0.02 * eta, abs=1e-8)


@pytest.mark.parametrize("wrapper", [with_cable, without_pairs])
def test_a_corner_dropped_on_a_corner_is_held_there(wrapper: Wrapper) -> None:
    """Of two unit cubes, at 1 m/s, 1 mm a step: what comes beside faces is no contact before it is there, and was overlap then."""
    turn = Rotation.align_vectors([[0, 0, 1]], [[1, 1, 1]])[0].as_matrix()
    corner, box = np.sqrt(3.0) / 2, rigid_box("floor", (1.0,) * 3, (0, 0, 0), 1000.0)
    points = box.points @ turn.T
    lower = fcsim.RigidBody("floor", box.mass, box.inertia, np.zeros(3), points, box.surfaces)
    centre = np.array([0.0, 0.0, 2 * corner + 1e-3])
    upper = fcsim.RigidBody("dropped", box.mass, box.inertia, centre, points + centre, box.surfaces)
    model = fcsim.build_model([lower, upper, POST], supports=[fcsim.Support(name, ALL) for name in ("floor", "post")])
    start = fcsim.at_rest(model)
    model.rigid_part(start.v)[1, 2] = -1.0
    detection, linkage = wrapper(Everything(model, 0.5), model)
    watch = fcsim.Witness(every=1, tolerance=0.01, stop=False)
    run = fcsim.Simulation(model, detection, fcsim.Theta(1e-3, 0.5), 20, initial=start, witness=watch, linkage=linkage)
    assert max(step.overlap.share for step in run if step.overlap) <= 1e-4
