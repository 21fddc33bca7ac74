"""Published and closed-form problems of finite strain and plasticity; the letters are those of the reference list."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import brentq

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import (
    FinitePlastic,
    HardeningFunction,
    Hyperelastic,
    LinearHardening,
    Material,
    OfStretches,
    Plastic,
    mooney_rivlin,
    neo_hooke_isochoric,
)
from fcsim.mesh.part import Body, Part
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta


def quasi_static(part: Part, supports: list[Any], loads: list[Any], steps: int, side: str, scale: float = 1e3) -> tuple[Model, list[Step]]:
    """The steps to t = 1 of a body that touches nothing."""
    far = rigid_rectangle("far", (1.0, 1.0), (0.0, scale * float(np.ptp(part.points))), 1.0)
    held = [*supports, Support("far", ("x", "y", "rz"))]
    model = build_model([Body("body", part), far], supports=held, loads=loads)
    pair = SurfacePair(contact_surface(model, [("body", side)]), contact_surface(model, [("far", "y-")]), 0.0, 1e-3)
    simulation = Simulation(
        model,
        Detector([pair], model.n_nodes),
        QuasiStatic(1 / steps),
        steps,
        witness=None,
        limits=Limits(rotation=np.inf, strain=np.inf, inversion=True),
    )
    return model, list(simulation)


def displacement(model: Model, step: Step) -> np.ndarray:
    return step.state.x[: model.n_elastic].reshape(-1, 2)


def radii(a: float, b: float, n: int, ratio: float) -> np.ndarray:
    """n cells from a outwards to b, each `ratio` times as long as the last."""
    sizes = ratio ** np.arange(n)
    return a + (b - a) * np.concatenate([[0], np.cumsum(sizes) / sizes.sum()])


def annulus(a: float, b: float, nr: int, nt: int, material: Any, ratio: float, elements: str) -> Part:
    """A ring with the surfaces bore and rim."""
    angle = np.linspace(0, 2 * np.pi, nt + 1)[:nt]
    r = radii(a, b, nr, ratio)
    points = np.stack([np.outer(np.cos(angle), r), np.outer(np.sin(angle), r)], axis=-1).reshape(-1, 2)
    here = np.arange(len(points)).reshape(nt, nr + 1)
    there = np.roll(here, -1, axis=0)
    cells = np.stack([here[:, :-1], here[:, 1:], there[:, 1:], there[:, :-1]], axis=-1).reshape(-1, 4)
    surfaces = {"bore": np.stack([there[:, 0], here[:, 0]], axis=1), "rim": np.stack([here[:, -1], there[:, -1]], axis=1)}
    return Part("ring", points, cells, "quadrilateral", surfaces, material, elements=elements)


ANGLE = np.radians(0.5)


def bore_opened(
    a: float, b: float, nr: int, material: Any, opening: float, steps: int, ratio: float = 1.0
) -> tuple[list[float], list[Step]]:
    """A thick cylinder as a wedge of half a degree between planes that it slides on, its bore driven: the pressure at each step, by the
    length of the bore as it stands; and the steps."""
    R = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
    r = radii(a, b, nr, ratio)
    points = np.concatenate([np.column_stack([r, 0 * r]), np.column_stack([r, 0 * r]) @ R.T])
    k, n = np.arange(nr), nr + 1
    surfaces = {
        "low": np.stack([k, k + 1], axis=1),
        "high": np.stack([n + k + 1, n + k], axis=1),
        "bore": np.array([[n, 0]]),
        "rim": np.array([[nr, n + nr]]),
    }
    part = Part("wedge", points, np.stack([k, k + 1, n + k + 1, n + k], axis=1), "quadrilateral", surfaces, material, elements="Q1-bbar")
    drive = opening * np.cos(ANGLE / 2)  # of the two nodes' mean: the upper one goes a little farther out than the lower
    supports = [
        Support("body", ("y",), "low"),
        Support("body", ("y",), "high", axes=R),
        Support("body", ("x",), "bore", velocity=drive),
    ]
    model, found = quasi_static(part, supports, [], steps, "rim")
    pressures = []
    for step in found:
        force = step.support_impulse[: model.n_elastic].reshape(-1, 2)[[0, n]]
        x = model.reference[[0, n]] + displacement(model, step)[[0, n]]
        radial = force[0, 0] + force[1] @ (R @ [1.0, 0.0])
        pressures.append(float(radial / np.linalg.norm(x[1] - x[0])))
    return pressures, found


def radial_stresses(step: Step, a: float, b: float, nr: int, ratio: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of `bore_opened`: the cells' mean radii as they were, their means of radial and hoop stress."""
    assert step.model.nonlinear
    [(_, inner, _)] = step.model.nonlinear.at_cells(step.state.x, step.state.internal, step.state.t)
    r, xx, yy, xy = radii(a, b, nr, ratio), *inner.stress[0][:, [0, 1, 3]].T
    c, s = np.cos(ANGLE / 2), np.sin(ANGLE / 2)
    along, across = c * c * xx + s * s * yy + 2 * c * s * xy, s * s * xx + c * c * yy - 2 * c * s * xy
    return 0.5 * (r[1:] + r[:-1]), along, across


