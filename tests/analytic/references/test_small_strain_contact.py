"""Published contact problems of small strain with exact answers: A1, A11, A12, A13, A15, A16, A17 of the reference list."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.elasticity import pressure
from fcsim.assembly.loads import NodalForces, Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.material.thermal import Thermal
from fcsim.mesh.part import Body, Part
from fcsim.timestep.step import Step
from tests.analytic.references.loading import alone, contact_force, displacement, held, loaded, pair, support_force
from tests.analytic.references.meshes import block, meridian, sector, spaced, wedge


@pytest.mark.parametrize(("cell", "elements"), [("triangle", "P1"), ("triangle", "P2"), ("quadrilateral", "Q1"), ("quadrilateral", "Q2")])
def test_A1_two_plates(cell: str, elements: str) -> None:
    """code_aster ssnp121: plates 2 x 1 m, 12 and 11 cells along the joint, E 2e6, nu 0, the top down by 0.1: p = 1e5, u_y = -0.05."""
    steel = Material(2e6, 0.0, 1.0)
    lower, upper = (rectangle("plate", (2.0, 1.0), (n, 4), steel, cell, elements=elements) for n in (11, 12))
    model = build_model(
        [Body("lower", lower), Body("upper", upper, translation=(0.0, 1.0))],
        supports=[Support("lower", ("x", "y"), "y-"), Support("upper", ("x",), "y+"), Support("upper", ("y",), "y+", velocity=-0.1)],
    )
    step = loaded(model, [pair(model, ("upper", "y-"), ("lower", "y+"))], 1, tol=1e-12)[-1]
    for name, part, side in (("lower", lower, "y+"), ("upper", upper, "y-")):
        on = np.unique(part.surfaces[side])
        assert_allclose(displacement(model, step, name)[on], np.tile([0.0, -0.05], (len(on), 1)), atol=1e-10 * 0.05)
    assert_allclose(support_force(model, step, "lower").sum(axis=0), [0.0, 2e5], atol=1e-10 * 2e5)


@pytest.mark.parametrize(("share", "sticks"), [(0.99, True), (1.01, False)])
def test_A11_slip_threshold_on_an_inclined_plane(share: float, sticks: bool) -> None:
    """code_aster ssnv503: a pad 40 x 20 on a rigid plane at 30 degrees, mu 0.3, 300 on its top; it slips from a lateral pressure of
    180 on. Nothing else holds it: the mass regularisation gives way as long as forces are out of balance."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    R = np.array([[c, -s], [s, c]])
    pad = rectangle("pad", (40.0, 20.0), (8, 4), Material(210e3, 0.0, 1e-9))
    floor = rigid_rectangle("floor", (200.0, 20.0), (20.0, -10.0), 1.0)
    model = build_model(
        [Body("pad", pad, rotation=R), replace(floor, centre=R @ floor.centre, points=floor.points @ R.T)],
        supports=[held("floor", 2)],
        loads=[
            Traction("pad", "y+", tuple(R @ [0.0, -300.0]), factor=lambda t: min(t, 1.0)),
            Traction("pad", "x-", tuple(R @ [share * 180.0, 0.0]), factor=lambda t: float(np.clip(t - 1, 0.0, 1.0))),
        ],
    )
    steps = loaded(model, [pair(model, ("pad", "y-"), ("floor", "y+"), 0.3)], 24, last=12.0, eta=1e3)
    moved = np.array([(displacement(model, step, "pad") @ R)[:, 0].mean() for step in steps[4:]])
    if sticks:
        assert_allclose(moved, moved[0], rtol=1e-3)  # it slips by a million times as much
    else:
        assert np.all(np.diff(moved) > 1e3)


@pytest.mark.parametrize("share", [0.1, 1.0, 10.0])
def test_A12_rings(share: float) -> None:
    """code_aster ssnp152: plane stress, rings 1 to 0.6 and 0.6 to 0.2 m, E 1e9, nu 0.2, pressed by 1e6 from outside: 9.2593e5 between
    them, u = -8.8333e-4 at the outside, -4.1667e-4 at the inside; by a tenth and by ten times that too. Quarters of second order on meshes
    that do not match."""
    outer, inner = rings((0.2, 0.6, 0.6, 1.0), Material(1e9, 0.2, 1.0), (25, 20))
    model = quarter_rings(outer, inner, [NodalForces("outer", pressure(outer, "x+", share * 1e6).reshape(-1, 2))])
    step = loaded(model, [pair(model, ("inner", "x+"), ("outer", "x-"))], 1)[-1]
    assert_allclose(contact_force(model, step, "inner").sum(axis=0), [-share * 9.2593e5 * 0.6] * 2, rtol=1e-3)
    assert_allclose(radial(model, step, "outer", "x+"), -share * 8.8333e-4, rtol=1e-3)
    assert_allclose(radial(model, step, "inner", "x-"), -share * 4.1667e-4, rtol=1e-3)


