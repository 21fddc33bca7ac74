"""Statics with contact: patch test, stacks, bars. Sources in each test."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.stress import stress_operator
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap
from fcsim.mesh.blocks import brick, rectangle, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.mesh.rigid import BlockKind, blocks_that_are
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

AXES = ("x", "y", "z", "rx", "ry", "rz")


def simulate(model: Model, pairs: list[SurfacePair], steps: int, scheme: Any) -> list[Step]:
    return list(Simulation(model, Detector(pairs, model.n_nodes), scheme, steps, SolverSettings(tol=1e-10)))


@pytest.mark.parametrize("candidates", ["nodes", "faces", "gauss", "mortar", "mortar-faces", "segments"])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_contact_patch(candidates: str, mu: float) -> None:
    """Two cubes of side 2 mm, matching meshes, E = 200 GPa, nu = 0, u_z = -0.2 mm on top (small strain): p = 10 000 MPa uniform, the
    interface at -0.1 mm (code_aster V6.04.167; Taylor and Papadopoulos 1991)."""
    part = brick("cube", (2e-3, 2e-3, 2e-3), (2, 3, 2), Material(200e9, 0.0, 7800.0))
    model = build_model(
        [Body("lower", part), Body("upper", part, translation=np.array([0, 0, 2e-3]))],
        supports=[
            Support("lower", ("x", "y", "z"), "z-"),
            Support("upper", ("x", "y"), "z+"),
            Support("upper", ("z",), "z+", velocity=-0.2e-3),
        ],
    )
    upper, lower = contact_surface(model, [("upper", "z-")]), contact_surface(model, [("lower", "z+")])
    steps = simulate(model, [SurfacePair(upper, lower, mu, 1e-3, candidates)], 2, QuasiStatic(0.5))  # type: ignore[arg-type]
    last = steps[-1]
    u = last.state.x.reshape(-1, 3)
    z = model.reference[:, 2]
    assert_allclose(u, np.stack([0 * z, 0 * z, -0.2e-3 * z / 4e-3], axis=1), atol=1e-12)
    assert_allclose(u[np.unique(lower.facets), 2], -0.1e-3, atol=1e-12)
    for body in range(2):
        own = slice(body * len(part.points), (body + 1) * len(part.points))
        stress = (stress_operator(part) @ u[own].ravel()).reshape(-1, 6)
        assert_allclose(stress, np.tile([0, 0, -10_000e6, 0, 0, 0], (len(part.cells), 1)), atol=1e-7 * 10_000e6)
    assert_allclose(last.contact_force_on(1), [0, 0, 10_000e6 * 4e-6], rtol=1e-7, atol=1e-3)
    if candidates in ("faces", "mortar-faces"):  # one candidate a face: the pressure itself
        assert_allclose(last.contact_force[:, 0] / (4e-6 / 6), 10_000e6, rtol=1e-6)


@pytest.mark.parametrize("rotation", [np.eye(3), Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()])
def test_two_bars_pressed_end_to_end(rotation: np.ndarray) -> None:
    """A bar that contact alone holds at its end: u = -s (z / E_1), then of the second on top; the whole turned in space too."""
    s = 2e5
    soft, hard = Material(1e7, 0.0, 1000.0), Material(4e7, 0.0, 1000.0)
    first, second = brick("first", (0.1, 0.1, 0.4), (1, 1, 3), soft), brick("second", (0.1, 0.1, 0.4), (1, 1, 2), hard)
    push = rotation @ [0, 0, -s]
    model = build_model(
        [Body("first", first, rotation), Body("second", second, rotation, rotation @ [0, 0, 0.4])],
        supports=[Support("first", ("x", "y", "z"), "z-")],
        loads=[Traction("second", "z+", tuple(push))],
    )
    pair = SurfacePair(contact_surface(model, [("second", "z-")]), contact_surface(model, [("first", "z+")]), 0.5, 1e-2)
    last = simulate(model, [pair], 8, QuasiStatic(1.0, eta=1e-2))[-1]
    Z = np.concatenate([first.points[:, 2], second.points[:, 2]])
    shortening = np.where(np.arange(len(Z)) < len(first.points), s / soft.E * Z, s / soft.E * 0.4 + s / hard.E * Z)
    expected = -np.outer(shortening, rotation[:, 2])
    assert_allclose(last.state.x.reshape(-1, 3), expected, atol=1e-5 * shortening.max())
    assert_allclose(last.contact_force_on(1), -push * 0.01, rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("kind", ["deformable", "rigid", "mixed"])
def test_stack_of_blocks_carries_its_weight(kind: BlockKind) -> None:
    """Every joint carries what stands on it; the plane carries all. Quasi-statics, regularised by the blocks' own mass."""
    count, weight = 4, 0.1**3 * 2000 * 9.81
    part = brick("block", (0.1, 0.1, 0.1), (2, 2, 1), Material(1e7, 0.2, 2000.0))
    names = [f"block {k}" for k in range(count)]
    blocks = blocks_that_are(kind, [Body(name, part, translation=np.array([0, 0, 0.1 * k])) for k, name in enumerate(names)])
    plane = rigid_box("plane", (1, 1, 1), (0, 0, -0.5), 1.0)
    model = build_model([*blocks, plane], supports=[Support("plane", AXES)], gravity=lambda t: (0, 0, -9.81))
    pairs = [SurfacePair(contact_surface(model, [(names[0], "z-")]), contact_surface(model, [("plane", "z+")]), 0.5, 1e-3)]
    for below, above in pairwise(names):
        pairs.append(SurfacePair(contact_surface(model, [(above, "z-")]), contact_surface(model, [(below, "z+")]), 0.5, 1e-3))
    last = simulate(model, pairs, 6, QuasiStatic(0.1, eta=1e-3))[-1]
    slave, master = last.contacts.bodies.T
    number = [model.number[name] for name in names]
    for k in range(count):
        joint = (slave == number[k]) & (master == (number[k - 1] if k else model.number["plane"]))
        assert_allclose(last.force_in_space[joint].sum(axis=0), [0, 0, (count - k) * weight], atol=1e-5 * weight)
        assert_allclose(last.contact_force_on(number[k]), [0, 0, weight], atol=1e-5 * weight)
    assert_allclose(last.contact_force_on(model.number["plane"]), [0, 0, -count * weight], atol=1e-5 * weight)
    assert_allclose(last.support_impulse[model.dof_offset[-2] + 2], (count + model.rigid[-1].mass * 9.81 / weight) * weight, rtol=1e-5)


