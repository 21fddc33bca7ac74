"""Stiffness, mass and loads of a part against statics, closed-form integrals and a NumPy element."""

import gc
import weakref
from itertools import product

import numpy as np
import pytest

from fcsim.assembly.elasticity import assemble, body_force, consistent_mass, lumped_mass, nodal_volume, pressure, stiffness, traction
from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part

STONE = Material(E=2.2e9, nu=0.2, density=2000.0)
LENGTHS = (0.3, 0.2, 0.1)
KINDS = {
    "hexahedron": ("hexahedron", (3, 2, 3), {}),
    "tetrahedron": ("tetrahedron", (3, 2, 2), {}),
    "quadrilateral, plane strain": ("quadrilateral", (4, 3), {"plane": "strain", "thickness": 0.05}),
    "quadrilateral, plane stress": ("quadrilateral", (4, 3), {"plane": "stress", "thickness": 0.05}),
    "triangle, plane strain": ("triangle", (4, 3), {"plane": "strain", "thickness": 0.05}),
    "triangle, plane stress": ("triangle", (4, 3), {"plane": "stress", "thickness": 0.05}),
}


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


@pytest.fixture
def part(kind, grid_part):
    """A box with distorted cells inside and plane sides."""
    cell_type, n, options = kind
    return grid_part(cell_type, n, LENGTHS[: len(n)], STONE, distort=0.25, **options)


@pytest.fixture
def warped(kind, grid_part):
    """The same with all nodes moved, so that quadrilateral facets are not plane."""
    cell_type, n, options = kind
    return grid_part(cell_type, n, LENGTHS[: len(n)], STONE, warp=0.2, **options)


def volume(part):
    return np.prod(LENGTHS[: part.dimension]) * part.thickness


def rigid_modes(points):
    """Translations and infinitesimal rotations, as columns (d nn, 6 or 3)."""
    d = points.shape[1]
    modes = [np.tile(e, len(points)) for e in np.eye(d)]
    for i, j in ((0, 1), (1, 2), (2, 0))[: 3 if d == 3 else 1]:
        rotation = np.zeros_like(points)
        rotation[:, i], rotation[:, j] = -points[:, j], points[:, i]
        modes.append(rotation.ravel())
    return np.array(modes).T


def hooke_stress(strain, material, plane=None):
    """Solve Hooke's law in its compliance form, eps = ((1 + nu) sigma - nu tr(sigma) I) / E, for the stress (3, 3)."""
    E, nu = material.E, material.nu
    eps = np.zeros((3, 3))
    d = len(strain)
    eps[:d, :d] = strain
    pairs = list(product(range(3), range(3)))
    compliance = np.zeros((9, 9))
    for column, (k, l) in enumerate(pairs):
        unit = np.zeros((3, 3))
        unit[k, l] = 1
        compliance[:, column] = (((1 + nu) * unit - nu * np.trace(unit) * np.eye(3)) / E).ravel()
    if plane == "stress":  # sigma_zz = 0 in place of the equation of eps_zz
        compliance[8] = np.eye(9)[8]
    return np.linalg.solve(compliance, eps.ravel()).reshape(3, 3)


def test_stiffness_is_symmetric_with_rigid_motions_as_only_null_space(warped):
    K = stiffness(warped)
    assert K.shape == (warped.points.size,) * 2
    assert abs(K - K.T).max() == 0
    modes = rigid_modes(warped.points)
    assert abs(K @ modes).max() < 1e-13 * abs(K).max() * abs(modes).max()
    eigenvalues = np.linalg.eigvalsh(K.toarray())
    n_modes = modes.shape[1]
    assert n_modes == {2: 3, 3: 6}[warped.dimension]
    assert np.all(abs(eigenvalues[:n_modes]) < 1e-12 * eigenvalues[-1])
    assert eigenvalues[n_modes] > 1e-6 * eigenvalues[-1]


def test_patch_linear_displacement_needs_only_its_boundary_tractions(part):
    """K x = the nodal forces of sigma n, so inner nodes are in equilibrium: the patch test, on distorted cells."""
    d = part.dimension
    gradient = np.random.default_rng(1).normal(size=(d, d)) * 1e-3
    stress = hooke_stress((gradient + gradient.T) / 2, part.material, part.plane if d == 2 else None)[:d, :d]
    forces = sum(traction(part, "xyz"[axis] + name, sign * stress[:, axis]) for axis in range(d) for name, sign in (("0", -1), ("1", 1)))
    x = (part.points @ gradient.T + 0.01).ravel()
    assert np.allclose(stiffness(part) @ x, forces, rtol=0, atol=1e-11 * abs(forces).max())


