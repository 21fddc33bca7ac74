"""Pushes by displacement: the descending branch of a block about its toe, and of a rod that is let down."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Control, Force, Linkage, Material, QuasiStatic, Simulation, Support, build_model
from fcsim.command_line.main import main
from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.masonry import Acceleration, Block, MasonryProblem, PointForce, push_by_displacement, pushed, write_masonry
from fcsim.mesh.blocks import brick
from fcsim.mesh.part import Body
from fcsim.mesh.solids.closed_surface import closed_surface

CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def block(name, low, high, **properties):
    corners = [[(high if c else low)[k] for k, c in enumerate(corner)] for corner in CORNERS]
    return Block(closed_surface(name, corners, FACES), **properties)


def stone_on_floor(dimension, width, height, unit=1.0, **more):
    floor = block("floor", (-5 * width * unit, 0.0, -unit), (5 * width * unit, 0.4 * unit, 0.0), support=True)
    stone = block("stone", (0.0, 0.0, 0.0), (width * unit, 0.4 * unit, height * unit), density=2000.0)
    return MasonryProblem("stone", dimension, (floor, stone), mu=more.pop("mu", 0.9), **more)


@pytest.mark.parametrize(
    ("dimension", "width", "height", "unit"),
    [(2, 0.4, 1.2, 1.0), (3, 0.5, 1.0, 0.01), pytest.param(2, 1.0, 6.0, 10.0, marks=pytest.mark.slow)],
)
def test_branch_of_one_block_is_the_tangent(dimension, width, height, unit):
    """Moments about the toe: multiplier = tan(alpha - theta); the centroid has gone R (sin alpha - sin(alpha - theta))."""
    branch = push_by_displacement(pushed(stone_on_floor(dimension, width, height, unit), (1.0, 0.0, 0.0)), step=8e-3 * height * unit)
    alpha, R = np.arctan2(width, height), 0.5 * unit * np.hypot(width, height)
    left = np.arcsin(np.clip(np.sin(alpha) - branch.displacement / R, -1, 1))  # alpha - theta
    assert_allclose(branch.multiplier, np.tan(left), atol=2e-3 * np.tan(alpha))
    assert branch.multiplier[0] == pytest.approx(np.tan(alpha), rel=1e-6)
    assert branch.end == pytest.approx(R * np.sin(alpha), rel=3e-3)
    assert branch.held


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_load_on_top_moves_with_its_point(dimension):
    """Moments about the toe, of the weight and of a force P on the top, which comes down along its own way: the multiplier is
    (W x + P a) / (W z) of the arms as they have turned, at 3 cm 0.07 below that of a force in the centroid."""
    width, height, pressing, top = 0.4, 1.0, 3000.0, 0.25
    loads = (Acceleration((0.0, 0.0, -9.81)), PointForce("stone", (0.0, 0.0, -pressing), (top, 0.2, height)))
    branch = push_by_displacement(pushed(stone_on_floor(dimension, width, height, loads=loads), (1.0, 0.0, 0.0)), step=2e-3, to=0.03)
    weight = 2000.0 * width * 0.4 * height * 9.81

    def turned(x, z, angle):
        return x * np.cos(angle) + z * np.sin(angle), z * np.cos(angle) - x * np.sin(angle)

    angle = np.linspace(0.0, 0.6, 2000)
    (x, z), (a, _) = turned(-width / 2, height / 2, angle), turned(top - width, height, angle)
    exact = np.interp(branch.displacement, x + width / 2, -(weight * x + pressing * a) / (weight * z))
    assert_allclose(branch.multiplier, exact, atol=3e-3 * exact[0])


def test_long_steps_are_taken_in_parts():
    """A step of a tenth of the arm, in which statics would lift the block off its toe: the curve is that of short ones."""
    branch = push_by_displacement(pushed(stone_on_floor(2, 0.4, 1.2), (1.0, 0.0, 0.0)), step=0.06, to=0.06)
    alpha, R = np.arctan2(0.4, 1.2), 0.5 * np.hypot(0.4, 1.2)
    left = np.arcsin(np.sin(alpha) - branch.displacement / R)
    assert branch.held and branch.displacement[-1] == pytest.approx(0.06)
    assert_allclose(branch.multiplier, np.tan(left), atol=1e-2 * np.tan(alpha))


def test_what_drops_on_the_way_to_where_a_step_begins_is_not_looked_for_in_shorter_ones():
    """Steps in each of which the multiplier falls by more than 2 %: half of a step shows that it is not the step's doing. Each was taken in
    parts of down to 1/1024, after 76 refusals."""
    told: list[str] = []
    branch = push_by_displacement(pushed(stone_on_floor(2, 0.1, 1.0), (1.0, 0.0, 0.0)), step=4e-3, to=0.02, tell=told.append)
    alpha, R = np.arctan2(0.1, 1.0), 0.5 * np.hypot(0.1, 1.0)
    assert_allclose(branch.multiplier, np.tan(np.arcsin(np.sin(alpha) - branch.displacement / R)), atol=2e-4 * np.tan(alpha))
    assert sum("again in half" in text for text in told) < len(branch.displacement) < 20


def test_a_block_that_slides_bears_its_friction_all_the_way():
    branch = push_by_displacement(pushed(stone_on_floor(2, 1.0, 0.5, mu=0.3), (1.0, 0.0, 0.0)), step=0.01, to=0.2)
    assert_allclose(branch.multiplier, 0.3, rtol=1e-6)
    assert branch.end is None


@pytest.mark.parametrize(("step", "steps"), [(0.05, [0.0, 0.05, 0.1]), (0.04, [0.0, 0.04, 0.08, 0.1]), (0.1, [0.0, 0.1])])
def test_the_branch_ends_where_it_is_asked_to(step, steps):
    branch = push_by_displacement(pushed(stone_on_floor(2, 1.0, 0.5, mu=0.3), (1.0, 0.0, 0.0)), step=step, to=0.1)
    assert_allclose(branch.displacement, steps, atol=1e-12)
    assert_allclose(branch.multiplier, 0.3, rtol=1e-6)
    assert branch.held and branch.end is None


def test_force_at_a_point_goes_with_its_point():
    """A force F at the top edge: F h' = W b' about the toe, with the lever arms of the turned block."""
    weight = 2000.0 * 0.4 * 0.4 * 1.2 * 9.81
    loads = (Acceleration((0.0, 0.0, -9.81)), PointForce("stone", (1.0, 0.0, 0.0), (0.0, 0.2, 1.2), scaled=True))
    branch = push_by_displacement(stone_on_floor(2, 0.4, 1.2, loads=loads), step=4e-3, to=0.2)
    turn = np.arange(0.0, 0.4, 1e-4)
    c, s = np.cos(turn), np.sin(turn)
    gone = (-0.4 * c + 1.2 * s) + 0.4  # of the upper left corner, about the lower right one
    force = weight * (0.2 * c - 0.6 * s) / (1.2 * c + 0.4 * s)
    assert_allclose(branch.multiplier, np.interp(branch.displacement, gone, force), atol=2e-3 * force[0])


def test_loads_of_several_directions_are_refused_by_name():
    loads = (Acceleration((0, 0, -9.81)), Acceleration((1.0, 0, 0), scaled=True), PointForce("stone", (0.0, 0.0, 5.0), scaled=True))
    with pytest.raises(InputError, match="in one direction"):
        push_by_displacement(stone_on_floor(2, 0.4, 1.2, loads=loads))
    with pytest.raises(InputError, match="multiplier scales"):
        push_by_displacement(stone_on_floor(2, 0.4, 1.2))
    with pytest.raises(InputError, match="bears every multiplier"):
        push_by_displacement(pushed(stone_on_floor(2, 0.4, 1.2), (0.0, 0.0, -1.0)))
    tipping = (Acceleration((5.0, 0.0, -9.81)),)
    with pytest.raises(InputError, match="falls under the loads that stay"):
        push_by_displacement(pushed(stone_on_floor(2, 0.4, 1.2, loads=tipping), (1.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="step, to"):
        push_by_displacement(pushed(stone_on_floor(2, 0.4, 1.2), (1.0, 0.0, 0.0)), step=-1.0)


def test_control_of_an_elastic_bar_takes_its_stiffness():
    """A bar in tension, nu = 0, pulled at the four nodes of its end alike: F = E A d / l."""
    part = brick("bar", (2.0, 0.5, 0.5), (4, 1, 1), Material(E=1e6, nu=0.0, density=1000.0))
    model = build_model([Body("bar", part)], supports=[Support("bar", ("x", "y", "z"), "x-")])
    end = model.reference[np.abs(model.reference[:, 0] - model.reference[:, 0].max()) < 1e-9]
    points = tuple(("bar", tuple(place.tolist()), 3.0) for place in end)
    linkage = Linkage(model, [Control("pull", points, (2.0, 0.0, 0.0), rate=1e-3)])
    *_, last = Simulation(model, Everything(model, 0.0), QuasiStatic(1.0), 3, linkage=linkage)
    assert len(end) == 4
    assert last.link_force("pull") == pytest.approx([1e6 * 0.25 * 3e-3 / 2.0, 0.0, 0.0], rel=1e-8, abs=1e-8)


def test_what_stands_on_a_stone_and_what_is_pushed_askew():
    """The upper stone of two about its own toe; a square one along its diagonal about its corner, b sqrt(2) / h."""
    stones = (
        block("floor", (-5, 0, -1), (5, 0.4, 0), support=True),
        block("lower", (0, 0, 0), (2, 0.4, 1), density=2000.0),
        block("upper", (0.8, 0, 1), (1.2, 0.4, 2.6), density=500.0),
    )
    upper = push_by_displacement(pushed(MasonryProblem("two", 2, stones, mu=0.9), (-1.0, 0.0, 0.0)), step=2e-3, to=0.01)
    assert upper.multiplier[0] == pytest.approx(0.25, rel=1e-6)
    askew = push_by_displacement(pushed(stone_on_floor(3, 0.4, 1.2), (1.0, 1.0, 0.0)), step=2e-3, to=0.01)
    assert askew.multiplier[0] == pytest.approx(np.sqrt(2) * 0.2 / 0.6, rel=1e-6)


@pytest.mark.parametrize(
    ("driven", "way"),
    [
        ({"displacement": lambda t: 1e-3 * float(np.interp(t, [0, 1, 2, 4, 5], [0, 1, 1, -1, 0]))}, [1e-3, 1e-3, 0.0, -1e-3, 0.0]),
        ({"rate": 0.0}, [0.0] * 5),
    ],
)
def test_control_drives_there_and_back_and_holds(driven, way):
    """The bar's end up, held, down through zero and back, and at rest: F = E A d / l; held at zero it bears the load that pulls it."""
    part = brick("bar", (2.0, 0.5, 0.5), (4, 1, 1), Material(E=1e6, nu=0.0, density=1000.0))
    load = Force("bar", (0.1, 0.0, 0.0), surface="x+")
    model = build_model([Body("bar", part)], supports=[Support("bar", ("x", "y", "z"), "x-")], loads=[load])
    end = model.reference[np.unique(part.surfaces["x+"])]
    linkage = Linkage(model, [Control("pull", tuple(("bar", tuple(p.tolist()), 1.0) for p in end), (1.0, 0.0, 0.0), **driven)])
    steps = Simulation(model, Everything(model, 0.0), QuasiStatic(1.0), 5, linkage=linkage)
    found = [step.link_force("pull")[0] for step in steps]
    assert found == pytest.approx([1e6 * 0.25 * d / 2.0 - 0.1 for d in way], rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": np.nan},
        {"displacement": lambda t: t},
        {"rate": 0.0, "displacement": lambda t: 1 + t},
        {"direction": (0.0, 0.0)},
        {"points": ()},
        {"points": (("stone", (0.1, 0.1), -1.0),)},
    ],
)
def test_control_refuses_what_moves_nothing(wrong):
    from fcsim.masonry import structure

    model, _ = structure(stone_on_floor(2, 0.4, 1.2))
    given = {"points": (("stone", (0.2, 0.6), 1.0),), "direction": (1.0, 0.0), "rate": 1.0, **wrong}
    with pytest.raises(InputError, match="Control 'push'"):
        Linkage(model, [Control("push", **given)])


