"""Small structured parts of every cell type, made with NumPy alone."""

from collections.abc import Callable
from itertools import permutations, product

import numpy as np
import pytest

from fcsim import runtime
from fcsim.errors import MissingDependency
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part

CORNERS = {  # in VTK's order
    2: [(0, 0), (1, 0), (1, 1), (0, 1)],
    3: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}
FACETS = {  # local nodes, oriented as Part asks
    "hexahedron": [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    "tetrahedron": [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)],
    "quadrilateral": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "triangle": [(0, 1), (1, 2), (2, 0)],
}


def kuhn_simplices(d: int) -> list[list[tuple[int, ...]]]:
    """The d! simplices of a cube: paths from the corner 0 to the opposite one along the axes in every order, positively oriented."""
    simplices = []
    for order in permutations(range(d)):
        path = np.vstack([np.zeros(d, int), np.cumsum(np.eye(d, dtype=int)[list(order)], axis=0)])
        if np.linalg.det(path[1:]) < 0:
            path[[1, 2]] = path[[2, 1]]
        simplices.append([tuple(p) for p in path])
    return simplices


def make_grid_part(
    cell_type: str, n: tuple, lengths: tuple, material: Material, distort: float = 0.0, warp: float = 0.0, shuffle: bool = True, **options
) -> Part:
    """A box of n cells an axis, shuffled node numbers and the surfaces x0, x1, y0, y1[, z0, z1].

    distort: random displacement of inner nodes, warp: of all nodes, in cell sizes.
    """
    d, rng = len(n), np.random.default_rng(7)
    index = np.arange(np.prod(np.add(n, 1))).reshape(np.add(n, 1))
    grid = np.stack(np.meshgrid(*[np.arange(k + 1) for k in n], indexing="ij"), axis=-1).reshape(-1, d)
    size = np.divide(lengths, n)
    noise = rng.uniform(-1, 1, grid.shape) * size
    inner = np.all((grid > 0) & (grid < n), axis=1)
    points = grid * size + warp * noise + distort * noise * inner[:, None]

    templates = [CORNERS[d]] if cell_type in ("hexahedron", "quadrilateral") else kuhn_simplices(d)
    cells = np.array([[index[tuple(np.add(origin, c))] for c in cell] for origin in product(*map(range, n)) for cell in templates])
    facets = np.vstack([cells[:, list(local)] for local in FACETS[cell_type]])
    surfaces = {}
    for axis, (side, name) in product(range(d), enumerate("01")):
        on_side = grid[:, axis] == side * n[axis]
        surfaces["xyz"[axis] + name] = facets[on_side[facets].all(axis=1)]

    new = rng.permutation(len(points)) if shuffle else np.arange(len(points))
    shuffled = np.empty_like(points)
    shuffled[new] = points
    return Part("grid", shuffled, new[cells], cell_type, {k: new[f] for k, f in surfaces.items()}, material, **options)


@pytest.fixture(scope="session", autouse=True)
def dolfinx():
    try:
        return runtime.dolfinx()
    except MissingDependency as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def grid_part() -> Callable[..., Part]:
    return make_grid_part