@pytest.mark.parametrize(
    ("radii", "interference", "E", "nu", "p"),
    [((1.25, 1.516, 1.516, 1.75), 0.02, 206e9, 0.0, 2.2164e8), ((0.9501, 1.0501, 1.05, 1.15), 1e-4, 210e3, 0.3, 0.9501)],
)
def test_A13_interference_fit(radii: tuple[float, ...], interference: float, E: float, nu: float, p: float) -> None:
    """VM292 (radii 1.25, 1.516, 1.75 m, interference 0.02): p 2.2164e8; CalculiX ring2: u_r -4.740e-5 at the bore, -4.621e-5 and 5.379e-5
    in the joint. Lame's pressure for the interference is linear in it: taken at a hundredth of it for VM292, whose own is 1.3 % of the
    radius."""
    a, b, b2, c = radii
    share = 0.01 if interference == 0.02 else 1.0
    if b == b2:
        b, b2 = b + share * interference / 2, b2 - share * interference / 2
    exact = share * interference * E / b / ((b**2 + a**2) / (b**2 - a**2) + (c**2 + b**2) / (c**2 - b**2))
    assert_allclose(exact / share, p, rtol=1e-3)
    outer, inner = rings((a, b, b2, c), Material(E, nu, 1.0), (24, 24))
    model = quarter_rings(outer, inner, [])
    step = loaded(model, [pair(model, ("inner", "x+"), ("outer", "x-"))], 1)[-1]
    assert_allclose(contact_force(model, step, "inner").sum(axis=0), [-exact * b] * 2, rtol=1e-3)
    if nu:
        u = [radial(model, step, *where).mean() for where in (("inner", "x-"), ("inner", "x+"), ("outer", "x-"))]
        assert_allclose(u, [-4.740e-5, -4.621e-5, 5.379e-5], rtol=2e-3)


def test_A13_interference_fit_at_full_interference() -> None:
    """VM292's rings, each with half of its interference of 0.02 m in its radius: in linear elasticity, with p_i b_i = p_o b_o of the radii
    as meshed, the joint bears 3.4950e8 N a radian and m, 4.0 % more than Lame's pressure for the interference in like radii, 2.2164e8 times
    1.516. Met to second order in the cells."""
    a, b, c, E, interference = 1.25, 1.516, 1.75, 206e9, 0.02
    inside, outside = b + interference / 2, b - interference / 2
    give = (inside**2 + a**2) / (inside**2 - a**2) + (c**2 + outside**2) / (c**2 - outside**2)  # E times u of a unit force a radian
    exact = E * interference / give
    assert_allclose(exact / (2.2164e8 * b), 1.040, atol=1e-3)
    off = []
    for n in (12, 24):
        outer, inner = rings((a, inside, outside, c), Material(E, 0.0, 1.0), (n, n))
        model = quarter_rings(outer, inner, [])
        step = loaded(model, [pair(model, ("inner", "x+"), ("outer", "x-"))], 1)[-1]
        off.append(-contact_force(model, step, "inner").sum(axis=0)[0] / exact - 1)
    assert_allclose(off, 0.0, atol=1.2e-3)
    assert 3.5 < off[0] / off[1] < 4.5


@pytest.mark.parametrize("angle", [0.5 * np.pi, *(pytest.param(k * np.pi, marks=pytest.mark.slow) for k in (1, 2))])
def test_A15_capstan(angle: float) -> None:
    """A band around a drum, mu 0.3, pulled at one end until all of it slips: T2 / T1 = exp(mu theta), 1.602, 2.566, 6.586; the band is thin
    (h / R = 0.004)."""
    mu, R, h = 0.3, 1.0, 0.004
    n = int(40 * angle)
    band = block("band", [spaced(0, 1, 1), spaced(0, 1, 2 * n)], Material(1e6, 0.0, 1.0), "Q1-enhanced", sector(R, R + h, 0.0, angle))
    drum = block("drum", [spaced(0, 1, 2), spaced(0, 1, n)], Material(1e9, 0.0, 1.0), "Q1", sector(0.5 * R, R, -0.1, angle + 0.1))
    c, s = np.cos(angle), np.sin(angle)
    model = build_model(
        [Body("band", band), Body("drum", drum)],
        supports=[
            Support("drum", ("x", "y"), "x-"),
            Support("band", ("x", "y"), "y-"),
            Support("band", ("y",), "y+", velocity=1e-3, axes=np.array([[c, -s], [s, c]])),
        ],
    )
    step = loaded(model, [pair(model, ("band", "x-"), ("drum", "x+"), mu)], 10, eta=1e-6)[-1]
    force = support_force(model, step, "band")
    low, high = (np.unique(band.surfaces[side]) for side in ("y-", "y+"))
    pull = float(force[high].sum(axis=0) @ [-s, c])
    assert_allclose(pull / -force[low].sum(axis=0)[1], np.exp(mu * angle), rtol=0.025 if angle > 4 else 0.02)


