"""The model: numbering, operators of deformable and rigid bodies, supports, loads, refusals."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from fcsim import runtime
from fcsim.assembly.loads import BodyForce, Force, Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Contacts, contact_matrix, contact_matrix_of_bodies
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.mesh.rigid import rigid_body

STEEL = Material(2e11, 0.3, 7800.0)
TILT = Rotation.from_rotvec([0.4, -0.7, 0.3]).as_matrix()
GridPart = Callable[..., Part]


def rigid(name: str = "rigid", d: int = 3, seed: int = 1, mass: float = 2.0) -> RigidBody:
    """A rigid body of a few scattered points, a full inertia, and a centre that is none of them."""
    rng = np.random.default_rng(seed)
    k = 3 if d == 3 else 1
    A = rng.standard_normal((k, k))
    points = rng.standard_normal((5, d))
    facet = [[0, 1, 2]] if d == 3 else [[0, 1]]
    return RigidBody(name, mass, A @ A.T + np.eye(k), rng.standard_normal(d), points, {"face": np.array(facet)})


@pytest.fixture
def part(grid_part: GridPart) -> Part:
    return grid_part("hexahedron", (2, 1, 2), (0.3, 0.1, 0.2), STEEL)


@pytest.fixture
def plane_part(grid_part: GridPart) -> Part:
    return grid_part("quadrilateral", (3, 2), (0.3, 0.2), STEEL, thickness=0.05)


@pytest.fixture
def mixed(part: Part) -> Model:
    """Given in any order: two placements of one part, one of them turned, between two rigid bodies."""
    bodies: list[Body | RigidBody] = [rigid("r1"), Body("a", part), rigid("r2", seed=2), Body("b", part, TILT, np.array([1.0, 2.0, 3.0]))]
    return build_model(bodies, alpha=0.3, beta=1e-4, gravity=lambda t: (0.0, 0.0, -9.81 * t))


def test_numbering(mixed: Model, part: Part) -> None:
    nn = len(part.points)
    assert [body.name for body in mixed.bodies] == ["a", "b", "r1", "r2"]
    assert_array_equal(mixed.dof_offset, [0, 3 * nn, 6 * nn, 6 * nn + 6, 6 * nn + 12])
    assert_array_equal(mixed.node_offset, [0, nn, 2 * nn, 2 * nn + 5, 2 * nn + 10])
    assert_array_equal(mixed.dof_of_node[: 2 * nn].ravel(), np.arange(6 * nn))
    assert np.all(mixed.dof_of_node[2 * nn :] == -1)
    assert_allclose(mixed.reference[nn : 2 * nn], part.points @ TILT.T + [1, 2, 3])


@pytest.mark.parametrize("d", [2, 3])
def test_node_velocity_is_the_derivative_of_the_positions(d: int, part: Part, plane_part: Part) -> None:
    """At finite rotations, about a moved centre; central differences of the positions have an error of eps^2."""
    rng = np.random.default_rng(3)
    model = build_model([Body("a", plane_part if d == 2 else part), rigid("r1", d), rigid("r2", d, seed=5)])
    x, v, eps = rng.uniform(-1.2, 1.2, model.n_dofs), rng.standard_normal(model.n_dofs), 1e-5
    difference = (model.positions(model.advance(x, eps * v)) - model.positions(model.advance(x, -eps * v))) / (2 * eps)
    assert_allclose(model.node_velocity(v, x), difference, atol=1e-8)


@pytest.mark.parametrize("d", [2, 3])
def test_rigid_bodies_stay_rigid(d: int) -> None:
    body = rigid(d=d)
    model = build_model([body])
    moved = model.positions(np.random.default_rng(0).uniform(-2, 2, model.n_dofs))

    def distances(points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points[:, None] - points[None], axis=2)

    assert_allclose(distances(moved), distances(body.points), atol=1e-13)


def test_advance_composes_rotations() -> None:
    model = build_model([rigid()])
    x, dx = np.zeros(6), np.zeros(6)
    x[3:], dx[3:], x[:3], dx[:3] = [1.0, 0.5, -0.2], [0.3, -0.8, 0.6], [1, 2, 3], [4, 5, 6]
    end = model.advance(x, dx)
    assert_allclose(end[:3], [5, 7, 9])
    expected = (Rotation.from_rotvec(dx[3:]) * Rotation.from_rotvec(x[3:])).as_matrix()
    assert_allclose(model.rigid_rotation(end)[0], expected, atol=1e-14)
    assert np.linalg.norm(end[3:] - (x + dx)[3:]) > 0.1  # rotation vectors do not add


def test_rotations_add_in_the_plane() -> None:
    model = build_model([rigid(d=2)])
    assert_allclose(model.advance(np.array([0, 0, 3.0]), np.array([0, 0, 2.0])), [0, 0, 5])


@pytest.mark.parametrize("lumped", [True, False])
def test_operators_and_matrices_agree(part: Part, lumped: bool) -> None:
    model = build_model([Body("a", part), Body("b", part, TILT), rigid()], lumped=lumped, alpha=0.7, beta=1e-4)
    x = np.random.default_rng(4).standard_normal(model.n_dofs)
    assert_allclose(model.apply_mass(x), model.mass @ x, rtol=1e-12, atol=1e-12)
    assert_allclose(model.apply_stiffness(x), model.stiffness @ x, rtol=1e-9, atol=1e-9 * abs(model.stiffness).max())
    assert_allclose(model.damping.toarray(), (0.7 * model.mass + 1e-4 * model.stiffness).toarray())
    assert abs(model.mass - model.mass.T).max() <= 1e-12 * abs(model.mass).max()
    assert_allclose(model.mass[-6:, -6:].toarray()[3:, 3:], rigid().inertia)


@pytest.mark.parametrize("lumped", [True, False])
def test_a_turned_body_has_the_same_energies(part: Part, lumped: bool) -> None:
    model = build_model([Body("a", part), Body("b", part, TILT)], lumped=lumped)
    own = np.random.default_rng(5).standard_normal((len(part.points), 3))
    own_x, turned = np.concatenate([own.ravel(), 0 * own.ravel()]), np.concatenate([0 * own.ravel(), (own @ TILT.T).ravel()])
    for apply in (model.apply_mass, model.apply_stiffness):
        assert_allclose(turned @ apply(turned), own_x @ apply(own_x), rtol=1e-12)
    unturned = np.concatenate([0 * own.ravel(), own.ravel()])  # the comparison can fail: another motion has another energy
    assert abs(unturned @ model.apply_stiffness(unturned) / (own_x @ model.apply_stiffness(own_x)) - 1) > 1e-3


def test_a_part_used_many_times_is_assembled_once(grid_part: GridPart, monkeypatch: pytest.MonkeyPatch) -> None:
    part = grid_part("hexahedron", (1, 1, 1), (1, 1, 1), STEEL)
    calls = []
    original = runtime.compiled_form

    def counted(form: Any) -> Any:
        calls.append(form)
        return original(form)

    monkeypatch.setattr(runtime, "compiled_form", counted)
    model = build_model([Body(f"b{k}", part, translation=np.array([2.0 * k, 0, 0])) for k in range(5)])
    assert len(model.groups) == 1
    assert_array_equal(model.groups[0].first, 24 * np.arange(5))
    once = len(calls)
    turned = build_model([Body("a", part, TILT), Body("b", part, TILT), Body("c", part)], supports=[Support("a", ("x",), "x0")])
    assert len(turned.groups) == 3  # another orientation, other supports: other operators, from the same assembly
    assert once > 0 and len(calls) == once


def test_supports_hold_and_drive(part: Part) -> None:
    model = build_model(
        [Body("a", part), rigid()],
        supports=[Support("a", ("x", "z"), "z0"), Support("rigid", ("y", "rz"), velocity=lambda t: 3 * t), Support("a", ("y",), "z1", 0.5)],
    )
    lower, upper = np.unique(part.surfaces["z0"]), np.unique(part.surfaces["z1"])
    n = 3 * len(part.points)
    held = np.concatenate([3 * lower, 3 * lower + 2])
    expected = np.sort(np.concatenate([held, 3 * upper + 1, [n + 1, n + 5]]))
    assert_array_equal(model.driven_dofs, expected)
    assert_array_equal(model.free_dofs, np.setdiff1d(np.arange(n + 6), expected))
    velocity = np.zeros(n + 6)
    velocity[model.driven_dofs] = model.driven_velocity(2.0)
    assert_array_equal(velocity[held], 0)
    assert_array_equal(velocity[3 * upper + 1], 0.5)
    assert_array_equal(velocity[[n + 1, n + 5]], 6.0)


def test_a_whole_body_can_be_held(part: Part) -> None:
    model = build_model([Body("a", part), Body("b", part)], supports=[Support("b", ("x", "y", "z"))])
    assert_array_equal(model.driven_dofs, np.arange(3 * len(part.points), model.n_dofs))


def test_two_supports_may_say_the_same(part: Part) -> None:
    """The edge of two held faces."""
    model = build_model([Body("a", part)], supports=[Support("a", ("x",), "x0"), Support("a", ("x",), "z0")])
    both = np.union1d(part.surfaces["x0"], part.surfaces["z0"])
    assert_array_equal(model.driven_dofs, 3 * both)


def test_weight_and_its_time_factor(mixed: Model, part: Part) -> None:
    """Resultants from volume x density and the rigid masses."""
    force = mixed.load(2.0)
    weight = 0.3 * 0.1 * 0.2 * STEEL.density * 2 * 9.81
    n = 3 * len(part.points)
    for body in (force[:n], force[n : 2 * n]):
        assert_allclose(body.reshape(-1, 3).sum(axis=0), [0, 0, -weight], atol=1e-9 * weight)
    assert_allclose(force[2 * n :].reshape(2, 6), [[0, 0, -2 * 2 * 9.81, 0, 0, 0]] * 2)
    assert_array_equal(mixed.load(0.0), 0)


@pytest.mark.parametrize("rotation", [np.eye(3), TILT])
def test_traction_and_body_force_are_in_world_axes(part: Part, rotation: np.ndarray) -> None:
    model = build_model(
        [Body("a", part, rotation)],
        loads=[Traction("a", "x1", (1e3, -2e3, 5e2), factor=lambda t: t**2), BodyForce("a", (7.0, 8.0, 9.0), factor=lambda t: 1 - t)],
    )
    at_two, at_zero = model.load(2.0).reshape(-1, 3), model.load(0.0).reshape(-1, 3)
    area, volume = 0.1 * 0.2, 0.3 * 0.1 * 0.2
    assert_allclose(at_zero.sum(axis=0), volume * np.array([7, 8, 9]), rtol=1e-12)
    assert_allclose(at_two.sum(axis=0), 4 * area * np.array([1e3, -2e3, 5e2]) - volume * np.array([7, 8, 9]), rtol=1e-12)
    loaded = np.flatnonzero(np.abs(at_two + at_zero).max(axis=1) > 1e-9)
    assert_array_equal(loaded, np.unique(part.surfaces["x1"]))
    lever = np.cross(model.reference, at_zero).sum(axis=0)  # a uniform force per volume acts at the centroid
    assert_allclose(lever, np.cross(rotation @ [0.15, 0.05, 0.1], at_zero.sum(axis=0)), atol=1e-12)


def test_forces_on_rigid_bodies() -> None:
    model = build_model([rigid()], loads=[Force("rigid", (1, 2, 3), (4, 5, 6), factor=lambda t: 10 * t), Force("rigid", (0, 0, 1))])
    assert_allclose(model.load(1.0), [10, 20, 31, 40, 50, 60])
    plane = build_model([rigid(d=2)], loads=[Force("rigid", (1, 2), (3,))])
    assert_allclose(plane.load(0.0), [1, 2, 3])


def test_thickness_of_a_plane_body(plane_part: Part) -> None:
    model = build_model([Body("a", plane_part)], loads=[Traction("a", "x1", (1e3, 0))], gravity=lambda t: (0, -10))
    assert_allclose(model.load(0.0).reshape(-1, 2).sum(axis=0), [1e3 * 0.2 * 0.05, -0.3 * 0.2 * 0.05 * STEEL.density * 10])


@pytest.mark.parametrize("form", ["csc", "csr"])
@pytest.mark.parametrize("d", [2, 3])
def test_forces_by_the_contact_matrix_have_the_power_that_they_have_at_the_nodes(d: int, form: str, part: Part, plane_part: Part) -> None:
    """v . (H r) = (B v) . (G r) for every v, with B v the nodes' velocities."""
    import scipy.sparse as sp

    rng = np.random.default_rng(6)
    model = build_model([Body("a", plane_part if d == 2 else part), rigid("r1", d), rigid("r2", d, seed=5)])
    x = rng.uniform(-1, 1, model.n_dofs)
    nodal = sp.random_array((d * model.n_nodes, 12), density=0.2, rng=rng, format=form)
    H = model.contact_matrix(nodal, x)
    assert H.has_sorted_indices and H.has_canonical_format
    velocities = np.column_stack([model.node_velocity(v, x).ravel() for v in np.eye(model.n_dofs)])
    assert_allclose(H.toarray(), velocities.T @ nodal.toarray(), atol=1e-13)


