"""Bodies that turn and are tied, pinned, plastic or warm: what must not change with the rotation does not."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import FollowerPressure
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.linkage import Ball, Linkage, Tied
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import FinitePlastic, LinearHardening, Material, Thermal, Viscoelastic, neo_hooke
from fcsim.mesh.part import Body
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta

E, RHO = 1e6, 1e3
EVERY_STRAIN = Limits(rotation=np.inf, strain=np.inf)


def apart(model: Model) -> Detector:
    """Surfaces that never meet."""
    slave, master = contact_surface(model, [(model.bodies[0].name, "x-")]), contact_surface(model, [("far", "x-")])
    return Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes)


def far() -> Any:
    return rigid_rectangle("far", (1, 1), (1e3, 0), 1.0)


HELD = Support("far", ("x", "y", "rz"))


@pytest.mark.slow
def test_tied_blocks_under_a_pressure_that_follows_are_one_block() -> None:
    """Two halves on meshes of the same nodes at the joint, in statics."""

    def tip(parts: list[Body], joint: bool) -> np.ndarray:
        loads = [FollowerPressure(part.name, "y+", 2e-4 * E, lambda t: t) for part in parts]
        model = build_model([*parts, far()], supports=[Support(parts[0].name, ("x", "y"), "x-"), HELD], loads=loads)
        links = Linkage(model, [Tied("tie", ("right", "x-"), ("left", "x+"))]) if joint else None
        detector = apart(model)
        # both halves are held in statics: the right one by the tie and a mass that is seen nowhere
        (step,) = Simulation(model, detector, QuasiStatic(1.0, eta=1e-9), 1, limits=EVERY_STRAIN, linkage=links)
        end = model.reference[:, 0] == 1.0
        moved: np.ndarray = (model.positions(step.state.x) - model.reference)[end]
        return moved

    law = neo_hooke(E, 0.3, RHO)
    whole = rectangle("whole", (1.0, 0.25), (4, 1), law)
    left, right = rectangle("left", (0.5, 0.25), (2, 1), law), rectangle("right", (0.5, 0.25), (2, 1), law, origin=(0.5, 0.0))
    one = tip([Body("left", whole)], False)
    two = tip([Body("left", left), Body("right", right)], True)
    assert np.abs(one).max() > 0.01
    assert_allclose(two, one, rtol=1e-5)


@pytest.mark.parametrize("name", ["linear", *(pytest.param(name, marks=pytest.mark.slow) for name in ("rubber", "viscoelastic"))])
def test_a_pendulum_of_a_deformable_bar_swings_as_its_rigid_twin(name: str) -> None:
    """Pinned at the middle of one end by a ball to the world, let go at the horizontal; stiff enough to bend by less than 1e-3."""
    stiff = 1e9
    materials: dict[str, Any] = {
        "linear": Material(stiff, 0.3, RHO),
        "rubber": neo_hooke(stiff, 0.3, RHO),
        "viscoelastic": Viscoelastic(stiff, 0.3, RHO, ((0.3, 1e-2),)),
    }
    length, height = 1.0, 0.2
    part = rectangle("bar", (length, height), (4, 2), materials[name], origin=(0.0, -height / 2))
    model = build_model([Body("bar", part), far()], supports=[HELD], gravity=lambda t: (0.0, -9.81), lumped=False)
    links = Linkage(model, [Ball("pin", "bar", None, (0.0, 0.0))])
    *_, step = Simulation(model, apart(model), Theta(1e-2), 40, initial=at_rest(model), linkage=links)
    inertia, arm, mass = (length**2 + height**2) / 12 + length**2 / 4, length / 2, 1.0
    angle, omega, h = 0.0, 0.0, 1e-4
    for _ in range(round(0.4 / h)):  # the rigid twin by the midpoint rule
        middle = angle + 0.5 * h * omega
        omega -= h * mass * 9.81 * arm * np.cos(middle) / inertia
        angle = middle + 0.5 * h * omega
    end = model.positions(step.state.x)[: len(part.points)][np.isclose(part.points[:, 0], length) & np.isclose(part.points[:, 1], 0)][0]
    assert angle < -1.0
    assert abs(np.arctan2(end[1], end[0]) - angle) < 5e-3
    assert_allclose(np.hypot(*end), length, rtol=2e-3)


def test_a_plastic_bar_that_is_stretched_turned_and_let_go_keeps_its_plastic_strain_and_no_stress() -> None:
    """Drawn by 5 % and let go in statics, then turned by 90 degrees: no stress, and no more flow."""
    law = FinitePlastic(E, 0.3, RHO, LinearHardening(1e-2 * E, 0.1 * E))
    part = rectangle("bar", (1.0, 0.25), (4, 1), law)
    drawn = Support("bar", ("x",), "x+", velocity=0.05)
    first = build_model([Body("bar", part), far()], supports=[Support("bar", ("x",), "x-"), Support("bar", ("y",), "y-"), drawn, HELD])
    *_, stretched = Simulation(first, apart(first), QuasiStatic(0.5), 2, limits=EVERY_STRAIN)
    free = build_model([Body("bar", part), far()], supports=[Support("bar", ("x",), "x-"), Support("bar", ("y",), "y-"), HELD])
    start = State(0.0, stretched.state.x, np.zeros(free.n_dofs), internal=stretched.state.internal)
    (loose,) = Simulation(free, apart(free), QuasiStatic(1.0), 1, initial=start, limits=EVERY_STRAIN)
    before = loose.state.x[: free.n_elastic].reshape(-1, 2)
    longer = np.ptp((part.points + before)[:, 0])
    assert 1.02 < longer < 1.05
    R, x = np.array([[0.0, -1.0], [1.0, 0.0]]), loose.state.x.copy()
    x[: free.n_elastic] = ((part.points + before) @ R.T - part.points).ravel()
    turned = free.nonlinear.inner(x, loose.state.internal, 1.0, 1.0)
    assert np.abs(turned.force).max() < 1e-6 * 1e-2 * E * 0.25
    assert_allclose(turned.variables, loose.state.internal, rtol=1e-6, atol=1e-9)


def test_heat_lengthens_a_turned_body_along_its_own_axes() -> None:
    """alpha T along and across, whatever the rotation, without stress: a free body thrown and spinning that is warmed by 1e-2."""
    law = Thermal(neo_hooke(E, 0.3, RHO), 1e-4, lambda X, t: 100.0 + 0.0 * X[..., 0])
    part = rectangle("bar", (1.0, 0.25), (4, 1), law, plane="stress")
    model = build_model([Body("bar", part), far()], supports=[HELD])
    R = np.array([[0.0, -1.0], [1.0, 0.0]])
    x = np.zeros(model.n_dofs)
    x[: model.n_elastic] = (1.01 * part.points @ R.T - part.points).ravel()
    inner = model.nonlinear.inner(x, None, 0.0, 0.0)
    assert np.abs(inner.force).max() < 1e-3 * E * 1e-2 * 0.25
    cold = model.nonlinear.inner(np.zeros(model.n_dofs), None, 0.0, 0.0)
    assert np.abs(cold.force).max() > 0.1 * E * 1e-2 * 0.25


def test_everything_sees_pressed_bodies() -> None:
    """`Everything` beside a pressure that follows: no contact, no remark, one step."""
    part = rectangle("b", (1, 1), (2, 2), Material(E, 0.3, RHO))
    model = build_model([Body("b", part), far()], supports=[HELD], loads=[FollowerPressure("b", side, 1e3) for side in part.surfaces])
    (step,) = Simulation(model, Everything(model, mu=0.3), Theta(1e-3), 1)
    assert step.substeps == 1