@pytest.mark.slow
def test_A16_thermal_ratchet() -> None:
    """A bar on a slope, tan(beta) < mu, heated and cooled, much stiffer than friction: it creeps down by alpha dT L tan(beta) / mu a
    cycle, about neutral points at L/2 (1 +- tan(beta) / mu)."""
    L, mu, tan, alpha, dT = 1.0, 0.5, 0.2, 1e-5, 100.0
    beta = np.arctan(tan)
    weight = np.array([-np.sin(beta), -np.cos(beta)])  # along the slope (x up) and into it

    def temperature(X: np.ndarray, t: float) -> np.ndarray:
        return np.full(len(X), dT * (1 - abs((t % 2.0) - 1)))

    bar = rectangle("bar", (L, 0.01), (40, 1), Thermal(Material(1e9, 0.0, 1000.0), alpha, temperature))
    floor = rigid_rectangle("floor", (3.0, 0.1), (0.5, -0.05), 1.0)
    model = build_model([Body("bar", bar), floor], supports=[held("floor", 2)], gravity=lambda t: tuple(9.81 * weight))
    steps = loaded(model, [pair(model, ("bar", "y-"), ("floor", "y+"), mu, rule="nodes")], 60, last=6.0, eta=1e-4)
    at = [displacement(model, steps[k], "bar")[:, 0].mean() for k in (19, 39, 59)]
    assert_allclose(np.diff(at), -alpha * dT * L * tan / mu, rtol=0.05)


@pytest.mark.parametrize("dT", [50.0, 100.0])
def test_A16_heated_on_level_ground(dT: float) -> None:
    """The same on level ground: friction holds the middle, and s = E A alpha dT / (mu w) from each end slips, w its weight a length; the
    ends move by alpha dT s / 2."""
    L, thick, E, rho, mu, alpha, n = 1.0, 0.01, 2e6, 1000.0, 0.5, 1e-5, 80
    s = E * alpha * dT / (mu * rho * 9.81)
    assert s < 0.5 * L
    bar = rectangle("bar", (L, thick), (n, 1), Thermal(Material(E, 0.0, rho), alpha, lambda X, t: np.full(len(X), dT * t)), plane="stress")
    floor = rigid_rectangle("floor", (3.0, 0.1), (0.5, -0.05), 1.0)
    model = build_model([Body("bar", bar), floor], supports=[held("floor", 2)], gravity=lambda t: (0.0, -9.81))
    step = loaded(model, [pair(model, ("bar", "y-"), ("floor", "y+"), mu, rule="nodes")], 2, eta=5.0)[-1]
    u = displacement(model, step, "bar")[:, 0]
    ends = [u[np.isclose(bar.points[:, 0], x)].mean() for x in (0.0, L)]
    assert_allclose(ends, [-0.5 * alpha * dT * s, 0.5 * alpha * dT * s], rtol=0.03)
    middle = np.abs(bar.points[:, 0] - 0.5 * L) < 0.5 * L - s - 0.05
    assert np.abs(u[middle]).max() < 0.02 * alpha * dT * s


STRIP = {0.5: 1.750, 1: 2.670, 2: 6.477, 4: 22.08}
DISC = {0.5: 1.545, 1: 2.955, 2: 8.758}