def test_mass_integrates_rigid_velocities_exactly(part):
    """Translations and rotations lie in the space: v^T M v is the mass and the moment of inertia of the box about the origin."""
    d, m = part.dimension, part.material.density * volume(part)
    L = np.array(LENGTHS[:d])
    modes = rigid_modes(part.points)
    inertia = [m * (L[i] ** 2 + L[j] ** 2) / 3 for i, j in ((0, 1), (1, 2), (2, 0))[: 3 if d == 3 else 1]]
    M = consistent_mass(part)
    assert abs(M - M.T).max() == 0
    assert np.allclose(np.diag(modes.T @ (M @ modes)), [m] * d + inertia, rtol=1e-12)
    assert np.linalg.eigvalsh(M.toarray())[0] > 0
    assert np.allclose(lumped_mass(part), M.sum(axis=1), rtol=1e-12)
    assert np.all(lumped_mass(part) > 0)
    assert np.isclose(lumped_mass(part).sum(), d * m, rtol=1e-12)


def test_mass_of_warped_cells_keeps_row_sums_and_total(warped):
    """The surface of the box is not plane: its volume by the divergence theorem, (1/d) of the integral of x . n."""
    d = warped.dimension
    by_surface = sum(-pressure(warped, name, 1.0) @ warped.points.ravel() for name in warped.surfaces) / d
    assert np.isclose(nodal_volume(warped).sum(), by_surface, rtol=1e-12)
    assert np.allclose(lumped_mass(warped), consistent_mass(warped).sum(axis=1), rtol=1e-12)


def test_mass_of_massless_material_is_zero(grid_part):
    part = grid_part("triangle", (2, 2), (1.0, 1.0), Material(1.0, 0.3, 0.0))
    assert lumped_mass(part).max() == 0 and abs(consistent_mass(part)).max() == 0 and nodal_volume(part).min() > 0


def test_body_force_has_weight_and_moment(part):
    d = part.dimension
    density = np.array([3.0, -5.0, 7.0])[:d]
    nodal = body_force(part, density).reshape(-1, d)
    centroid = np.array(LENGTHS[:d]) / 2
    assert np.allclose(nodal.sum(axis=0), density * volume(part), rtol=1e-12)
    assert np.allclose(part.points.T @ nodal, np.outer(centroid, density) * volume(part), rtol=1e-12)


def test_traction_on_grid_of_rectangles_is_shared_equally(grid_part):
    """Each of 3 x 2 equal rectangles gives a quarter of its force to each of its nodes: 1/4, 1/2 or 1 rectangle a node."""
    part = grid_part("hexahedron", (3, 2, 2), LENGTHS, STONE)
    t = np.array([2.0, -1.0, 4.0])
    nodal = traction(part, "z1", t).reshape(-1, 3)
    area = (LENGTHS[0] / 3) * (LENGTHS[1] / 2)
    on_edge = sum(np.isclose(part.points[:, i], 0) | np.isclose(part.points[:, i], LENGTHS[i]) for i in (0, 1))
    expected = np.where(np.isclose(part.points[:, 2], LENGTHS[2]), area * 0.5**on_edge, 0.0)
    assert np.allclose(nodal, expected[:, None] * t, rtol=0, atol=1e-14)


def test_pressure_is_traction_against_the_outward_normal(part):
    d = part.dimension
    for axis, (name, sign) in product(range(d), (("0", -1.0), ("1", 1.0))):
        surface = "xyz"[axis] + name
        normal = sign * np.eye(d)[axis]
        assert np.allclose(pressure(part, surface, 3.0), traction(part, surface, -3.0 * normal), rtol=0, atol=1e-14)
        area = volume(part) / LENGTHS[axis]
        assert np.allclose(pressure(part, surface, 3.0).reshape(-1, d).sum(axis=0), -3.0 * area * normal, rtol=0, atol=1e-14)


def test_uniform_pressure_all_round_is_self_balanced(warped):
    nodal = sum(pressure(warped, name, 2.0) for name in warped.surfaces)
    assert np.allclose(rigid_modes(warped.points).T @ nodal, 0, atol=1e-15)


def numpy_element_stiffness(points, cell_type, material, plane, thickness):
    """One cell by hand: B^T C B at 2 x 2 (x 2) Gauss points (1 on simplices), C from Hooke's law in compliance form."""
    d = points.shape[1]
    if cell_type in ("tetrahedron", "triangle"):
        rules = [(1 / (6 if d == 3 else 2), np.vstack([-np.ones(d), np.eye(d)]))]
    else:
        square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        nodes = square if d == 2 else np.array([(x, y, z) for z in (-1, 1) for x, y in square])
        rules = []
        for gauss in product((-(3**-0.5), 3**-0.5), repeat=d):
            factors = (1 + nodes * gauss) / 2
            gradients = np.array([[nodes[a, i] / 2 * np.prod(np.delete(factors[a], i)) for i in range(d)] for a in range(2**d)])
            rules.append((1.0, gradients))
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)] if d == 3 else [(0, 0), (1, 1), (0, 1)]
    C = np.zeros((len(pairs),) * 2)
    for column, (i, j) in enumerate(pairs):
        unit = np.zeros((d, d))
        unit[i, j] = unit[j, i] = 1.0 if i == j else 0.5
        stress = hooke_stress(unit, material, plane if d == 2 else None)
        C[:, column] = [stress[p] for p in pairs]
    K = np.zeros((points.size,) * 2)
    for weight, reference in rules:
        jacobian = points.T @ reference
        gradients = reference @ np.linalg.inv(jacobian)
        B = np.zeros((len(pairs), points.size))
        for a, (row, (i, j)) in product(range(len(points)), enumerate(pairs)):
            B[row, d * a + i] = gradients[a, j]
            B[row, d * a + j] = gradients[a, i]
        K += weight * thickness * np.linalg.det(jacobian) * B.T @ C @ B
    return K


