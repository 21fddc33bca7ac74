"""The factor of a M + b K and the Delassus operator against dense algebra."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.shares import group_factor
from fcsim.assembly.supports import Support
from fcsim.errors import InputError
from fcsim.linear import factors as linear
from fcsim.linear.block_factors.tridiagonal import Layers
from fcsim.linear.factors import Factor
from fcsim.mesh.blocks import brick
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.timestep.step_equation.compliance import StepCompliance

SOFT = Material(1e6, 0.3, 1000.0)
TILT = {2: np.array([[0.6, -0.8], [0.8, 0.6]]), 3: Rotation.from_rotvec([0.4, -0.7, 0.3]).as_matrix()}
GridPart = Callable[..., Part]
MASS, STIFFNESS = 1.1, 3e-4


def rigid(name: str, d: int) -> RigidBody:
    A = np.random.default_rng(1).standard_normal((3, 3))[: 2 * d - 3, : 2 * d - 3]
    return RigidBody(name, 3.0, A @ A.T + np.eye(len(A)), np.zeros(d), np.eye(d), {})


def model_of(grid_part: GridPart, d: int, driven: str, lumped: bool = True) -> Model:
    """Free, supported, turned and wholly held deformable bodies; free, partly and wholly held rigid ones."""
    part = grid_part("hexahedron", (2, 1, 1), (2, 1, 1), SOFT) if d == 3 else grid_part("quadrilateral", (2, 2), (2, 1), SOFT)
    axes, all_rigid = ("x", "y", "z")[:d], (("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz"))
    bodies = [Body("free", part), Body("held", part), Body("turned", part, TILT[d]), Body("fixed", part), Body("free too", part)]
    supports = [Support("held", axes[:1], "x0"), Support("held", axes[1:], "x1"), Support("fixed", axes), Support("r fixed", all_rigid)]
    supports.append(Support("r partly", all_rigid[1:], velocity=2.0))
    rigids = [rigid(name, d) for name in ("r free", "r partly", "r fixed")]
    return build_model([*bodies, *rigids], supports=supports, lumped=lumped, driven=driven)  # type: ignore[arg-type]


def dense_system(model: Model) -> np.ndarray:
    """a M + b K with driven rows and columns of the identity."""
    A = (MASS * model.mass + STIFFNESS * model.stiffness).toarray()
    A[model.driven_dofs, :] = A[:, model.driven_dofs] = 0
    A[model.driven_dofs, model.driven_dofs] = 1
    return A


def random_contacts(model: Model, nodes: np.ndarray, nc: int) -> sp.csr_array:
    """A random H (n_dofs, m) on the contact nodes of deformable bodies and on all rigid dofs, zero at driven dofs."""
    d, rng = model.dimension, np.random.default_rng(2)
    H = sp.random_array((model.n_dofs, d * nc), density=0.15, rng=rng).toarray()
    touched = np.zeros(model.n_dofs, dtype=bool)
    touched[model.dof_of_node[nodes[nodes < model.n_elastic // d]].ravel()] = True
    touched[model.n_elastic :] = True
    touched[model.driven_dofs] = False
    return sp.csr_array(H * touched[:, None])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("lumped", [True, False])
@pytest.mark.parametrize("driven", ["eliminated", "identity"])
def test_solve_matrix_and_delassus(grid_part: GridPart, d: int, lumped: bool, driven: str) -> None:
    model = model_of(grid_part, d, driven, lumped)
    nodes = np.arange(0, model.n_nodes, 2)
    factor = SystemFactor(model, MASS, STIFFNESS, nodes)
    A, H = dense_system(model), random_contacts(model, nodes, 7)
    rhs = np.random.default_rng(3).standard_normal(model.n_dofs)
    W = H.T @ np.linalg.solve(A, H.toarray())
    own = np.arange(model.n_dofs)
    if driven == "eliminated":
        own = model.free_dofs
        A, rhs, H = A[np.ix_(own, own)], rhs[own], sp.csr_array(H[own])
    assert_allclose(factor.matrix().toarray(), A, atol=1e-13 * abs(A).max())
    assert_allclose(factor.solve(rhs), np.linalg.solve(A, rhs), rtol=1e-9, atol=1e-12)
    assert_allclose(StepCompliance(factor).delassus(H, d), W, rtol=1e-9, atol=1e-12 * abs(W).max())


@pytest.mark.parametrize("at_once", [1, 100])
def test_few_columns_at_a_time_are_the_same(grid_part: GridPart, monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    model = model_of(grid_part, 3, "identity")
    nodes = np.arange(0, model.n_nodes, 2)
    H = random_contacts(model, nodes, 7)
    monkeypatch.setattr(linear, "SOLVED_AT_ONCE", at_once)
    W = H.T @ np.linalg.solve(dense_system(model), H.toarray())
    assert_allclose(StepCompliance(SystemFactor(model, MASS, STIFFNESS, nodes)).delassus(H, 3), W, rtol=1e-9, atol=1e-12 * abs(W).max())


def test_apply_keeps_driven_dofs(grid_part: GridPart) -> None:
    model = model_of(grid_part, 3, "eliminated")
    v = np.random.default_rng(4).standard_normal(model.n_dofs)
    expected = (MASS * model.mass + STIFFNESS * model.stiffness) @ v
    assert_allclose(SystemFactor(model, MASS, STIFFNESS, np.arange(4)).apply(v), expected, rtol=1e-9, atol=1e-9)


def test_contacts_on_held_nodes_only(grid_part: GridPart) -> None:
    """A contact between two held surfaces has no compliance."""
    part = grid_part("hexahedron", (1, 1, 1), (1, 1, 1), SOFT)
    for driven in ("eliminated", "identity"):
        model = build_model([Body("a", part)], supports=[Support("a", ("x", "y", "z"), "z0")], driven=driven)
        nodes = np.unique(part.surfaces["z0"])
        n = len(model.free_dofs) if driven == "eliminated" else model.n_dofs
        W = StepCompliance(SystemFactor(model, 1.0, 1.0, nodes)).delassus(sp.csr_array((n, 6)), 3)
        assert_allclose(W, np.zeros((6, 6)))


def test_a_geometric_stiffness_of_no_entry(grid_part: GridPart, capfd: pytest.CaptureFixture[str]) -> None:
    """It changes nothing, and LAPACK does not complain of matrices of no row."""
    model = model_of(grid_part, 3, "eliminated")
    nodes = np.arange(0, model.n_nodes, 2)
    factor, n = SystemFactor(model, MASS, STIFFNESS, nodes), len(model.free_dofs)
    H = sp.csr_array(random_contacts(model, nodes, 3)[model.free_dofs])
    plain, bent = StepCompliance(factor), StepCompliance(factor, bent=sp.csr_array((n, n)))
    rhs = np.random.default_rng(6).standard_normal(n)
    assert_allclose(bent.solve(rhs), plain.solve(rhs))
    assert_allclose(bent.delassus(H, 3), plain.delassus(H, 3))
    assert capfd.readouterr() == ("", "")


def test_no_contacts(grid_part: GridPart) -> None:
    model = model_of(grid_part, 3, "eliminated")
    W = StepCompliance(SystemFactor(model, 1.0, 1.0, np.arange(3))).delassus(sp.csr_array((len(model.free_dofs), 0)), 3)
    assert W.shape == (0, 0)


def test_equal_bodies_share_one_factor(grid_part: GridPart, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = []
    original = group_factor.factorise_body

    def counted(A: sp.csr_array, layers: Layers | None) -> Factor:
        sizes.append(A.shape[0])
        return original(A, layers)

    monkeypatch.setattr(group_factor, "factorise_body", counted)
    part = grid_part("hexahedron", (1, 1, 1), (1, 1, 1), SOFT)
    bodies = [Body(f"b{k}", part, translation=np.array([2.0 * k, 0, 0])) for k in range(6)]
    SystemFactor(build_model(bodies, supports=[Support("b3", ("x", "y", "z"), "z0")]), 1.0, 1.0, np.arange(8))
    assert sorted(sizes) == [12, 24]


@pytest.mark.each_value
@pytest.mark.parametrize("E", [1e5, 1e6, 3.3e9, 7e10, 2.1e11])
@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 2, 2), (3, 2, 4)])
def test_floating_body_in_statics_is_refused(grid_part: GridPart, E: float, shape: tuple[int, int, int]) -> None:
    """Whatever sign round-off gives to the zero pivots of a singular stiffness."""
    part = grid_part("hexahedron", shape, (1, 1, 1), Material(E, 0.3, 1000.0))
    with pytest.raises(InputError, match=r"part 'grid'.*singular.*in statics a body needs supports"):
        SystemFactor(build_model([Body("a", part)]), 0.0, 1.0, np.arange(8))


def test_body_that_can_still_slide_is_refused_in_statics(grid_part: GridPart) -> None:
    part = grid_part("quadrilateral", (2, 2), (1, 1), SOFT)
    with pytest.raises(InputError, match="singular"):
        SystemFactor(build_model([Body("a", part)], supports=[Support("a", ("x",), "x0")]), 0.0, 1.0, np.arange(2))


def test_rigid_body_without_mass_in_statics_is_refused() -> None:
    with pytest.raises(InputError, match="rigid body 'r'"):
        SystemFactor(build_model([rigid("r", 3)]), 0.0, 1.0, np.arange(3))


@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_a_stiffness_that_hides_the_mass_is_not_called_a_missing_support(size: float) -> None:
    """E = 1e25 Pa in dynamics: the units are wrong, no support is missing."""
    part = brick("rock", (size, size, size), (2, 2, 2), Material(1e25, 0.2, 2000.0))
    model = build_model([Body("rock", part)])
    with pytest.raises(InputError, match=r"part 'rock': .* is singular .*; its stiffness hides its mass in round-off") as told:
        SystemFactor(model, 1.0, 1e-6, np.arange(model.n_nodes))
    assert "supports" not in str(told.value)
