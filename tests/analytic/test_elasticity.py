"""Elasticity against closed-form solutions: manufactured solution, cantilever, thick cylinder, bar under its own weight."""

from itertools import permutations, product

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from fcsim import runtime
from fcsim.assembly.elasticity import body_force, consistent_mass, pressure, stiffness, traction
from fcsim.assembly.stress import stress_operator, von_mises
from fcsim.errors import MissingDependency
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part


@pytest.fixture(scope="module", autouse=True)
def dolfinx():
    try:
        return runtime.dolfinx()
    except MissingDependency as error:
        pytest.skip(str(error))


def grid(cell_type, n, lengths, material, move=lambda points: points, **options):
    """A box of n cells an axis with the surfaces x0, x1, ... (facets as node sets), its points moved by `move`."""
    d = len(n)
    index = np.arange(np.prod(np.add(n, 1))).reshape(np.add(n, 1))
    position = np.stack(np.meshgrid(*[np.arange(k + 1) for k in n], indexing="ij"), axis=-1).reshape(-1, d)
    origins = np.array(list(product(*map(range, n))))
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    if cell_type in ("quadrilateral", "hexahedron"):
        shapes = [square if d == 2 else [(*c, z) for z in (0, 1) for c in square]]
    else:  # the d! paths along the axes from corner to opposite corner, odd ones with two corners exchanged
        shapes = []
        for path in (np.eye(d, dtype=int)[list(p)] for p in permutations(range(d))):
            corners = np.vstack([np.zeros(d, int), np.cumsum(path, axis=0)])
            shapes.append(corners if np.linalg.det(path) > 0 else corners[[*range(d - 1), d, d - 1]])
    cells = np.vstack([np.stack([index[tuple((origins + c).T)] for c in shape], axis=1) for shape in shapes])
    surfaces = {}
    for axis, side in product(range(d), (0, 1)):
        on_side = position[cells][:, :, axis] == side * n[axis]
        touching = on_side.sum(axis=1) == CELL_TYPES[cell_type].facet_size
        surfaces["xyz"[axis] + str(side)] = cells[touching][on_side[touching]].reshape(-1, CELL_TYPES[cell_type].facet_size)
    return Part("grid", move(position * np.divide(lengths, n)), cells, cell_type, surfaces, material, **options)


def solve(part, forces, fixed, values=0.0):
    """Solve K x = forces with the dofs of the mask `fixed` (nn, d) held at `values`; return x (nn, d)."""
    K, held = stiffness(part), fixed.ravel()
    x = np.broadcast_to(values, fixed.shape).ravel() * held
    x[~held] = spsolve(K[~held][:, ~held].tocsc(), (forces - K @ x)[~held])
    return x.reshape(fixed.shape)


def quadrature(cell_type):
    """Shape functions (q, k), reference gradients (q, k, d) and weights (q,): 3 Gauss points an axis, or degree 3 on simplices."""
    if cell_type in ("quadrilateral", "hexahedron"):
        d = 2 if cell_type == "quadrilateral" else 3
        square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        nodes = np.array(square if d == 2 else [(*c, z) for z in (-1, 1) for c in square])
        x, w = np.polynomial.legendre.leggauss(3)
        points = np.array(list(product(x, repeat=d)))
        factors = (1 + nodes * points[:, None]) / 2
        gradients = np.stack([nodes[:, i] / 2 * np.delete(factors, i, axis=2).prod(axis=2) for i in range(d)], axis=2)
        return factors.prod(axis=2), gradients, np.array(list(product(w, repeat=d))).prod(axis=1)
    d = 2 if cell_type == "triangle" else 3
    centre, near = {2: (-27 / 48, 25 / 48), 3: (-4 / 5, 9 / 20)}[d]  # Stroud's rule: the centre and d + 1 points near the corners
    peak = {2: 3 / 5, 3: 1 / 2}[d]
    corners = np.full((d + 1, d + 1), (1 - peak) / d) + np.eye(d + 1) * (peak - (1 - peak) / d)
    shape = np.vstack([np.full(d + 1, 1 / (d + 1)), corners])
    gradients = np.broadcast_to(np.vstack([-np.ones(d), np.eye(d)]), (len(shape), d + 1, d))
    return shape, gradients, np.array([centre] + [near] * (d + 1)) / {2: 2, 3: 6}[d]