def test_stack_in_dynamics_settles_to_the_same() -> None:
    """Plane stack under gravity with damping: the reaction is the weight minus the change of momentum at every step, in the end alone."""
    part = rectangle("block", (0.1, 0.1), (4, 2), Material(1e7, 0.2, 2000.0))
    bodies = [Body(f"block {k}", part, translation=np.array([0.01 * k, 0.1 * k])) for k in range(3)]
    model = build_model(bodies, supports=[Support("block 0", ("x", "y"), "y-")], gravity=lambda t: (0, -9.81), beta=2e-3)
    pairs = [
        SurfacePair(contact_surface(model, [(f"block {k}", "y-")]), contact_surface(model, [(f"block {k - 1}", "y+")]), 0.5, 1e-3)
        for k in (1, 2)
    ]
    h, weight = 2e-3, 0.01 * 2000 * 9.81
    before = np.zeros(3)
    for step in simulate(model, pairs, 120, Theta(h, 0.6, Gap())):
        momentum = (model.mass @ step.state.v).reshape(3, -1, 2)[:, :, 1].sum(axis=1)
        change = (momentum - before) / h
        for k in (1, 2):
            assert_allclose(step.contact_force_on(k)[1], weight + change[k], atol=1e-7 * weight)
        support = step.support_impulse.reshape(-1, 2)[:, 1].sum() / h
        assert_allclose(support, 3 * weight + change.sum(), atol=1e-7 * weight)
        assert step.friction_dissipation >= -1e-12
        before = momentum
    assert_allclose(support, 3 * weight, rtol=1e-3)