def cook(n: int, material: Any, elements: str) -> Part:
    """Cook's membrane (0, 0), (48, 44), (48, 60), (0, 44), n cells a side."""
    part = rectangle("cook", (1.0, 1.0), (n, n), material, elements=elements)
    s, t = part.points.T
    return Part(
        "cook",
        np.stack([48 * s, 44 * s + t * (44 - 28 * s)], axis=1),
        part.cells,
        part.cell_type,
        part.surfaces,
        material,
        elements=elements,
    )


def membrane(n: int, material: Any, elements: str, force: float, steps: int) -> tuple[Model, Step]:
    part = cook(n, material, elements)
    load = Traction("body", "x+", (0.0, force), factor=lambda t: t)
    model, found = quasi_static(part, [Support("body", ("x", "y"), "x-")], [load], steps, "x+")
    return model, found[-1]


def at(model: Model, step: Step, point: tuple[float, float]) -> float:
    node = int(np.argmin(np.linalg.norm(model.reference[: model.n_elastic // 2] - point, axis=1)))
    return float(displacement(model, step)[node, 1])


def square(material: Any, pressure: float) -> float:
    part = rectangle("square", (1.0, 1.0), (2, 2), material, elements="Q1-bbar")
    held = [Support("body", ("y",), "y-"), Support("body", ("x",), "x-")]
    model, steps = quasi_static(part, held, [Traction("body", "y+", (0.0, -pressure), factor=lambda t: t)], 2, "y+")
    return float(displacement(model, steps[-1])[:, 1].min())


def signorini(F: Any, p: Any) -> Any:
    """C10 (I1bar - 3) + C01 (I2bar - 3) + C20 (I1bar - 3)^2 + K/2 (J - 1)^2."""
    import ufl

    J, C = ufl.det(F), F.T * F
    I1, I2 = J ** (-2 / 3) * ufl.tr(C), J ** (-4 / 3) * 0.5 * (ufl.tr(C) ** 2 - ufl.inner(C, C))
    return p["C10"] * (I1 - 3) + p["C01"] * (I2 - 3) + p["C20"] * (I1 - 3) ** 2 + 0.5 * p["K"] * (J - 1) ** 2


@pytest.mark.parametrize(
    ("C10", "C01", "C20", "u"), [(0.709, 2.3456, 0.0, -0.034009), (1.2345, 0.0, 0.0, -0.078180), (0.1234, 1.2345, 0.456, -0.070936)]
)
def test_B1_square_in_plane_strain(C10: float, C01: float, C20: float, u: float) -> None:
    """code_aster ssnv187: dead pressure 0.876 on incompressible rubber, 2 (C10 + C01 + 2 C20 (l^2 + l^-2 - 2)) (l - l^-3) = -0.876."""
    law = Hyperelastic(signorini, 1.0, {"C10": C10, "C01": C01, "C20": C20, "K": 1e5})
    assert_allclose(square(law, 0.876), u, rtol=2e-4)


def test_B2_long_wall() -> None:
    """solids4foam longWall: 1 x 2 m, incompressible Mooney 80/20 MPa, true stresses -50 on the right and +100 MPa on top, given as the dead
    loads that they are in the end."""
    l_x, l_y = 1 - 0.16753, 1 + 0.40250 / 2
    part = rectangle("wall", (1.0, 2.0), (2, 4), mooney_rivlin(80e6, 20e6, 1e13, 1.0), elements="Q1-bbar")
    loads = [
        Traction("body", "x+", (-50e6 * l_y, 0.0), factor=lambda t: t),
        Traction("body", "y+", (0.0, 100e6 * l_x), factor=lambda t: t),
    ]
    model, steps = quasi_static(part, [Support("body", ("y",), "y-"), Support("body", ("x",), "x-")], loads, 4, "y+")
    u = displacement(model, steps[-1])
    assert_allclose([u[:, 0].min(), u[:, 1].max()], [-0.16753, 0.40250], rtol=2e-4)


def test_B3_thick_cylinder() -> None:
    """VM56: Mooney 80/20, radii 7 and 18.625, incompressible, plane strain: the pressure that opens the bore by 2.7254, 3.2115 and 7.1819
    is 90, 100 and 150; checked here by the closed form p = int (s_t - s_r) / r dr, s_t - s_r = 2 (C10 + C01) (l^2 - l^-2)."""
    a, b = 7.0, 18.625

    def exact(u: float) -> float:
        grown = (a + u) ** 2 - a**2  # r^2 = R^2 + grown
        return float(quad(lambda r: 200 * ((r**2 / (r**2 - grown)) - ((r**2 - grown) / r**2)) / r, a + u, np.sqrt(b**2 + grown))[0])

    assert_allclose([exact(u) for u in (2.7254, 3.2115, 7.1819)], [90, 100, 150], rtol=2e-4)
    pressures, steps = bore_opened(a, b, 40, mooney_rivlin(80.0, 20.0, 2e6, 1.0), 7.1819, 8, ratio=1.03)
    assert_allclose(pressures, [exact(7.1819 * step.state.t) for step in steps], rtol=2e-3)
    assert_allclose(displacement(steps[-1].model, steps[-1])[40, 0], 3.7137, rtol=1e-3)
    # Cauchy's stresses at 150: -121.6 at R = 8.1625 and, towards the bore, 622.2 for the hoop (by s_t - s_r, which nu = 1/2 gives)
    R, s_r, s_t = radial_stresses(steps[-1], a, b, 40, 1.03)
    assert_allclose(np.interp(8.1625, R, s_r), -121.6, rtol=0.01)
    stretched = ((a + 7.1819) ** 2 - a**2 + R**2) / R**2
    assert_allclose(s_t - s_r, 200 * (stretched - 1 / stretched), rtol=0.01)
    assert_allclose(200 * ((14.1819 / a) ** 2 - (a / 14.1819) ** 2) - 150, 622.2, rtol=1e-3)


COOK_Q1 = {2: 8.638, 4: 12.07, 8: 13.86, 16: 14.49, 32: 14.67, 64: 14.72}


@pytest.mark.parametrize("n", [pytest.param(n, marks=[pytest.mark.slow] * (n > 32)) for n in COOK_Q1])
def test_B4_cook_in_finite_strain(n: int) -> None:
    """deal.II's code gallery: W = mu/2 (I1bar - 3) + K/4 (J^2 - 1 - 2 ln J), mu 0.4225, nu 0.3, 1 N up in all: Q1, to their digits."""
    mu, nu = 0.4225, 0.3
    K = 2 * mu * (1 + nu) / (3 * (1 - 2 * nu))
    model, step = membrane(n, neo_hooke_isochoric(mu, K, 1.0), "Q1", 1 / 16, 2)
    assert_allclose(at(model, step, (48, 52)), COOK_Q1[n], rtol=1e-3)


COOK_Q2 = {2: 14.30, 4: 14.65, 8: 14.71, 16: 14.73, 32: 14.74, 64: 14.74}


@pytest.mark.parametrize(("n", "u"), [pytest.param(*one, marks=[pytest.mark.slow] * (one[0] > 16)) for one in COOK_Q2.items()])
def test_B4_cook_with_second_order(n: int, u: float) -> None:
    model, step = membrane(n, neo_hooke_isochoric(0.4225, 0.4225 * 2.6 / 1.2, 1.0), "Q2", 1 / 16, 2)
    assert_allclose(at(model, step, (48, 52)), u, rtol=1e-3)


@pytest.mark.parametrize(
    ("elements", "n", "tolerance"),
    [("Q1", 32, 0.02), ("Q1-bbar", 32, 0.02), ("Q2", 32, 2e-3), pytest.param("Q2", 64, 2e-5, marks=pytest.mark.slow)],
)
def test_A18_cook_linear(elements: str, n: int, tolerance: float) -> None:
    """E 70, nu 1/3, traction 6.25, plane strain: 32.263 at (48, 60), 30.741 at (48, 52), by 64 x 64 cells of second order."""
    model, step = membrane(n, Material(70.0, 1 / 3, 1.0), elements, 6.25, 1)
    assert_allclose([at(model, step, (48, 60)), at(model, step, (48, 52))], [32.263, 30.741], rtol=tolerance)


def test_C1_thick_cylinder_yields() -> None:
    """VM38: 4 to 8 in, plane strain, E 30e6, sy 30000, no hardening. The collapse pressure 2 sy / sqrt(3) ln(b / a) = 24011, and before
    yielding Lamé's pressure and stresses."""
    pressure, steps = bore_opened(4.0, 8.0, 32, Plastic(30e6, 0.3, 1.0, 30e3), 0.04, 40)
    u, E, nu = 0.04 / 40, 30e6, 0.3
    a, b = 4.0, 8.0
    lame = u * E * (b**2 - a**2) / ((1 + nu) * a * (b**2 + (1 - 2 * nu) * a**2))
    assert_allclose(pressure[0], lame, rtol=2e-3)
    assert_allclose(pressure[-1] * 4.04 / 4.0, 24011, rtol=2e-3)  # small strain: by the bore as it was
    r, s_r, s_t = radial_stresses(steps[0], a, b, 32)
    published = np.array([[-9984, -467.8], [18645, 9128]]) / 12990  # at r = 4.4 and 7.6
    assert_allclose([np.interp([4.4, 7.6], r, s) / lame for s in (s_r, s_t)], published, rtol=5e-3)
    largest = max(step.energy.material_dissipation for step in steps)
    assert all(step.energy.material_dissipation >= -1e-9 * largest for step in steps)
    assert all(abs(step.energy.residual) < 1e-6 * abs(step.energy.support_work) for step in steps)


def test_C1_thick_cylinder_of_nafems() -> None:
    """PL-5: 100 to 200 mm, E 21e3, sy 24: the collapse pressure 19.209, and with part of the wall yielding s_t - s_r = 2 sy / sqrt(3) and
    s_r = -p + (2 sy / sqrt(3)) ln(r / a) there (the published stresses are of Gauss points of two cells)."""
    yields, u = 2 * 24 / np.sqrt(3), 1.0
    pressure, steps = bore_opened(100.0, 200.0, 32, Plastic(21e3, 0.3, 1.0, 24.0), u, 40)
    by_area = np.array(pressure) * (1 + u / 100 * np.arange(1, 41) / 40)
    assert_allclose(by_area[-1], 19.209, rtol=2e-3)
    k = int(np.searchsorted(by_area, 14.0))
    r, s_r, s_t = radial_stresses(steps[k], 100.0, 200.0, 32)
    flows = s_t - s_r > 0.999 * yields
    assert 3 < np.count_nonzero(flows) < 32
    assert_allclose((s_t - s_r)[flows], yields, rtol=2e-3)
    assert_allclose(s_r[flows], -by_area[k] + yields * np.log(r[flows] / 100), rtol=5e-3)


def test_C2_cylinder_expands_by_eight_times() -> None:
    """solids4foam cylinderExpansion: 10 to 20 mm, mu 3.8 GPa, K 40 GPa, sy 0.5 MPa, to 85 mm: s_r = sy / sqrt(3) ln(a^2 / (a^2 + 300))."""
    mu, K = 3.8e9, 40e9
    E, nu = 9 * K * mu / (3 * K + mu), (3 * K - 2 * mu) / (2 * (3 * K + mu))
    pressure, steps = bore_opened(10e-3, 20e-3, 16, FinitePlastic(E, nu, 1.0, 0.5e6), 75e-3, 75)
    for a, s in ((15, -0.2446), (20, -0.1615), (30, -0.0830), (50, -0.0327), (85, -0.0117)):
        exact = 0.5e6 / np.sqrt(3) * np.log(a**2 / (a**2 + 300))
        assert_allclose(exact, s * 1e6, atol=60)
        assert_allclose(-pressure[a - 11], exact, rtol=0.01)
    assert all(step.energy.material_dissipation >= 0 for step in steps)


@pytest.mark.parametrize(
    ("cells", "degrees", "tolerance"), [((12, 24), 10, 5e-3), pytest.param((16, 72), 60, 8e-3, marks=pytest.mark.slow)], ids=["10", "60"]
)
def test_C3_torsion_of_large_strain(cells: tuple[int, int], degrees: int, tolerance: float) -> None:
    """VM198 (Nagtegaal, de Jong): annulus 10 to 20, outer circle fixed, inner one turned by up to 60 degrees, E 7200, nu 0.33, sy 10, H
    40.22; shear stress at the bore by int (tau/G + 3 <tau - sy/sqrt 3>/H)/r dr = theta, 16.43 at 10, 23.04, 29.25, 35.46, 41.67, 47.88
    at 60 degrees. A wrong objective rate would let it oscillate or fall."""
    E, nu, sy, H = 7200.0, 0.33, 10.0, 40.22
    G = E / (2 * (1 + nu))

    def angle(tau: float) -> float:
        k = tau * 100.0
        return float(quad(lambda r: (k / r**2 / G + 3 * max(k / r**2 - sy / np.sqrt(3), 0) / H) / r, 10, 20)[0])

    published = np.array([16.43, 23.04, 29.25, 35.46, 41.67, 47.88])[: degrees // 10]
    exact = [brentq(lambda tau, at=at: angle(tau) - np.radians(at), 5.0, 80.0) for at in range(10, degrees + 1, 10)]
    assert_allclose(exact, published, rtol=1e-3)
    part = annulus(10.0, 20.0, *cells, FinitePlastic(E, nu, 1.0, LinearHardening(sy, H)), 1.08, "Q1-bbar")
    turned = DrivenRotation("body", lambda t: np.radians(degrees) * t, (0.0, 0.0), surface="bore")
    model, steps = quasi_static(part, [Support("body", ("x", "y"), "rim"), turned], [], degrees // 2, "rim")
    bore = np.unique(model.facets("body", "bore"))
    each = len(steps) * 10 // degrees
    moments = []
    for step in steps[each - 1 :: each]:
        x = model.reference[bore] + displacement(model, step)[bore]
        force = step.support_impulse[: model.n_elastic].reshape(-1, 2)[bore]
        moments.append(float((x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum()))
    assert_allclose(np.array(moments) / (2 * np.pi * 100.0), exact, rtol=tolerance)


@pytest.mark.slow
def test_C5_cook_elastoplastic() -> None:
    """E 206.9, nu 0.29, sy = 0.45 + 0.265 (1 - exp(-16.93 e)) + 0.12924 e, traction 0.3125 up in 30 steps: limit 7.0 +- 0.05 at
    (48, 60); on 32 cells a side enhanced elements of first order have 6.970, reduced ones 6.899."""
    hardening = HardeningFunction(
        lambda e: 0.45 + 0.265 * (1 - np.exp(-16.93 * e)) + 0.12924 * e, lambda e: 0.265 * 16.93 * np.exp(-16.93 * e) + 0.12924
    )
    law = FinitePlastic(206.9, 0.29, 1.0, hardening)
    a, b, c = (at(*membrane(n, law, "Q1-bbar", 0.3125, 30), (48, 60)) for n in (8, 16, 32))
    assert_allclose(c, 6.90, atol=0.05)
    assert_allclose(c + (c - b) ** 2 / (2 * b - a - c), 7.0, atol=0.05)  # Aitken's extrapolation


@pytest.mark.parametrize("kL", [*(pytest.param(kL, marks=pytest.mark.slow) for kL in (0.1, 0.2)), 0.3])
def test_D4_spinning_bar(kL: float) -> None:
    """Nominal stress linear in nominal strain, P = E (l - 1), nu = 0: u(L) / L = tan(kL) / (kL) - 1, k = w sqrt(rho / E), steady at theta
    = 1/2.

    Started with that strain, damped a little; L is half of a bar that spins about its middle."""
    L, E, rho = 0.5, 1e7, 1000.0
    omega = kL / L * np.sqrt(E / rho)
    law = OfStretches(lambda l, p: 0.5 * p["E"] * ((l[0] - 1) ** 2 + (l[1] - 1) ** 2 + (l[2] - 1) ** 2), rho, {"E": E})
    part = rectangle("bar", (2 * L, 0.02), (40, 1), law)
    far = rigid_rectangle("far", (1, 1), (1e3, 0), 1.0)
    model = build_model([Body("bar", part), far], supports=[Support("far", ("x", "y", "rz"))], beta=1e-4)
    X = part.points[:, 0] - L
    k = kL / L
    u = np.sin(k * X) / (k * np.cos(kL)) - X  # E u'' = -rho w^2 (X + u), u'(+-L) = 0
    arm = np.column_stack([X + u, part.points[:, 1] - 0.01])
    start = State(0.0, np.zeros(model.n_dofs), np.zeros(model.n_dofs))
    start.x[: model.n_elastic : 2] = u
    start.v[: model.n_elastic] = omega * np.column_stack([-arm[:, 1], arm[:, 0]]).ravel()
    pair = SurfacePair(contact_surface(model, [("bar", "x-")]), contact_surface(model, [("far", "x-")]), 0.0, 1e-3)
    h = 0.1 * kL / omega  # 40 steps a period of the bar
    lengths = []
    for step in Simulation(model, Detector([pair], model.n_nodes), Theta(h), 40, initial=start):
        x = model.reference[: len(X)] + step.state.x[: model.n_elastic].reshape(-1, 2)
        ends = x[X.max() == X].mean(axis=0), x[X.min() == X].mean(axis=0)
        lengths.append(np.linalg.norm(ends[0] - ends[1]) / (2 * L) - 1)
    assert_allclose(np.mean(lengths), np.tan(kL) / kL - 1, rtol=2e-3)
    assert step.energy.elastic > 0 and step.energy.kinetic > 0