@pytest.mark.parametrize("d", [2, 3])
def test_the_contact_matrix_of_bodies_is_made_in_one_pass(d: int, part: Part, plane_part: Part) -> None:
    """Bit for bit what comes of the nodal matrix, with several points of one rigid body and of two in a contact."""
    rng, nc = np.random.default_rng(7), 60
    model = build_model([Body("a", plane_part if d == 2 else part), rigid("r1", d), rigid("r2", d, seed=5)])
    x, normals = rng.uniform(-1, 1, model.n_dofs), rng.standard_normal((nc, d))
    nodes = np.array([rng.permutation(model.n_nodes)[:7] for _ in range(nc)])
    rigid_points = np.arange(model.n_elastic // d, model.n_nodes)
    nodes[: nc // 2, :4] = np.array([rng.permutation(rigid_points)[:4] for _ in range(nc // 2)])
    nodes[: nc // 2, 4:] = rng.permutation(model.n_elastic // d)[:3]
    weights, none = rng.standard_normal((nc, 7)), rng.random((nc, 7)) < 0.2
    nodes[none], weights[none] = -1, 0.0
    weights[rng.random((nc, 7)) < 0.1] = 0.0
    frame = frames(normals / np.linalg.norm(normals, axis=1)[:, None])
    contacts = Contacts(np.zeros((nc, d)), frame, np.zeros(nc), np.zeros(nc), nodes, weights, np.zeros((nc, 2), dtype=int), np.arange(nc))
    H, expected = contact_matrix_of_bodies(contacts, model, x), model.contact_matrix(contact_matrix(contacts, model.n_nodes), x)
    assert H.has_canonical_format and H.shape == expected.shape
    for name in ("indptr", "indices", "data"):
        assert_array_equal(getattr(H, name), getattr(expected, name))
    for k in range(3):  # other frames and weights on the same nodes; then a node more, and others
        if k == 1:
            weights[weights == 0], nodes[nodes < 0] = 0.5, 0
        if k == 2:
            nodes[:] = nodes[::-1].copy()
        weights *= 1.5
        last = H.indptr
        again = replace(contacts, frame=contacts.frame[::-1].copy())
        H, expected = contact_matrix_of_bodies(again, model, x), model.contact_matrix(contact_matrix(again, model.n_nodes), x)
        assert (H.indptr is last) == (k == 0)  # who knows the pattern knows it again
        for name in ("indptr", "indices", "data"):
            assert_array_equal(getattr(H, name), getattr(expected, name))
    nodes[0, 0], weights[0, 0] = model.n_nodes, 1.0
    with pytest.raises(InputError, match="expected node numbers below"):
        contact_matrix_of_bodies(contacts, model, x)


def test_contact_surface_is_a_union(mixed: Model, part: Part) -> None:
    surface = contact_surface(mixed, [("b", "x1"), ("r2", "face")])
    nn = len(part.points)
    assert_array_equal(surface.facets[:-1], part.surfaces["x1"] + nn)
    assert_array_equal(surface.facets[-1], [2 * nn + 5, 2 * nn + 6, 2 * nn + 7, -1])  # a triangle among quadrilaterals
    assert_array_equal(surface.bodies, [1] * len(part.surfaces["x1"]) + [3])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"supports": [Support("c", ("x",))]}, "body 'c': expected one of 'a', 'rigid'"),
        ({"supports": [Support("a", ("rx",))]}, "expected directions among x, y, z"),
        ({"supports": [Support("a", ())]}, "expected directions"),
        ({"supports": [Support("a", ("x",), "top")]}, "expected a surface among"),
        ({"supports": [Support("rigid", ("x",), "face")]}, "expected no surface"),
        ({"supports": [Support("a", ("x",)), Support("a", ("x",), "x0", 1.0)]}, "driven twice and differently"),
        ({"supports": [Support("a", ("x",), velocity=lambda t: "fast")]}, "body 'a' at t = 0.0 s: expected a velocity"),  # type: ignore[arg-type, return-value]
        ({"supports": [Support("a", ("x",), velocity=float("nan"))]}, "finite number"),
        ({"loads": [Force("a", (1, 2, 3))]}, "expected the place where it acts"),
        ({"loads": [Force("rigid", (1, 2))]}, "expected 3 force and 3 moment"),
        ({"loads": [Force("rigid", (1, 2, float("inf")))]}, "finite"),
        ({"loads": [Traction("rigid", "face", (1, 2, 3))]}, "expected a deformable body"),
        ({"loads": [Traction("a", "top", (1, 2, 3))]}, "expected one of the surfaces"),
        ({"loads": [Traction("a", "x0", (1, 2))]}, "expected 3 components"),
        ({"loads": [BodyForce("a", (1, 2))]}, "expected 3 components"),
        ({"gravity": lambda t: -9.81}, "gravity at t = 0.0 s: expected an acceleration of 3"),
        ({"gravity": lambda t: (0, -9.81)}, "expected an acceleration of 3"),
        ({"alpha": -1.0}, "Rayleigh"),
        ({"beta": float("nan")}, "Rayleigh"),
        ({"driven": "penalty"}, "'eliminated' or 'identity'"),
    ],
)
def test_refusals(part: Part, options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_model([Body("a", part), rigid()], **options)


def test_refusals_of_bodies(part: Part, plane_part: Part) -> None:
    with pytest.raises(InputError, match="at least one"):
        build_model([])
    with pytest.raises(InputError, match="'a' more than once"):
        build_model([Body("a", part), Body("b", part), Body("a", part)])
    with pytest.raises(InputError, match="2D or all in 3D"):
        build_model([Body("a", part), Body("b", plane_part)])
    model = build_model([Body("a", part)])
    with pytest.raises(InputError, match="none"):
        contact_surface(model, [])
    with pytest.raises(InputError, match="expected a surface among"):
        contact_surface(model, [("a", "top")])


def test_a_load_of_ones_own_class_is_told_what_there_is() -> None:
    class Wind:
        body = "block"

    with pytest.raises(InputError, match=r"loads: expected Traction, Force, .* got an object of class Wind; own loads are NodalForces"):
        build_model([Body("block", brick("block", (1.0, 1.0, 1.0), (1, 1, 1), Material(1e9, 0.2, 2000.0)))], loads=[Wind()])  # type: ignore[list-item]


def test_a_body_that_is_turned_is_as_thin_as_it_was() -> None:
    """The smallest extent of a cube, a plate and a rigid plate is that of their edges, however they are placed."""
    sizes = {"plate": (0.5, 0.4, 0.02), "cube": (0.3, 0.3, 0.3)}
    bodies: list[Body | RigidBody] = [Body(name, brick(name, size, (2, 2, 1), STEEL), TILT) for name, size in sizes.items()]
    bodies.append(rigid_body(Body("rigid", brick("rigid", sizes["plate"], (2, 2, 1), STEEL), TILT)))
    model = build_model(bodies)
    assert_allclose(model.extents, (0.02, 0.3, 0.02), rtol=1e-12)
    assert_allclose(model.thinnest, 0.02, rtol=1e-12)