def manufactured(points):
    """u_i = sin(pi x_1 + i) cos(2 x_2) exp(x_3 / 2) (last factor in 3D): value (..., d), gradient (..., d, d), Hessian (..., d, d, d)."""
    d = points.shape[-1]
    i = np.arange(d)
    x = points[..., None, :]
    one = [np.sin(np.pi * x[..., 0] + i), np.pi * np.cos(np.pi * x[..., 0] + i), -(np.pi**2) * np.sin(np.pi * x[..., 0] + i)]
    two = [np.cos(2 * x[..., 1]) + 0 * i, -2 * np.sin(2 * x[..., 1]) + 0 * i, -4 * np.cos(2 * x[..., 1]) + 0 * i]
    three = [np.exp(x[..., 2] / 2) * 0.5**k + 0 * i for k in range(3)] if d == 3 else None

    def derivative(*axes):
        orders = [axes.count(a) for a in range(d)]
        value = one[orders[0]] * two[orders[1]]
        return value * three[orders[2]] if d == 3 else value

    gradient = np.stack([derivative(j) for j in range(d)], axis=-1)
    hessian = np.stack([np.stack([derivative(j, k) for k in range(d)], axis=-1) for j in range(d)], axis=-2)
    return derivative(), gradient, hessian


def errors(part, x):
    """L2 norm of u_h - u and of its gradient, integrated here with NumPy."""
    shape, reference, weights = quadrature(part.cell_type)
    corners = part.points[part.cells]
    jacobian = np.einsum("cai,qaj->cqij", corners, reference)
    gradients = reference @ np.linalg.inv(jacobian)
    dV = weights * abs(np.linalg.det(jacobian))
    value, gradient, _ = manufactured(np.einsum("qa,cai->cqi", shape, corners))
    e = np.einsum("qa,cai->cqi", shape, x[part.cells]) - value
    de = np.einsum("cqaj,cai->cqij", gradients, x[part.cells]) - gradient
    return np.sqrt((dV[..., None] * e**2).sum()), np.sqrt((dV[..., None, None] * de**2).sum())


@pytest.mark.parametrize(
    ("cell_type", "plane", "sizes"),
    [
        ("hexahedron", "strain", (3, 6, 12)),
        ("tetrahedron", "strain", (3, 6, 12)),
        ("quadrilateral", "strain", (8, 16, 32)),
        ("triangle", "stress", (8, 16, 32)),
    ],
)
def test_manufactured_solution_converges_with_orders_2_and_1(cell_type, plane, sizes):
    """-div sigma(u) = f on a curved grid with u given on the boundary; the load is the mass matrix times nodal values of f / density."""
    E, nu = 3.0, 0.3
    mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu)) if plane == "strain" else E * nu / (1 - nu**2)
    d = 3 if cell_type in ("hexahedron", "tetrahedron") else 2

    def move(points):  # smooth, so that halving the cells halves them everywhere
        return points + 0.05 * np.sin(np.pi * points) * np.roll(np.cos(2 * points), 1, axis=1)

    measured = []
    for n in sizes:
        part = grid(cell_type, (n,) * d, (1.0,) * d, Material(E, nu, 2.0), move, plane=plane, thickness=0.5 if d == 2 else 1.0)
        u, _, hessian = manufactured(part.points)
        divergence = (lam + mu) * np.einsum("...jji->...i", hessian) + mu * np.einsum("...ijj->...i", hessian)
        forces = consistent_mass(part) @ (-divergence / part.material.density).ravel()
        boundary = np.zeros(u.shape, dtype=bool)
        for facets in part.surfaces.values():
            boundary[facets.ravel()] = True
        measured.append(errors(part, solve(part, forces, boundary, u)))
    orders = np.log2(np.divide(measured[:-1], measured[1:]))
    # coarse, fine pair: the observed order comes from above or below by terms of the next order in h
    assert np.allclose(orders[-1], [2, 1], atol=0.1), f"orders {orders.tolist()} for errors {measured}"
    assert np.allclose(orders[0], [2, 1], atol=0.3), f"orders {orders.tolist()} for errors {measured}"


def test_cantilever_under_end_load():
    """Timoshenko beam, nu = 0: P L^3 / (3 E I) + P L / (5/6 G A).

    Bilinear cells of length a cannot curve: pure bending costs the parasitic shear energy G (kappa s)^2 / 2, so a beam of height h is
    stiffer in bending by the factor 1 + (G / E) (a / h)^2, whatever its number of cells through the height (the integral of s^2 over
    -a/2..a/2 is a^3 / 12, against the bending energy E I kappa^2 / 2 with I = h^3 / 12). With that factor put into the beam, terms of
    order (a / L)^2 remain: the moment is linear inside a cell, and the shear stress a staircase through the height.
    """
    L, h, b, E, P = 10.0, 1.0, 0.5, 1000.0, 2.0
    G = E / 2
    bending, shear = P * L**3 / (3 * E * b * h**3 / 12), P * L / (5 / 6 * G * b * h)
    tips = []
    for n in (2, 4, 8):  # cubes of side h / n along and through the beam
        part = grid("hexahedron", (10 * n, 1, n), (L, b, h), Material(E, 0.0, 1.0))
        x = solve(part, traction(part, "x1", [0, 0, -P / (b * h)]), np.repeat(part.points[:, :1] == 0, 3, axis=1))
        tip = -x[part.points[:, 0] == L, 2].mean()
        parasitic, inside_cell = G / E / n**2, (h / n / L) ** 2
        assert 0 < 1 - tip / (bending + shear) < parasitic + inside_cell
        assert tip == pytest.approx(bending / (1 + parasitic) + shear, rel=inside_cell)
        tips.append(tip)
    extrapolated = tips[2] + (tips[2] - tips[1]) / 3  # of an error of order 2: its square remains
    assert extrapolated == pytest.approx(bending + shear, rel=(G / E / 4**2) ** 2)


