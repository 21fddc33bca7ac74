"""Elements of first order beside dolfinx's and a condensation written out; what is refused; bodies that turn."""

from dataclasses import replace

import numpy as np
import pytest

from fcsim.assembly import build_model, elements
from fcsim.assembly.elasticity import assemble, elasticity_matrix, stiffness
from fcsim.assembly.stress import stress_at, stress_operator
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body

STEEL = Material(E=2e11, nu=0.3, density=7800.0)
KINDS = [
    ("hexahedron", (2, 2, 2), {}),
    ("quadrilateral", (3, 2), {"plane": "strain", "thickness": 0.2}),
    ("quadrilateral", (3, 2), {"plane": "stress", "thickness": 0.2}),
]


@pytest.mark.parametrize(("cell_type", "n", "options"), KINDS)
def test_q1_without_modes_is_that_of_dolfinx(grid_part, cell_type, n, options):
    part = grid_part(cell_type, n, (0.3, 0.2, 0.1)[: len(n)], STEEL, warp=0.2, **options)
    by_dolfinx = stiffness(part)
    here = elements.stiffness(part, elasticity_matrix(part))
    assert abs(here - by_dolfinx).max() < 1e-12 * abs(by_dolfinx).max()


@pytest.mark.parametrize(("cell_type", "n", "options"), KINDS)
def test_enhanced_stiffness_is_the_condensation_of_its_modes(grid_part, cell_type, n, options):
    """K_uu - K_us K_ss^-1 K_su of one warped cell, the modes' strain by their formula, in loops."""
    part = grid_part(cell_type, (1,) * len(n), (0.3, 0.2, 0.1)[: len(n)], STEEL, warp=0.2, elements="Q1-enhanced", **options)
    d, cell, C = part.dimension, CELL_TYPES[cell_type], elasticity_matrix(part)
    corners = part.points[part.cells[0]]
    J0 = corners.T @ cell.gradient(np.zeros((1, d)))[0]
    K = 0.0
    for r in np.array(list(np.ndindex((2,) * d))) * 2 / np.sqrt(3) - 1 / np.sqrt(3):
        reference = cell.gradient(r[None])[0]
        J = corners.T @ reference
        tensors = []
        for gradient in reference @ np.linalg.inv(J):
            tensors += [np.outer(axis, gradient) for axis in np.eye(d)]
        ratio = np.linalg.det(J0) / np.linalg.det(J)
        for a in range(d):
            tensors += [ratio * r[a] * np.outer(axis, np.linalg.inv(J0)[a]) for axis in np.eye(d)]
        if d == 3:
            tensors += [ratio * r[a] * r[b] * np.eye(3) for a, b in ((0, 1), (1, 2), (0, 2))]
        B = []
        for tensor in tensors:
            full = np.zeros((3, 3))
            full[:d, :d] = tensor + tensor.T
            B.append([full[0, 0] / 2, full[1, 1] / 2, full[2, 2] / 2, full[0, 1], full[1, 2], full[2, 0]])
        B = np.array(B).T
        K = K + part.thickness * np.linalg.det(J) * B.T @ C @ B
    nu = cell.size * d
    condensed = K[:nu, :nu] - K[:nu, nu:] @ np.linalg.solve(K[nu:, nu:], K[nu:, :nu])
    dofs = (d * part.cells[0][:, None] + np.arange(d)).ravel()
    assert np.allclose(stiffness(part).toarray()[np.ix_(dofs, dofs)], condensed, rtol=0, atol=1e-12 * np.abs(condensed).max())


@pytest.mark.parametrize("kind", ["Q1-enhanced", "Q1-bbar"])
def test_cells_some_at_a_time_are_all_cells(grid_part, kind, monkeypatch):
    part = grid_part("hexahedron", (3, 2, 2), (0.3, 0.2, 0.1), STEEL, warp=0.1, elements=kind)
    K, S = stiffness(part), stress_operator(part)
    monkeypatch.setattr(elements, "CELLS_AT_ONCE", 5)
    assert abs(elements.stiffness(part, elasticity_matrix(part)) - K).max() < 1e-13 * abs(K).max()
    assert abs(stress_at(part, np.zeros((1, 3))) - S).max() <= 1e-13 * abs(S).max()


