"""The tangent with the stresses that the iterate before foresaw: second order away from the law's, and definite after a rotation."""

from typing import Any

import numpy as np
import pytest

from fcsim.assembly.nonlinear.part import Instant, NonlinearPart
from fcsim.mesh.material import Plastic, mooney_rivlin, neo_hooke
from fcsim.mesh.material.energies import neo_hooke_isochoric

LAWS = {
    "neo-hooke": neo_hooke(3e6, 0.3, 1000.0),
    "mooney-rivlin": mooney_rivlin(4e5, 2e5, 1e8, 1000.0),
    "plastic": Plastic(3e6, 0.3, 1000.0, 1e3, kinematic=1e5),
}
CELLS = [("hexahedron", "Q1"), ("hexahedron", "Q1-bbar"), ("tetrahedron", "P2"), ("quadrilateral", "Q2"), ("quadrilateral", "Q1-bbar")]


def matrix(laws: NonlinearPart, u: np.ndarray, earlier: np.ndarray | None = None) -> np.ndarray:
    inner = laws.inner(u[None], laws.initial[None], Instant(0.0, 0.0, earlier=None if earlier is None else earlier[None]), True)
    assert inner.blocks is not None
    K: np.ndarray = laws.graph.matrix(inner.blocks[0]).toarray()
    return K


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("cell", "elements"), CELLS)
def test_it_differs_from_the_law_s_tangent_by_second_order(grid_part: Any, cell: str, elements: str, law: str) -> None:
    n, lengths = ((2, 1, 2), (0.4, 0.2, 0.3)) if cell in ("hexahedron", "tetrahedron") else ((3, 2), (0.4, 0.3))
    part = grid_part(cell, n, lengths, LAWS[law], distort=0.1, elements=elements)
    laws = NonlinearPart(part, True)
    random = np.random.default_rng(3)
    first, step = 4e-3 * random.uniform(-1, 1, (2, *part.points.shape))
    if law == "plastic":  # all points flow at both, and none is at the kink where the law has no derivative
        first = part.points @ np.diag([0.02, -0.01, -0.01][: part.dimension])
        step = 0.1 * step
    apart = []
    for length in (1.0, 0.5):
        end = first + length * step
        K, foreseen = matrix(laws, end), matrix(laws, end, first)
        np.testing.assert_allclose(foreseen, foreseen.T, atol=1e-9 * np.abs(K).max())
        apart.append(np.abs(foreseen - K).max() / np.abs(K).max())
    assert apart[0] > 1e-9
    assert 3.0 < apart[0] / apart[1] < 5.0
    np.testing.assert_allclose(matrix(laws, first, first), matrix(laws, first), rtol=0, atol=1e-12 * np.abs(K).max())


def test_forces_are_the_law_s(grid_part: Any) -> None:
    part = grid_part("hexahedron", (2, 1, 2), (0.4, 0.2, 0.3), LAWS["neo-hooke"], distort=0.1)
    laws = NonlinearPart(part, True)
    u, earlier = 4e-3 * np.random.default_rng(0).uniform(-1, 1, (2, 1, *part.points.shape))
    ours, plain = (laws.inner(u, laws.initial[None], Instant(0.0, 0.0, earlier=one), True) for one in (earlier, None))
    np.testing.assert_array_equal(ours.force, plain.force)
    assert np.abs(ours.blocks - plain.blocks).max() > 1e-6 * np.abs(plain.blocks).max()


def test_a_linear_rotation_of_rubber_leaves_it_positive_definite(grid_part: Any) -> None:
    """Displacements t x X widen a body by t^2 / 2 across: pressures of K t^2, which its shear modulus does not bear."""
    part = grid_part("hexahedron", (2, 2, 4), (0.1, 0.1, 0.2), neo_hooke_isochoric(1e6, 2e9, 1000.0), elements="Q2")
    laws = NonlinearPart(part, True)
    x, y, z = (part.points - part.points.mean(axis=0)).T
    turned = 0.15 * np.stack([-y, x, np.zeros_like(z)], axis=1)
    free = np.repeat(part.points[:, 2] > 1e-9, 3)  # the lower face is held
    least = [np.linalg.eigvalsh(matrix(laws, turned, earlier)[free][:, free])[0] for earlier in (None, np.zeros_like(turned))]
    assert least[0] < 0 < least[1]