def test_stiffness_of_one_distorted_cell_equals_numpy_element(kind):
    """Also the order of nodes: the cell's nodes are numbered at random."""
    cell_type, _, options = kind
    rng = np.random.default_rng(3)
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)])
    regular = {
        "quadrilateral": square,
        "triangle": square[[0, 1, 3]],
        "hexahedron": np.array([(x, y, z) for z in (0, 1) for x, y in square]),
        "tetrahedron": np.vstack([np.zeros(3), np.eye(3)]),
    }[cell_type]
    points = regular * 0.1 + rng.uniform(-0.02, 0.02, regular.shape)
    number = rng.permutation(len(points))
    shuffled = np.empty_like(points)
    shuffled[number] = points
    part = Part("cell", shuffled, number[None], cell_type, {}, STONE, **options)
    expected = numpy_element_stiffness(points, cell_type, STONE, part.plane, part.thickness)
    d = part.dimension
    dof = (d * number[:, None] + np.arange(d)).ravel()
    K = stiffness(part).toarray()[np.ix_(dof, dof)]
    assert np.allclose(K, expected, rtol=0, atol=1e-13 * abs(expected).max())


def test_part_is_assembled_once_and_forgotten_with_it(grid_part):
    part = grid_part("quadrilateral", (2, 2), (1.0, 1.0), STONE)
    operators = assemble(part)
    assert assemble(part) is operators
    assert operators.stiffness is stiffness(part) and operators.lumped_mass is lumped_mass(part)
    with pytest.raises(ValueError, match="read-only"):
        operators.lumped_mass[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        operators.stiffness.data[0] = 1.0
    part_is_alive, operators_are_alive = weakref.ref(part), weakref.ref(operators)
    del part, operators
    gc.collect()
    assert part_is_alive() is None and operators_are_alive() is None


@pytest.fixture
def empty_form_cache(dolfinx, tmp_path, monkeypatch):
    monkeypatch.setitem(dolfinx.jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cache_dir", (tmp_path, ""))
    return tmp_path


def test_compiled_forms_are_shared_between_materials(grid_part, empty_form_cache):
    assemble(grid_part("triangle", (2, 2), (1.0, 1.0), STONE))
    compiled = sorted(empty_form_cache.glob("*.c"))
    assert compiled
    assemble(grid_part("triangle", (3, 1), (2.0, 1.0), Material(7e10, 0.33, 2700.0), plane="stress", thickness=0.1))
    assert sorted(empty_form_cache.glob("*.c")) == compiled


def test_missing_compiler_is_named(grid_part, empty_form_cache, monkeypatch):
    monkeypatch.setenv("CC", str(empty_form_cache / "no-such-compiler"))
    with pytest.raises(MissingDependency, match=r"C compiler.*no-such-compiler"):
        stiffness(grid_part("triangle", (1, 1), (1.0, 1.0), STONE))


def test_node_outside_all_cells_is_refused():
    with pytest.raises(InputError, match=r"'loose'.*1 of 4 unused: nodes 3"):
        Part("loose", [[0, 0], [1, 0], [0, 1], [5, 5]], [[0, 1, 2]], "triangle", {}, STONE)


def test_bad_loads_are_refused(grid_part):
    part = grid_part("hexahedron", (2, 1, 1), LENGTHS, STONE)
    with pytest.raises(InputError, match=r"surface 'top'.*'x0', 'x1', 'y0'"):
        traction(part, "top", [0, 0, 1])
    with pytest.raises(InputError, match=r"traction .*3 finite numbers"):
        traction(part, "x0", [0, 1])
    with pytest.raises(InputError, match=r"body_force .*3 finite numbers"):
        body_force(part, [0, 0, np.nan])
    with pytest.raises(InputError, match=r"finite pressure"):
        pressure(part, "x0", np.inf)
    between = part.cells[0][np.isin(part.cells[0], part.cells[1])]  # the facet that the two cells share
    inside = Part("inside", part.points, part.cells, part.cell_type, {"between": [between]}, STONE)
    with pytest.raises(InputError, match=r"'between': expected facets on the boundary .* got 1 others"):
        pressure(inside, "between", 1.0)


def test_surface_without_facets_and_facets_listed_twice(grid_part):
    part = grid_part("tetrahedron", (2, 1, 1), LENGTHS, STONE)
    twice = np.vstack([part.surfaces["x0"], part.surfaces["x0"]])
    other = Part("other", part.points, part.cells, part.cell_type, {"empty": np.empty((0, 3)), "twice": twice}, STONE)
    assert np.array_equal(pressure(other, "twice", 1.0), pressure(part, "x0", 1.0))
    assert np.array_equal(pressure(other, "empty", 1.0), np.zeros(part.points.size))