def test_command_writes_the_curve(tmp_path, capsys):
    path = tmp_path / "stone.json"
    write_masonry(path, stone_on_floor(2, 0.4, 1.2))
    assert main(["push", str(path), "--direction", "x", "--branch", "--step", "0.01", "--out", str(tmp_path / "o")]) == 0
    assert "falls by itself from a displacement of" in capsys.readouterr().out
    curve = json.loads((tmp_path / "o" / "branch.json").read_text())
    rows = np.loadtxt(tmp_path / "o" / "branch.csv", delimiter=",", skiprows=1)
    assert_allclose(rows[:, 1], curve["multiplier"], rtol=1e-8)
    assert (tmp_path / "o" / "branch.png").stat().st_size > 5000


@pytest.mark.parametrize(("angle", "mu"), [(20.0, 0.5), (30.0, 0.4), (10.0, 0.9)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_friction_factor_of_a_block_on_a_slope(angle, mu, dimension):
    """mu / tan(angle) for a flat block, above 1 where it stands; one that tips is held by no friction."""
    from fcsim.masonry import friction_factor, limit_problem

    tangent = np.tan(np.radians(angle))
    loads = (Acceleration((9.81 * tangent, 0.0, -9.81)),)
    flat = limit_problem(stone_on_floor(dimension, 1.0, 0.2, mu=mu, loads=loads))
    assert friction_factor(flat) == pytest.approx(mu / tangent, rel=2e-5)
    assert friction_factor(limit_problem(stone_on_floor(dimension, 0.1, 1.2, mu=mu, loads=loads))) == 0.0
    level = limit_problem(stone_on_floor(dimension, 1.0, 0.2, mu=mu))
    assert friction_factor(level) == np.inf
    assert friction_factor(limit_problem(pushed(stone_on_floor(dimension, 1.0, 0.2, mu=mu), (1.0, 0, 0))), tangent) == pytest.approx(
        mu / tangent, rel=3e-4
    )
