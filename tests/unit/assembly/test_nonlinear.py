"""Inner forces of nonlinear bodies: derivatives of their energy, their tangents, invariance, and the linear limit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly import elasticity
from fcsim.assembly.nonlinear import _tangent_kernels as kernels
from fcsim.assembly.nonlinear.cells import _operator, _product
from fcsim.assembly.nonlinear.part import Instant, NonlinearPart
from fcsim.assembly.stress import stress_operator
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import ByRegion, Material, Orthotropic, mooney_rivlin, neo_hooke, ogden, saint_venant_kirchhoff
from fcsim.mesh.material.law import LinearLaw
from fcsim.mesh.part import Part

E, NU = 3e6, 0.3
LAWS = {
    "linear": LinearLaw(Material(E, NU, 1000.0)),
    "svk": saint_venant_kirchhoff(E, NU, 1000.0),
    "neo-hooke": neo_hooke(E, NU, 1000.0),
    "mooney-rivlin": mooney_rivlin(4e5, 2e5, 1e8, 1000.0),
    "ogden": ogden([6e5, 2e5], [1.7, -2.0], 1e7, 1000.0),
}
CELLS = [
    ("hexahedron", "Q1"),
    ("hexahedron", "Q1-bbar"),
    ("tetrahedron", "P1"),
    ("quadrilateral", "Q1"),
    ("quadrilateral", "Q1-bbar"),
    ("triangle", "P1"),
    ("hexahedron", "Q2"),
    ("tetrahedron", "P2"),
    ("quadrilateral", "Q2"),
    ("triangle", "P2"),
]
IN_STRESS = [(cell, elements) for cell, elements in CELLS if cell in ("quadrilateral", "triangle") and elements != "Q1-bbar"]


def part_of(grid_part: Any, cell: str, elements: str, material: Any, plane: str = "strain") -> Part:
    n, lengths = ((2, 1, 2), (0.4, 0.2, 0.3)) if cell in ("hexahedron", "tetrahedron") else ((3, 2), (0.4, 0.3))
    return grid_part(cell, n, lengths, material, distort=0.1, elements=elements, plane=plane, thickness=0.1 if len(n) == 2 else 1.0)


def displaced(part: Part, size: float, seed: int = 0) -> np.ndarray:
    return size * 0.1 * np.random.default_rng(seed).uniform(-1, 1, (1, *part.points.shape))


def inner(laws: NonlinearPart, u: np.ndarray, tangent: bool = False) -> Any:
    return laws.inner(u, laws.initial[None], Instant(0.0, 0.0), tangent)


@pytest.mark.parametrize("law", ["neo-hooke", "linear"])
@pytest.mark.parametrize("turning", [False, True])
@pytest.mark.parametrize(("cell", "elements"), CELLS)
def test_force_is_the_derivative_of_energy_and_tangent_that_of_force(
    grid_part: Any, cell: str, elements: str, turning: bool, law: str
) -> None:
    part = part_of(grid_part, cell, elements, LAWS[law])
    laws = NonlinearPart(part, turning)
    u, direction = displaced(part, 0.2), displaced(part, 1.0, seed=1)
    h = 1e-5
    found = inner(laws, u, tangent=True)
    ends = [inner(laws, u + s * h * direction) for s in (1, -1)]
    assert found.admissible.all()
    work = float(np.vdot(found.force, direction))
    assert_allclose((ends[0].energy - ends[1].energy)[0] / (2 * h), work, rtol=1e-6)
    K = laws.graph.matrix(found.blocks[0])
    assert_allclose((ends[0].force - ends[1].force).ravel() / (2 * h), K @ direction.ravel(), atol=1e-6 * abs(K @ direction.ravel()).max())
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()


@pytest.mark.parametrize("law", sorted(LAWS))
@pytest.mark.parametrize("d", [2, 3])
def test_every_law_in_a_body(law: str, d: int) -> None:
    part = brick("b", (0.2, 0.1, 0.1), (2, 1, 1), LAWS[law]) if d == 3 else rectangle("b", (0.2, 0.1), (2, 1), LAWS[law])
    laws = NonlinearPart(part, True)
    u, direction, h = displaced(part, 0.1), displaced(part, 1.0, seed=1), 1e-6
    found, ends = inner(laws, u, tangent=True), [inner(laws, u + s * h * direction) for s in (1, -1)]
    Kd = laws.graph.matrix(found.blocks[0]) @ direction.ravel()
    assert_allclose((ends[0].energy - ends[1].energy)[0] / (2 * h), np.vdot(found.force, direction), rtol=1e-5)
    assert_allclose((ends[0].force - ends[1].force).ravel() / (2 * h), Kd, atol=1e-6 * abs(Kd).max())


@pytest.mark.parametrize("law", ["svk", "neo-hooke", "ogden"])
@pytest.mark.parametrize(("cell", "elements", "plane"), [*((*own, "strain") for own in CELLS), *((*own, "stress") for own in IN_STRESS)])
def test_first_tangent_is_linear_elasticity(grid_part: Any, cell: str, elements: str, plane: str, law: str) -> None:
    """At F = 1 every law is Hooke's with its moduli; of Ogden's mu = 8e5, K = 1e7."""
    nu = (3 * 1e7 - 2 * 8e5) / (2 * (3 * 1e7 + 8e5))
    linear = Material(2 * 8e5 * (1 + nu), nu, 1000.0) if law == "ogden" else Material(E, NU, 1000.0)
    laws = NonlinearPart(part_of(grid_part, cell, elements, LAWS[law], plane), True)
    K = elasticity.stiffness(part_of(grid_part, cell, elements, linear, plane))
    assert abs(laws.graph.matrix(laws.first_tangent) - K).max() < 1e-9 * abs(K).max()


@pytest.mark.parametrize("law", sorted(LAWS))
@pytest.mark.parametrize(("cell", "elements"), CELLS)
def test_rotation_of_any_size_neither_stresses_nor_turns_back(grid_part: Any, cell: str, elements: str, law: str) -> None:
    """Energy is that without the rotation, forces are turned: of a strained body, and of one that is only turned none."""
    part = part_of(grid_part, cell, elements, LAWS[law])
    laws, d = NonlinearPart(part, True), part.dimension
    R = np.linalg.qr(np.random.default_rng(3).normal(size=(d, d)))[0]
    R[:, 0] *= np.sign(np.linalg.det(R))
    turned = (part.points @ R.T - part.points)[None]
    scale = E * abs(part.points).max() ** 2
    assert abs(inner(laws, turned).force).max() < 1e-12 * scale
    u = displaced(part, 0.1)
    at_rest, after = inner(laws, u), inner(laws, turned + u @ R.T)
    assert_allclose(after.energy, at_rest.energy, rtol=1e-10)
    assert_allclose(after.force, at_rest.force @ R.T, atol=1e-9 * abs(at_rest.force).max())
    x = part.points + u[0]
    moment = np.einsum("ni,nj->ij", at_rest.force[0], x)
    assert_allclose(moment, moment.T, atol=1e-12 * scale)  # the inner forces have no moment


def test_kernel_against_numpy() -> None:
    rng = np.random.default_rng(0)
    for d, k in ((2, 4), (3, 8)):
        G, A = rng.normal(size=(3, 5, k, d)), rng.normal(size=(3, 5, 3, 3, 3, 3))
        K = np.zeros((3, k * d, k * d))
        kernels.cell_tangents(G, A, K)
        assert_allclose(K, _product(_operator(G), A), rtol=1e-11, atol=1e-11)
        cells = rng.integers(0, 6, (3, k))
        nodal, twin = np.zeros((6, d)), np.zeros((6, d))
        f = rng.normal(size=(3, k, d))
        kernels.scatter_nodes(f, cells, nodal)
        np.add.at(twin, cells, f)
        assert_allclose(nodal, twin, atol=1e-14)
        place, blocks = rng.integers(0, 7, (3, k, k)), np.zeros((7, d, d))
        kernels.scatter_blocks(K, place, d, blocks)
        twin = np.zeros((7, d, d))
        np.add.at(twin, place, K.reshape(3, k, d, k, d).transpose(0, 1, 3, 2, 4))
        assert_allclose(blocks, twin, atol=1e-12)


def test_mean_volume_does_not_lock() -> None:
    """A bent block of nearly incompressible rubber, nu = 0.4999: the linear limits of F-bar and B-bar have one stiffness."""
    soft = mooney_rivlin(4e5, 1e5, 5e9, 1000.0)
    laws = NonlinearPart(brick("b", (0.2, 0.1, 0.1), (4, 2, 2), soft, elements="Q1-bbar"), True)
    nu = (3 * 5e9 - 2 * 1e6) / (2 * (3 * 5e9 + 1e6))
    linear = brick("b", (0.2, 0.1, 0.1), (4, 2, 2), Material(2e6 * (1 + nu), nu, 1000.0), elements="Q1-bbar")
    K = elasticity.stiffness(linear)
    assert abs(laws.graph.matrix(laws.first_tangent) - K).max() < 1e-8 * abs(K).max()


def test_orthotropic_bar_in_its_part() -> None:
    """Pulled along each axis: strain 1/E_i, contraction nu_ij; K of the part does that work on constant strains."""
    material = Orthotropic((10e9, 1e9, 0.5e9), (0.3, 0.4, 0.02), (0.7e9, 0.1e9, 0.6e9), 500.0)
    part = brick("b", (0.2, 0.1, 0.3), (2, 1, 2), material)
    K, C = elasticity.stiffness(part), material.elasticity
    volume = 0.2 * 0.1 * 0.3
    for i, E_i in enumerate(material.E):
        strain = np.linalg.solve(C, np.eye(6)[i])
        assert_allclose(strain[i], 1 / E_i)
        x = (part.points * strain[:3]).ravel()
        assert_allclose(x @ K @ x, volume * strain[i], rtol=1e-12)
    assert_allclose(np.linalg.solve(C, np.eye(6)[0])[1], -0.3 / 10e9)
    assert_allclose(np.linalg.solve(C, np.eye(6)[2])[0], -0.02 / 0.5e9)
    with pytest.raises(InputError, match="positive energy"):
        Orthotropic((10e9, 1e9, 0.5e9), (4.0, 0.4, 0.02), (0.7e9, 0.1e9, 0.6e9), 500.0)


def test_elements_and_materials_that_do_not_go_together() -> None:
    with pytest.raises(InputError, match=r"expected 'P1' or .* or 'Q1-bbar' for a material that is not linear, got 'Q1-enhanced'"):
        NonlinearPart(brick("b", (1, 1, 1), (1, 1, 1), LAWS["svk"], elements="Q1-enhanced"), True)
    with pytest.raises(InputError, match="material: expected a Material"):
        brick("b", (1, 1, 1), (1, 1, 1), "steel")  # type: ignore[arg-type]


def two_regions(grid_part: Any, materials: dict[str, Any], cell: str = "hexahedron") -> Part:
    n, lengths = ((4, 2, 2), (0.4, 0.2, 0.2)) if cell == "hexahedron" else ((4, 2), (0.4, 0.2))
    part = grid_part(cell, n, lengths, Material(E, NU, 1000.0))
    left = part.points[part.cells].mean(axis=1)[:, 0] < 0.2
    return replace(part, material=ByRegion(materials), regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})


def test_two_linear_materials_in_one_part(grid_part: Any) -> None:
    """A bar of two materials in series, pulled: 1/E of the halves add up; mass of both; stress is the same."""
    part = two_regions(grid_part, {"left": Material(1e9, 0.0, 1000.0), "right": Material(3e9, 0.0, 3000.0)})
    K, M = elasticity.stiffness(part), elasticity.consistent_mass(part)
    assert_allclose(elasticity.lumped_mass(part).sum() / 3, 0.4 * 0.04 * 2000.0)
    assert_allclose(M.sum() / 3, 0.4 * 0.04 * 2000.0)
    X = part.points[:, 0]
    stress = 1e6
    u = np.zeros_like(part.points)
    u[:, 0] = stress * (np.minimum(X, 0.2) / 1e9 + np.maximum(X - 0.2, 0) / 3e9)
    force = (K @ u.ravel()).reshape(-1, 3)
    assert abs(force[(X > 1e-9) & (X < 0.4 - 1e-9)]).max() < 1e-6 * stress
    assert_allclose(force[X > 0.4 - 1e-9].sum(axis=0), [stress * 0.04, 0, 0], atol=1e-6 * stress)
    assert_allclose((stress_operator(part) @ u.ravel()).reshape(-1, 6), np.tile([stress, 0, 0, 0, 0, 0], (16, 1)), atol=1e-4)
    laws = NonlinearPart(part, False)
    assert abs(laws.graph.matrix(laws.first_tangent) - K).max() < 1e-9 * abs(K).max()


def test_law_and_linear_material_in_one_part(grid_part: Any) -> None:
    part = two_regions(grid_part, {"left": Material(E, NU, 1000.0), "right": neo_hooke(E, NU, 1000.0)}, "quadrilateral")
    laws = NonlinearPart(part, False)
    assert laws.finite and laws.turning
    u, direction, h = displaced(part, 0.2), displaced(part, 1.0, seed=1), 1e-6
    found, ends = inner(laws, u, tangent=True), [inner(laws, u + s * h * direction) for s in (1, -1)]
    assert_allclose((ends[0].energy - ends[1].energy)[0] / (2 * h), np.vdot(found.force, direction), rtol=1e-6)
    with pytest.raises(InputError, match="expected regions of the materials' names"):
        replace(part, regions={"left": [0]})
    with pytest.raises(InputError, match=r"expected every cell in one of the regions .*, got cell"):
        replace(part, regions={"left": part.regions["left"], "right": part.regions["right"][1:]})