@pytest.mark.parametrize("kind", ["Q1-enhanced", "Q1-bbar"])
@pytest.mark.parametrize(("cell_type", "n"), [("hexahedron", (2, 1, 2)), ("quadrilateral", (2, 2))])
def test_units_axes_and_place_do_not_matter(grid_part, kind, cell_type, n):
    """A mesh in mm, one turned by 40 degrees, one far away, one of cells 1 : 1e4: K / E scales with the length (3D), turns and stays."""
    d = len(n)
    part = grid_part(cell_type, n, (0.3, 0.2, 0.1)[:d], STEEL, warp=0.2, elements=kind)
    K = stiffness(part).toarray()
    in_mm = replace(part, points=1e3 * part.points, material=replace(STEEL, E=STEEL.E * 1e-6))
    assert np.allclose(stiffness(in_mm).toarray(), K * (1e-3 if d == 3 else 1e-6), rtol=0, atol=1e-14 * np.abs(K).max())
    far = replace(part, points=part.points + 1e4)
    assert np.allclose(stiffness(far).toarray(), K, rtol=0, atol=1e-8 * np.abs(K).max())
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.eye(d)
    R[:2, :2] = [[c, -s], [s, c]]
    T = np.kron(np.eye(len(part.points)), R)
    assert np.allclose(stiffness(replace(part, points=part.points @ R.T)).toarray(), T @ K @ T.T, rtol=0, atol=1e-12 * np.abs(K).max())
    stretched = replace(part, points=part.points * ([1e4, 1.0, 1.0][:d]))
    values = np.linalg.eigvalsh(stiffness(stretched).toarray())
    assert values[0] > -1e-12 * values[-1]


def test_mass_and_loads_are_those_of_q1():
    q1 = brick("b", (1.0, 0.5, 0.5), (2, 2, 2), STEEL)
    enhanced = replace(q1, elements="Q1-enhanced")
    assert abs(assemble(enhanced).consistent_mass - assemble(q1).consistent_mass).max() == 0
    assert np.array_equal(assemble(enhanced).nodal_volume, assemble(q1).nodal_volume)


@pytest.mark.parametrize("kind", ["Q1-enhanced", "Q1-bbar"])
def test_a_turned_body_has_no_stress(kind):
    """Any rotation of a turning body: no force, no energy beside that of one percent of strain."""
    body = Body("b", brick("b", (1.0, 0.2, 0.2), (4, 2, 2), STEEL, elements=kind), kinematics="turning")
    model = build_model([body])
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6)
    cross = np.cross(np.eye(3), axis)
    R = np.eye(3) + np.sin(2.0) * cross + (1 - np.cos(2.0)) * cross @ cross
    x = (body.points @ R.T - body.points).ravel()
    elastic = model.elastic
    turned, strained = elastic.at(x), elastic.at((0.01 * body.points).ravel())
    assert elastic.energy(turned) < 1e-20 * elastic.energy(strained)
    assert np.abs(elastic.force(turned, turned, 0.5)).max() < 1e-10 * np.abs(elastic.force(strained, strained, 0.5)).max()


@pytest.mark.parametrize("wrong", ["P1-enhanced", "P1-bbar", "Q1-enhanced", "Q1", "", 3])
def test_simplices_have_nothing_to_enhance(wrong):
    with pytest.raises(InputError, match=r"Part 't', elements: expected 'P1' or 'P2' for tetrahedron cells, got .*strain is constant"):
        brick("t", (1.0, 1.0, 1.0), (1, 1, 1), STEEL, "tetrahedron", elements=wrong)


def test_what_is_not_there_is_refused_by_name():
    with pytest.raises(InputError, match="'Q1' or 'Q1-enhanced' or 'Q1-bbar' or 'Q2' for hexahedron cells, got 'q1-enhanced'"):
        brick("b", (1.0, 1.0, 1.0), (1, 1, 1), STEEL, elements="q1-enhanced")
    with pytest.raises(InputError, match="plane stress, which has no volumetric locking, got 'Q1-bbar'"):
        rectangle("r", (1.0, 1.0), (1, 1), STEEL, plane="stress", elements="Q1-bbar")
    part = brick("b", (1.0, 1.0, 1.0), (2, 1, 1), STEEL, elements="Q1-enhanced")
    with pytest.raises(InputError, match=r"Part 'b': expected elements with a scaled Jacobian .* 2 of them inverted: elements 0, 1;"):
        replace(part, points=part.points * [1, 1, -1])
    for points in ([0.0, 0.0, 0.0], [[0.0, 0.0]], [[0.0, 0.0, 1.1]], [[np.nan, 0.0, 0.0]]):
        with pytest.raises(InputError, match="stress_at on Part 'b': expected"):
            stress_at(part, points)
