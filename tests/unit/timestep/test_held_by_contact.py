"""Bodies of finite strain that contact and friction alone hold, in statics: what presses them would overturn them by itself, so that their
tangents are not positive definite, and a small eta is enough all the same."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh import Body
from fcsim.mesh.blocks import rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import neo_hooke, saint_venant_kirchhoff
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from tests.analytic.references.meshes import block, spaced

ANYWHERE = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)


def squeezed(share: float, steps: int, mu: float = 0.0, unit: float = 1.0) -> Step:
    """A block of neo-Hooke's material, 1 m each way, between two plates that come together by a share of its height: the last step."""
    rubber = neo_hooke(1e6 / unit**2, 0.3, 1000.0 / unit**4)
    plates = [rigid_rectangle(name, (4 * unit, unit), (0.5 * unit, y * unit), 1.0) for name, y in (("floor", -0.5), ("plate", 1.5))]
    supports = [Support("floor", ("x", "y", "rz")), Support("plate", ("x", "rz"))]
    supports.append(Support("plate", ("y",), displacement=lambda t: -share * unit * t))
    model = build_model([Body("block", rectangle("block", (unit, unit), (3, 3), rubber)), *plates], supports=supports)
    scheme = QuasiStatic(1 / steps, eta=1e-3)
    return list(Simulation(model, Everything(model, mu), scheme, steps, limits=ANYWHERE, witness=None))[-1]


def pressure(share: float) -> float:
    """[N/m] Without friction: stretches l along, b across in plane strain, P = (m (l^2 - 1) + k ln(l b)) / l along, none across."""
    m, k, l = 1e6 / 2.6, 1e6 * 0.3 / (1.3 * 0.4), 1 - share
    b = brentq(lambda b: m * (b * b - 1) + k * np.log(l * b), 1.0, 2.0, xtol=1e-14)
    return float(-(m * (l * l - 1) + k * np.log(l * b)) / l)


@pytest.mark.parametrize(("share", "steps"), [(0.1, 1), (0.45, 6)])
def test_a_block_of_rubber_between_smooth_plates(share: float, steps: int) -> None:
    """It was refused without a mass that carried some percent of the forces, and half the height was out of reach."""
    step = squeezed(share, steps)
    assert_allclose(step.contact_force_on("plate")[1], pressure(share), rtol=1e-5)
    assert_allclose(step.contact_force_on("floor")[1], -pressure(share), rtol=1e-5)


def test_a_block_that_friction_holds_is_the_same_in_millimetres() -> None:
    """In m, and in mm with MPa and tonnes, 1 mm thick."""
    metres, millimetres = (squeezed(0.2, 2, 0.8, unit).contact_force_on("plate")[1] for unit in (1.0, 1e3))
    assert_allclose(1e3 * millimetres, metres, rtol=1e-6)
    assert metres > pressure(0.2)


@pytest.mark.parametrize(("law", "elements"), [(neo_hooke, "Q1"), (saint_venant_kirchhoff, "Q2")])
def test_a_disk_is_rolled_by_a_plate(law: object, elements: str) -> None:
    """Pressed by 2 % of its height it has the pace of the middle, half that of the plate, turns by the way over its height, up to what
    pressing and corners take of the radius (2 %, 32 and 64 chords), and is in balance: also the moment of both plates' forces."""
    R, way, steps = 0.1, 0.03, 12

    def round_off(p: np.ndarray) -> np.ndarray:
        x, y = p.T
        return R * np.stack([x * np.sqrt(1 - y * y / 2), y * np.sqrt(1 - x * x / 2)], axis=1)

    grid = [spaced(-1, 1, 8), spaced(-1, 1, 8)]
    disk = block("disk", grid, law(1e6, 0.3, 1000.0), elements, at=round_off)  # type: ignore[operator]
    plates = [rigid_rectangle(name, (1.0, 0.1), (0.0, y), 1.0) for name, y in (("floor", -R - 0.05), ("plate", R + 0.05))]
    supports = [Support("floor", ("x", "y", "rz")), Support("plate", ("rz",))]
    supports.append(Support("plate", ("y",), displacement=lambda t: -0.02 * R * min(4 * t, 1.0)))
    supports.append(Support("plate", ("x",), displacement=lambda t: way * max(t - 0.25, 0.0) / 0.75))
    model = build_model([Body("disk", disk), *plates], supports=supports)
    *_, step = Simulation(model, Everything(model, 0.5), QuasiStatic(1 / steps, eta=1e-4), steps, limits=ANYWHERE, witness=None)
    moved = model.positions(step.state.x)[: len(disk.points)] - disk.points
    middle = moved.mean(axis=0)
    assert_allclose(middle, [0.5 * way, -0.01 * R], rtol=0.02)
    x = disk.points
    turn = np.sum(x[:, 0] * moved[:, 1] - x[:, 1] * moved[:, 0]) / np.sum(x[:, 0] * (x + moved)[:, 0] + x[:, 1] * (x + moved)[:, 1])
    assert_allclose(-np.arctan(turn), way / (2 * R), rtol=0.03)
    force = step.contact_force_on("plate")
    assert_allclose(step.contact_force_on("floor"), -force, atol=1e-5 * np.abs(force).max())
    place, forces = step.contacts.point, step.force_in_space
    moment = np.sum((place[:, 0] - middle[0]) * forces[:, 1] - (place[:, 1] - middle[1]) * forces[:, 0])
    assert abs(moment) < 1e-4 * R * np.abs(forces).sum()


def test_a_ball_is_rolled_by_a_plate_in_space() -> None:
    """Its middle has half the plate's way, along it alone, and the plates' forces are opposite."""
    R, way, steps = 0.1, 0.02, 6

    def round_off(p: np.ndarray) -> np.ndarray:
        a, b, c = (p * p).T
        factors = [1 - s / 2 - t / 2 + s * t / 3 for s, t in ((b, c), (c, a), (a, b))]
        return R * p * np.sqrt(np.stack(factors, axis=1))

    ball = block("ball", [spaced(-1, 1, 4)] * 3, neo_hooke(1e6, 0.3, 1000.0), at=round_off)
    plates = [rigid_box(name, (1.0, 1.0, 0.1), (0.0, 0.0, z), 1.0) for name, z in (("floor", -R - 0.05), ("plate", R + 0.05))]
    supports = [Support("floor", ("x", "y", "z", "rx", "ry", "rz")), Support("plate", ("y", "rx", "ry", "rz"))]
    supports.append(Support("plate", ("z",), displacement=lambda t: -0.04 * R * min(3 * t, 1.0)))
    supports.append(Support("plate", ("x",), displacement=lambda t: way * max(t - 1 / 3, 0.0) * 1.5))
    model = build_model([Body("ball", ball), *plates], supports=supports)
    *_, step = Simulation(model, Everything(model, 0.5), QuasiStatic(1 / steps, eta=1e-3), steps, limits=ANYWHERE, witness=None)
    middle = (model.positions(step.state.x)[: len(ball.points)] - ball.points).mean(axis=0)
    assert_allclose(middle, [0.5 * way, 0.0, -0.02 * R], atol=0.01 * way)
    force = step.contact_force_on("plate")
    assert_allclose(step.contact_force_on("floor"), -force, atol=1e-4 * np.abs(force).max())
