"""Stress at cell centres against Hooke's law, dolfinx's own evaluation and the invariants of von Mises."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.assembly.stress import stress_operator, von_mises
from fcsim.errors import InputError
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part
from fcsim.mesh.quality import cell_volumes

STEEL = Material(E=2.1e11, nu=0.3, density=7850.0)
GRIDS = {"hexahedron": (3, 2, 2), "tetrahedron": (2, 2, 2), "quadrilateral": (3, 3), "triangle": (3, 3)}


@pytest.mark.parametrize("cell_type", ["hexahedron", "tetrahedron"])
def test_linear_displacement_gives_hooke_stress(cell_type, grid_part):
    """Uniform strain on warped cells; Hooke's law read backwards: E eps = (1 + nu) sigma - nu tr(sigma) I."""
    part = grid_part(cell_type, GRIDS[cell_type], (1.0, 2.0, 1.5), STEEL, warp=0.2)
    gradient = np.random.default_rng(2).normal(size=(3, 3)) * 1e-3
    stress = (stress_operator(part) @ (part.points @ gradient.T + 0.3).ravel()).reshape(-1, 6)
    sigma = stress[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 3, 3)
    trace = np.trace(sigma, axis1=1, axis2=2)[:, None, None]
    strain = ((1 + STEEL.nu) * sigma - STEEL.nu * trace * np.eye(3)) / STEEL.E
    assert len(stress) == len(part.cells)
    assert np.allclose(strain, (gradient + gradient.T) / 2, rtol=0, atol=1e-15)


@pytest.mark.parametrize("cell_type", ["quadrilateral", "triangle"])
def test_plane_strain_and_plane_stress(cell_type, grid_part):
    exx, eyy, gxy = 2e-3, -1e-3, 3e-3
    E, nu = STEEL.E, STEEL.nu

    def stress(plane):
        part = grid_part(cell_type, GRIDS[cell_type], (1.0, 2.0), STEEL, warp=0.2, plane=plane, thickness=0.1)
        x, y = part.points.T
        return (stress_operator(part) @ np.column_stack([exx * x + gxy * y, eyy * y]).ravel()).reshape(-1, 6)

    held, free = stress("strain"), stress("stress")
    scale = 1e-13 * E * exx
    for sxx, syy, szz, sxy, syz, szx in (*held, *free):
        assert (sxx - nu * (syy + szz)) / E == pytest.approx(exx, rel=1e-12)
        assert (syy - nu * (sxx + szz)) / E == pytest.approx(eyy, rel=1e-12)
        assert sxy == pytest.approx(E / (2 * (1 + nu)) * gxy, rel=1e-12)
        assert syz == szx == 0
    assert np.allclose(held[:, 2], nu * (held[:, 0] + held[:, 1]), rtol=1e-12, atol=scale)
    assert np.all(free[:, 2] == 0)


@pytest.mark.parametrize("cell_type", GRIDS)
def test_rigid_motion_is_free_of_stress(cell_type, grid_part):
    n = GRIDS[cell_type]
    part = grid_part(cell_type, n, (1.0,) * len(n), STEEL, warp=0.2)
    spin = np.random.default_rng(4).normal(size=(len(n), len(n)))
    motion = part.points @ (spin - spin.T).T + 5.0
    assert abs(stress_operator(part) @ motion.ravel()).max() < 1e-12 * STEEL.E * abs(motion).max()


