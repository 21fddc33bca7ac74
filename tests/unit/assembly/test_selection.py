"""Nodes by surfaces, edges, points, functions and names; forces spread over them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Body, Everything, Force, InputError, QuasiStatic, Simulation, Support, build_model, support_force, support_moment
from fcsim.assembly.loads import load_vector
from fcsim.assembly.supports.selection import Selection
from fcsim.mesh import brick, rectangle, rigid_box, with_surface
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part

ALU = Material(7e10, 0.3, 2700.0)
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def box(elements: str = "Q1", cell: str = "hexahedron") -> Part:
    return brick("box", (2.0, 1.0, 0.5), (4, 2, 2), ALU, cell, elements=elements)


def of(part: Part, **named: object) -> np.ndarray:
    model = build_model([Body("box", part)], supports=[Support("box", ("x",))])
    return part.points[Selection(**named).of(model, "box", "test")]  # type: ignore[arg-type]


@pytest.mark.parametrize("elements", ["Q1", "Q2"])
def test_what_names_nodes(elements: str) -> None:
    part = box(elements)
    twice = 2 if elements == "Q2" else 1
    edge = of(part, surface=("x+", "z-"))
    assert len(edge) == 2 * twice + 1
    assert_allclose(edge[:, [0, 2]], np.tile([2.0, 0.0], (len(edge), 1)), atol=1e-12)
    assert_allclose(of(part, surface=("x+", "z-", "y-")), [[2.0, 0.0, 0.0]], atol=1e-12)
    assert_allclose(of(part, at=(0.5, 0.0, 0.5)), [[0.5, 0.0, 0.5]], atol=1e-12)
    assert len(of(part, at=[(0.5, 0.0, 0.5), (1.0, 0.0, 0.5)])) == 2
    line = of(part, at=lambda x: np.isclose(x[0], 1.0) & np.isclose(x[2], 0.25))
    assert len(line) == 2 * twice + 1
    assert len(of(part, surface="z+", at=lambda x: x[0] < 0.1)) == 2 * twice + 1
    assert_allclose(of(part, nodes=[3, 1, 3]), part.points[[1, 3]])


def test_points_are_those_of_the_placed_body() -> None:
    model = build_model([Body("box", box(), TURN, (5.0, 0.0, 0.0))], supports=[Support("box", ("x",))])
    (node,) = Selection(at=(5.0, 2.0, 0.0)).of(model, "box", "test")  # the corner (2, 0, 0), turned by 90 degrees
    assert_allclose(model.reference[node], [5.0, 2.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"at": (0.51, 0.0, 0.5)}, r"nearest node is at \(0.5, 0.0, 0.5\)"),
        ({"at": (0.5, 0.0)}, "a point of 3 finite coordinates"),
        ({"at": lambda x: x[0] > 3}, r"true at some of the 45 nodes, which lie between \(0.0, 0.0, 0.0\) and \(2.0, 1.0, 0.5\)"),
        ({"at": lambda x: x[0]}, r"gives 45 truth values"),
        ({"at": lambda x: x[3] > 0}, "function of coordinates"),
        ({"surface": ("x-", "x+")}, "none: surface = "),
        ({"nodes": "rim"}, "names no points or lines"),
        ({"nodes": [45]}, "numbers of nodes 0 ... 44"),
        ({"surface": "top"}, "expected a surface among"),
    ],
)
def test_what_names_none(named: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        build_model([Body("box", box())], supports=[Support("box", ("x",), **named)]).held  # type: ignore[arg-type, unused-ignore]  # noqa: B018


def test_rigid_bodies_have_no_points() -> None:
    with pytest.raises(InputError, match="of a rigid body, which moves as a whole"):
        build_model([rigid_box("r", (1.0,) * 3, (0.0,) * 3, 1.0)], supports=[Support("r", ("x",), at=(0.5, 0.5, 0.5))])


@pytest.mark.parametrize(("elements", "cell"), [("Q1", "hexahedron"), ("Q2", "hexahedron"), ("P1", "tetrahedron"), ("P2", "tetrahedron")])
def test_forces_on_points_lines_and_surfaces_do_the_work_of_even_ones(elements: str, cell: str) -> None:
    """Work on displacements of the elements' own degree is that of the evenly spread force: means of y, y^2 over the edge, of y z over the
    face; in all it is the force."""
    part = box(elements, cell)
    model = build_model([Body("box", part)], supports=[Support("box", ("x",), "x-")])
    _, y, z = part.points.T
    for named, shape, mean in (
        ({"surface": ("x+", "z+")}, y, 0.5),
        ({"surface": ("x+", "z+")}, y**2, 1 / 3),
        ({"surface": "x+"}, y + z, 0.75),
        ({"surface": "x+"}, y**2, 1 / 3),
        ({"at": (2.0, 0.5, 0.25)}, y * z, 0.125),
        ({"at": [(2.0, 0.0, 0.0), (2.0, 1.0, 0.5)]}, y + z, 0.75),
    ):
        if mean == 1 / 3 and elements in ("Q1", "P1"):
            continue
        f = load_vector(model, Force("box", (1.0, -2.0, 3.0), **named)).reshape(-1, 3)  # type: ignore[arg-type]
        assert_allclose(f.sum(axis=0), [1.0, -2.0, 3.0], rtol=1e-12)
        assert_allclose(shape @ f, mean * np.array([1.0, -2.0, 3.0]), rtol=1e-12)


def test_a_force_on_half_a_line_and_a_point_is_refused() -> None:
    with pytest.raises(InputError, match="on edges and the others alone"):
        build_model([Body("box", box())], loads=[Force("box", (1.0, 0.0, 0.0), at=[(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (2.0, 1.0, 0.5)])])
    with pytest.raises(InputError, match="no moment on a deformable body"):
        build_model([Body("box", box())], loads=[Force("box", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), surface="x+")])


def test_reactions_of_points_and_edges_are_those_of_statics() -> None:
    """A beam on an edge and two corners, a force on a point of its top: reactions by moments; nothing along x and y."""
    part = box("Q2")
    edge = Support("box", ("z",), ("x-", "z-"))
    corners = [Support("box", ("z",), at=(2.0, y, 0.0)) for y in (0.0, 1.0)]
    held = [Support("box", ("x", "y"), at=(0.0, 0.0, 0.0)), Support("box", ("x",), at=lambda x: (x[0] == 0) & (x[1] == 1) & (x[2] == 0))]
    load = Force("box", (0.0, 0.0, -100.0), at=(0.5, 0.25, 0.5))
    model = build_model([Body("box", part)], supports=[edge, *corners, *held], loads=[load])
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1)
    assert_allclose(step.support_force(edge), [0.0, 0.0, 75.0], atol=1e-6)
    near, far = (step.support_force(corner) for corner in corners)
    assert_allclose(near + far, [0.0, 0.0, 25.0], atol=1e-6)
    on_edge = support_force("R", model, "box", "z", ("x-", "z-"))
    assert_allclose(on_edge.measure(step), 75.0, rtol=1e-9)
    moment = sum(
        support_moment("M", model, "box", "rx", (0.0, 0.0, 0.0), **where).measure(step)
        for where in ({"surface": ("x-", "z-")}, {"at": (2.0, 0.0, 0.0)}, {"at": (2.0, 1.0, 0.0)})
    )
    assert_allclose(moment, 0.25 * 100.0, rtol=1e-4)  # arms are those of the deflected beam


def test_a_body_on_one_point_turns_and_on_none_falls() -> None:
    """Statics refuse what a point alone holds: it is free to turn."""
    with pytest.raises(InputError, match="exclude rigid motion"):
        model = build_model([Body("box", box())], supports=[Support("box", ("x", "y", "z"), at=(0.0, 0.0, 0.0))])
        list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1))


def test_a_displacement_of_time_is_followed_to_the_letter() -> None:
    """A triangle wave and a sine: where the support stands is what the function says, whatever the step."""
    for wave in (lambda t: 1e-3 * float(np.interp(t, [0, 0.25, 0.75, 1], [0, 1, -1, 0])), lambda t: 1e-3 * float(np.sin(7 * t))):
        part = rectangle("box", (1.0, 1.0), (2, 2), ALU, plane="stress")
        top = Support("box", ("y",), "y+", displacement=wave)
        model = build_model([Body("box", part)], supports=[Support("box", ("y",), "y-"), Support("box", ("x",), "x-"), top])
        upper = np.unique(part.surfaces["y+"])
        for step in Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.1), 10):
            assert_allclose(step.state.x.reshape(-1, 2)[upper, 1], wave(step.state.t), atol=1e-15)
            assert_allclose(step.support_force(top)[1], 7e10 * wave(step.state.t), atol=1e-3)


def test_displacements_begin_at_zero_and_are_no_velocities() -> None:
    part = rectangle("box", (1.0, 1.0), (2, 2), ALU)
    with pytest.raises(InputError, match="a velocity or a displacement"):
        Support("box", ("y",), "y+", 1.0, displacement=lambda t: t)
    model = build_model([Body("box", part)], supports=[Support("box", ("x", "y"), displacement=lambda t: 1e-3 + t)])
    with pytest.raises(InputError, match=r"displacement 0 in the reference configuration, got 0\.001"):
        list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1))


def test_surfaces_by_a_function() -> None:
    part = with_surface(box("Q2"), "spot", lambda x: np.isclose(x[2], 0.5) & (x[0] < 1.1))
    assert_allclose(part.points[np.unique(part.surfaces["spot"])][:, 2], 0.5)
    model = build_model([Body("box", part)], supports=[Support("box", ("x",), "x-")])
    total = load_vector(model, Force("box", (0.0, 0.0, -1.0), surface="spot")).reshape(-1, 3)[:, 2]
    assert_allclose(total @ part.points[:, 0], -0.5, rtol=1e-12)  # its middle is at x = 0.5
    with pytest.raises(InputError, match="hold none between them"):
        with_surface(part, "inside", lambda x: np.isclose(x[0], 1.0) & (x[2] < 0.1))
    with pytest.raises(InputError, match="expected a new name"):
        with_surface(part, "x-", lambda x: x[0] < 1)