@pytest.mark.parametrize("cell_type", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_cantilever_converges_with_order_2(cell_type):
    """The tip's error against Timoshenko's beam, nu = 0, halving the cells. Simplices are far off at first: their order comes from below.

    The clamped end prevents no warping that the beam has with nu = 0 but that of the parabolic shear stress: less than (h / L)^3.
    """
    L, h, b, E, P = 8.0, 1.0, 0.5, 1000.0, 2.0
    d = 2 if cell_type in ("quadrilateral", "triangle") else 3
    exact = P * L**3 / (3 * E * b * h**3 / 12) + P * L / (5 / 6 * E / 2 * b * h)
    off = []
    for n in (2, 4, 8):
        counts, lengths = ((8 * n, n), (L, h)) if d == 2 else ((8 * n, n // 2, n), (L, b, h))
        options = {"plane": "stress", "thickness": b} if d == 2 else {}
        part = grid(cell_type, counts, lengths, Material(E, 0.0, 1.0), **options)
        load = traction(part, "x1", [0] * (d - 1) + [-P / (b * h)])
        x = solve(part, load, np.repeat(part.points[:, :1] == 0, d, axis=1))
        off.append(1 + x[part.points[:, 0] == L, -1].mean() / exact)
    orders = np.log2(np.divide(off[:-1], off[1:]))
    assert np.all(np.array(off) > (h / L) ** 3)  # too stiff, and more than the model of the beam leaves open
    assert orders[1] == pytest.approx(2, abs=0.05 if cell_type in ("quadrilateral", "hexahedron") else 0.3), orders
    assert orders[0] < orders[1]


def test_slender_cantilever_tends_to_euler_and_bernoulli():
    """Without the cells' parasitic shear (see `test_cantilever_under_end_load`) the tip exceeds P L^3 / (3 E I) by shear alone:
    E h^2 / (4 (5/6) G L^2) = 0.6 (h / L)^2 for nu = 0, order 2 in the slenderness."""
    h, E, P, n = 1.0, 1000.0, 2.0, 6
    slenderness, excess = np.array([4, 8, 16]), []
    for L in slenderness * h:
        tips = []
        for k in (n, 2 * n):
            part = grid("quadrilateral", (int(L / h) * k, k), (L, h), Material(E, 0.0, 1.0), plane="stress")
            x = solve(part, traction(part, "x1", [0, -P / h]), np.repeat(part.points[:, :1] == 0, 2, axis=1))
            tips.append(-x[part.points[:, 0] == L, 1].mean())
        excess.append((tips[1] + (tips[1] - tips[0]) / 3) / (P * L**3 / (3 * E * h**3 / 12)) - 1)
    mesh = (0.5 / (2 * n) ** 2) ** 2  # the extrapolation leaves the square of the parasitic term
    assert excess == pytest.approx(0.6 / slenderness**2, rel=0.05, abs=mesh)
    assert -np.polyfit(np.log(slenderness), np.log(excess), 1)[0] == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("cell_type", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_thick_cylinder_under_inner_pressure(cell_type):
    """Lame, plane strain: u_r = (1 + nu) p a^2 / (E (b^2 - a^2)) ((1 - 2 nu) r + b^2 / r), sigma_rr + sigma_tt = 2 p a^2 / (b^2 - a^2).

    In 3D a slice, one cell thick, that cannot move along the axis. Source: Timoshenko & Goodier, Theory of Elasticity, 3rd ed., 1970,
    section 28.
    """
    a, b, p, E, nu = 1.0, 2.0, 5e6, 2e9, 0.3
    d = 2 if cell_type in ("quadrilateral", "triangle") else 3

    def quarter(points):
        radius, angle = a + points[:, :1], points[:, 1:2]
        return np.hstack([radius * np.cos(angle), radius * np.sin(angle), points[:, 2:]])

    displacement_errors, stress_errors = [], []
    for n in (8, 16, 32):
        counts, lengths = ((n, n), (b - a, np.pi / 2)) if d == 2 else ((n, n, 1), (b - a, np.pi / 2, (b - a) / n))
        part = grid(cell_type, counts, lengths, Material(E, nu, 1.0), quarter, thickness=0.3 if d == 2 else 1.0)
        symmetry = np.zeros(part.points.shape, dtype=bool)
        symmetry[part.surfaces["y0"].ravel(), 1] = True  # the ray along x does not move along y
        symmetry[part.surfaces["y1"].ravel(), 0] = True
        symmetry[:, 2:] = True
        x = solve(part, pressure(part, "x0", p), symmetry)
        r = np.linalg.norm(part.points[:, :2], axis=1)
        exact = (1 + nu) * p * a**2 / (E * (b**2 - a**2)) * ((1 - 2 * nu) * r + b**2 / r)
        u_r = (x * part.points)[:, :2].sum(axis=1) / r
        displacement_errors.append(np.sqrt(np.mean((u_r / exact - 1) ** 2)))

        stress = (stress_operator(part) @ x.ravel()).reshape(-1, 6)
        r = np.linalg.norm(part.points[part.cells].mean(axis=1)[:, :2], axis=1)
        mean, deviation = p * a**2 / (b**2 - a**2), p * a**2 / (b**2 - a**2) * b**2 / r**2
        along = np.full_like(r, 2 * nu * mean)
        expected = von_mises(np.column_stack([mean - deviation, mean + deviation, along, np.zeros((len(r), 3))]))
        stress_errors.append(np.sqrt(np.mean((von_mises(stress) / expected - 1) ** 2)))
    assert np.allclose(np.log2(np.divide(displacement_errors[:-1], displacement_errors[1:])), 2, atol=0.2), displacement_errors
    assert displacement_errors[-1] < (np.pi / 2 / 32) ** 2  # (edge on the inner circle / its radius)^2
    order = 2 if cell_type in ("quadrilateral", "hexahedron") else 1  # the centre of a quadrilateral is superconvergent
    assert np.all(np.log2(np.divide(stress_errors[:-1], stress_errors[1:])) > order - 0.25), stress_errors


@pytest.mark.parametrize(
    ("cell_type", "nu", "held_sideways"),
    [("hexahedron", 0.0, False), ("hexahedron", 0.2, True), ("quadrilateral", 0.0, False), ("quadrilateral", 0.2, True)],
)
def test_bar_hanging_under_its_own_weight(cell_type, nu, held_sideways):
    """sigma = density g (distance from the free end), exact at the centres of bricks of unequal height (statics).

    Held sideways, the lateral stress is nu / (1 - nu) times that. The support carries the weight.
    """
    d = 3 if cell_type == "hexahedron" else 2
    material, g, height = Material(2.2e9, nu, 2000.0), 9.81, 3.0

    def uneven(points):
        z = points[:, -1] / height
        return np.column_stack([points[:, :-1], height * (0.4 * z + 0.6 * z**2)])

    part = grid(cell_type, (2,) * (d - 1) + (7,), (0.4,) * (d - 1) + (height,), material, uneven, thickness=0.7 if d == 2 else 1.0)
    fixed = np.zeros(part.points.shape, dtype=bool)
    fixed[:, :-1] = held_sideways
    fixed[np.isclose(part.points[:, -1], height), -1] = True
    fixed[np.all(np.isclose(part.points[:, :-1], 0), axis=1), :-1] = True  # no rigid motion sideways
    fixed[np.isclose(part.points[:, 0], 0), 0] = True
    load = body_force(part, [0] * (d - 1) + [-material.density * g])
    x = solve(part, load, fixed)

    z = part.points[part.cells].mean(axis=1)[:, -1]
    vertical = material.density * g * z
    stress = (stress_operator(part) @ x.ravel()).reshape(-1, 6)
    # in 3D x, y, z with z vertical; in 2D x, y with y vertical and plane strain across
    up, aside = (2, [0, 1]) if d == 3 else (1, [0, 2])
    expected = np.zeros_like(stress)
    expected[:, up] = vertical
    expected[:, aside] = nu / (1 - nu) * vertical[:, None] if held_sideways else 0.0
    assert np.allclose(stress, expected, rtol=0, atol=1e-9 * vertical.max())
    reaction = (stiffness(part) @ x.ravel() - load).reshape(-1, d)[np.isclose(part.points[:, -1], height), -1].sum()
    area = 0.4**2 if d == 3 else 0.4 * 0.7
    assert reaction == pytest.approx(material.density * g * height * area, rel=1e-9)
