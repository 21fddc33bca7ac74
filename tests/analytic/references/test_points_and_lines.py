"""Published problems held and pulled on lines and points: NAFEMS' thick plate, the pinched shells of MacNeal and Harder as solids."""

import numpy as np
from numpy.testing import assert_allclose

from fcsim import Body, Everything, Force, Material, QuasiStatic, Simulation, Support, Traction, build_model, displacement, stress
from fcsim.mesh.part import Part
from fcsim.timestep.step import Step
from tests.analytic.references.meshes import block, spaced


def solved(part: Part, supports: list[Support], loads: list[Force | Traction]) -> Step:
    model = build_model([Body("body", part)], supports=supports, loads=loads)
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1, witness=None)
    return step


def test_nafems_le10_thick_plate() -> None:
    """NAFEMS, The standard benchmarks, 1990, LE10: sigma_yy = -5.38 MPa at (2, 0, 0.6); the outer rim held across in all its height, along
    z on the line in its middle; 1 MPa on the top. The rim bears all of the load."""

    def at(p: np.ndarray) -> np.ndarray:
        a = 0.5 * np.pi * p[:, 1]
        inner, outer = (np.stack([x * np.cos(a), y * np.sin(a)], axis=1) for x, y in ((2.0, 1.0), (3.25, 2.75)))
        return np.column_stack([inner + (outer - inner) * p[:, :1], p[:, 2]])

    part = block("body", [spaced(0, 1, 6), spaced(0, 1, 6), spaced(0, 0.6, 6)], Material(210e9, 0.3, 7800.0), "Q2", at)
    rim = Support("body", ("z",), "x+", at=lambda x: np.isclose(x[2], 0.3))
    supports = [Support("body", ("y",), "y-"), Support("body", ("x",), "y+"), Support("body", ("x", "y"), "x+"), rim]
    step = solved(part, supports, [Traction("body", "z+", (0.0, 0.0, -1e6))])
    assert_allclose(stress("s", step.model, "body", "yy", (2.0, 0.0, 0.6)).measure(step), -5.38e6, rtol=5e-3)
    area = 0.25 * np.pi * (3.25 * 2.75 - 2.0 * 1.0)
    assert_allclose(step.support_force(rim)[2], 1e6 * area, rtol=1e-4)
    assert not step.remarks


def pinched_cylinder(elements: str, n: int) -> tuple[float, Step]:
    """Over 1.8248e-5."""
    R, L, t = 300.0, 600.0, 3.0

    def at(p: np.ndarray) -> np.ndarray:
        a = 0.5 * np.pi * p[:, 0]
        return np.stack([(R + p[:, 2]) * np.sin(a), p[:, 1], (R + p[:, 2]) * np.cos(a)], axis=1)

    axes = [spaced(0, 1, n, 1.1), spaced(0, L / 2, n, 1.1), spaced(-t / 2, t / 2, 1)]
    part = block("body", axes, Material(3e6, 0.3, 1.0), elements, at)
    top = (0.0, 0.0, R)
    supports = [Support("body", (k,), side) for k, side in (("x", "x-"), ("z", "x+"), ("y", "y-"))]
    step = solved(part, [*supports, Support("body", ("x", "z"), "y+")], [Force("body", (0.0, 0.0, -0.25), at=top)])
    return -displacement("w", step.model, "body", "z", top).measure(step) / 1.8248e-5, step


def test_pinched_cylinder() -> None:
    """R. H. MacNeal and R. L. Harder, 1985 (Flugge): R 300, L 600, t 3, E 3e6, nu 0.3, ends on diaphragms, two unit forces: 1.8248e-5 under
    them."""
    assert_allclose(pinched_cylinder("Q2", 16)[0], 1.0, rtol=0.015)


def hemisphere(n: int, hole: float) -> tuple[float, Step]:
    """Displacement of the points that two forces of 1 draw out; a quarter of a shell with a hole of `hole` degrees about its axis."""
    R, t, top = 10.0, 0.04, np.radians(90 - hole)

    def at(p: np.ndarray) -> np.ndarray:
        phi, theta, r = 0.5 * np.pi * p[:, 0], top * p[:, 1], R + p[:, 2]
        return np.stack([r * np.cos(theta) * np.cos(phi), r * np.cos(theta) * np.sin(phi), r * np.sin(theta)], axis=1)

    part = block("body", [spaced(0, 1, n), spaced(0, 1, n), spaced(-t / 2, t / 2, 1)], Material(6.825e7, 0.3, 1.0), "Q2", at)
    A, B = (R, 0.0, 0.0), (0.0, R, 0.0)
    supports = [Support("body", ("y",), "x-"), Support("body", ("x",), "x+"), Support("body", ("z",), at=A)]
    step = solved(part, supports, [Force("body", (1.0, 0.0, 0.0), at=A), Force("body", (0.0, -1.0, 0.0), at=B)])
    assert_allclose(step.support_force(supports[2])[2], 0.0, atol=1e-4)  # nothing pulls along z: the point only takes away a motion
    return displacement("u", step.model, "body", "x", A).measure(step), step


def test_a_pinched_hemisphere_of_too_few_cells_says_so() -> None:
    """8 x 8 cells of second order have a quarter of the way."""
    found, step = hemisphere(8, 18.0)
    assert found < 0.3 * 0.094
    assert any("jumps" in text for text in step.remarks)