@pytest.mark.parametrize("cell_type", GRIDS)
def test_equals_dolfinx_expression_at_the_centre(cell_type, dolfinx):
    """A mesh made by dolfinx and read into a Part; the stress of a random displacement evaluated by both."""
    import basix
    import ufl
    from mpi4py import MPI

    n = GRIDS[cell_type]
    d = len(n)
    create = dolfinx.mesh.create_unit_cube if d == 3 else dolfinx.mesh.create_unit_square
    kind = dolfinx.mesh.to_type(cell_type)
    mesh = create(MPI.COMM_SELF, *n, kind)
    rng = np.random.default_rng(5)
    mesh.geometry.x[:, :d] += rng.uniform(-0.05, 0.05, (len(mesh.geometry.x), d))
    cells = np.arange(mesh.topology.index_map(d).size_local, dtype=np.int32)
    vertices = dolfinx.mesh.entities_to_geometry(mesh, d, cells)
    vtk = np.empty_like(vertices)
    vtk[:, np.argsort(dolfinx.cpp.io.perm_vtk(kind, vertices.shape[1]))] = vertices
    inverted = cell_volumes(mesh.geometry.x[:, :d], vtk, cell_type) < 0  # dolfinx does not mind
    vtk[inverted] = vtk[inverted, ::-1]
    part = Part("dolfinx", mesh.geometry.x[:, :d], vtk, cell_type, {}, STEEL)

    V = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (d,)))
    displacement = rng.normal(size=(len(part.points), d))
    u = dolfinx.fem.Function(V)
    u.x.array.reshape(-1, d)[V.dofmap.list] = displacement[vertices]
    lam = STEEL.E * STEEL.nu / ((1 + STEEL.nu) * (1 - 2 * STEEL.nu))
    eps = ufl.sym(ufl.grad(u))
    sigma = lam * ufl.tr(eps) * ufl.Identity(d) + STEEL.E / (1 + STEEL.nu) * eps
    reference = basix.geometry(getattr(basix.CellType, cell_type))
    values = dolfinx.fem.Expression(sigma, reference.mean(axis=0)[None]).eval(mesh, cells).reshape(-1, d, d)

    stress = (stress_operator(part) @ displacement.ravel()).reshape(-1, 6)
    picked = [(0, 0, 0), (1, 1, 1), (3, 0, 1)] + ([(2, 2, 2), (4, 1, 2), (5, 2, 0)] if d == 3 else [])
    for component, i, j in picked:
        assert np.allclose(stress[:, component], values[:, i, j], rtol=0, atol=1e-13 * abs(values).max())


def test_operator_is_made_once_and_read_only(grid_part):
    part = grid_part("triangle", (2, 2), (1.0, 1.0), STEEL)
    assert stress_operator(part) is stress_operator(part)
    with pytest.raises(ValueError, match="read-only"):
        stress_operator(part).data[0] = 0.0


def test_von_mises_of_elementary_states():
    """Uniaxial stress s gives |s|, pure shear t gives sqrt(3) t, hydrostatic stress nothing."""
    assert np.allclose(von_mises(-7.0 * np.eye(6)[:3]), 7.0)
    assert np.allclose(von_mises(2.0 * np.eye(6)[3:]), 2.0 * np.sqrt(3))
    assert von_mises([5.0, 5.0, 5.0, 0.0, 0.0, 0.0]) == 0.0


def test_von_mises_is_invariant_under_rotation_and_pressure():
    rng = np.random.default_rng(6)
    symmetric = rng.normal(size=(20, 3, 3))
    symmetric += symmetric.transpose(0, 2, 1)
    Q = Rotation.random(20, rng=rng).as_matrix()
    rotated = Q @ symmetric @ Q.transpose(0, 2, 1) + 3.0 * np.eye(3)
    voigt = [(0, 1, 2, 0, 1, 2), (0, 1, 2, 1, 2, 0)]
    assert np.allclose(von_mises(rotated[:, *voigt]), von_mises(symmetric[:, *voigt]), rtol=1e-12)
    principal = np.linalg.eigvalsh(symmetric)
    differences = ((principal - np.roll(principal, 1, axis=1)) ** 2).sum(axis=1)
    assert np.allclose(von_mises(symmetric[:, *voigt]), np.sqrt(differences / 2), rtol=1e-12)


def test_von_mises_refuses_other_layouts():
    with pytest.raises(InputError, match=r"xx, yy, zz, xy, yz, zx.*\(4, 3\)"):
        von_mises(np.zeros((4, 3)))