@pytest.mark.parametrize(("S", "stiffness"), STRIP.items())
@pytest.mark.parametrize("elements", ["Q2", "Q1-bbar"])
def test_A17_bonded_strip(S: float, stiffness: float, elements: str) -> None:
    """A strip of rubber between bonded plates, half width over height S: apparent over Young's modulus, by Taylor-Hood elements; the
    parabolic theory 4/3 (1 + S^2) is met as S grows."""
    n = 16 if elements == "Q2" else 40
    part = block("strip", [towards(1.0, n), towards(0.5 / S, n)], Material(1.0, 0.499999, 1.0), elements)
    squeezed = 1e-3 * 0.5 / S
    supports = [
        Support("body", ("y",), "y-"),
        Support("body", ("x",), "x-"),
        Support("body", ("x",), "y+"),
        Support("body", ("y",), "y+", velocity=-squeezed),
    ]
    model, steps = alone(part, supports)
    force = -support_force(model, steps[-1], "body")[np.unique(part.surfaces["y+"]), 1].sum()
    assert_allclose(force / 1e-3, stiffness, rtol=0.02 if elements == "Q1-bbar" else 6e-3)


@pytest.mark.parametrize(("S", "stiffness"), DISC.items())
def test_A17_bonded_disc(S: float, stiffness: float) -> None:
    """A disc, radius over twice the height S, as a wedge of two degrees around a hole of a thousandth of the radius."""
    angle, n = np.radians(2.0), 12
    part = block(
        "disc", [1e-3 + towards(1 - 1e-3, n), towards(0.25 / S, n), spaced(0, 1, 1)], Material(1.0, 0.49999, 1.0), "Q2", wedge(angle)
    )
    squeezed = 1e-3 * 0.25 / S
    supports = [
        *(Support("body", ("y",), side, axes=meridian(angle, sign)) for side, sign in (("z-", 1), ("z+", -1))),
        Support("body", ("x", "y"), "x-"),
        Support("body", ("z",), "y-"),
        Support("body", ("x", "y"), "y+"),
        Support("body", ("z",), "y+", velocity=-squeezed),
    ]
    model, steps = alone(part, supports)
    force = -support_force(model, steps[-1], "body")[np.unique(part.surfaces["y+"]), 2].sum()
    assert_allclose(force / 1e-3 / (0.5 * angle), stiffness, rtol=0.01)


@pytest.mark.parametrize(("mu", "stiffness"), [(0.0, 4 / 3), (100.0, STRIP[1])])
def test_A17_strip_between_plates_with_friction(mu: float, stiffness: float) -> None:
    """The strip of S = 1 between plates that it only touches: 4/3 without friction, as if bonded where nothing slips."""
    n = 24
    part = block("strip", [towards(1.0, n), towards(0.5, n)], Material(1.0, 0.49999, 1.0), "Q1-bbar")
    model = build_model(
        [Body("body", part), rigid_rectangle("plate", (4.0, 1.0), (0.0, 1.0), 1.0)],
        supports=[
            Support("body", ("y",), "y-"),
            Support("body", ("x",), "x-"),
            Support("plate", ("x", "rz")),
            Support("plate", ("y",), velocity=-5e-4),
        ],
    )
    step = loaded(model, [pair(model, ("body", "y+"), ("plate", "y-"), mu, alert=0.1, rule="nodes")], 1)[-1]
    assert_allclose(-contact_force(model, step, "body")[:, 1].sum() / 1e-3, stiffness, rtol=0.005)


def towards(end: float, n: int) -> np.ndarray:
    """n cells from 0 to `end`, the finest there, where bonded corners are singular."""
    return end - spaced(0.0, end, n, 10.0 ** (1 / n))[::-1]


def rings(radii: tuple[float, ...], material: Any, counts: tuple[int, int]) -> tuple[Part, Part]:
    """Quarters of an outer and an inner ring of radii (a, b, b2, c), the inner one from a to b, the outer one from b2 to c."""
    a, b, b2, c = radii
    grids = [[spaced(0, 1, 4), spaced(0, 1, n)] for n in counts]
    outer = block("outer", grids[0], material, "Q2", sector(b2, c, 0.0, 0.5 * np.pi), plane="stress")
    return outer, block("inner", grids[1], material, "Q2", sector(a, b, 0.0, 0.5 * np.pi), plane="stress")


def quarter_rings(outer: Part, inner: Part, loads: list[Any]) -> Model:
    supports = [Support(name, (axis,), side) for name in ("outer", "inner") for axis, side in (("y", "y-"), ("x", "y+"))]
    return build_model([Body("outer", outer), Body("inner", inner)], supports=supports, loads=loads)


def radial(model: Model, step: Step, body: str, side: str) -> np.ndarray:
    part = model.deformable[model.number[body]].part
    on = np.unique(part.surfaces[side])
    x = part.points[on]
    u: np.ndarray = np.einsum("nd,nd->n", displacement(model, step, body)[on], x) / np.linalg.norm(x, axis=1)
    return u
