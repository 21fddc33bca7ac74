"""Springs and friction of exact shapes that are drawn over the facets of a mesh, against closed forms that know of no facets."""

from typing import Any

import numpy as np
import pytest

from fcsim import (
    Compliant,
    Everything,
    ExactContacts,
    Gap,
    GeneralisedAlpha,
    QuasiStatic,
    Simulation,
    SlipWeakening,
    SolverSettings,
    Springs,
    Support,
    Theta,
    build_model,
)
from fcsim.mesh import Body, Material, brick, rectangle, rigid_box, rigid_capsule, rigid_cylinder, rigid_plane, rigid_sphere
from fcsim.mesh.rigid import rigid_body
from fcsim.timestep.step import Step

HELD = ("x", "y", "z", "rx", "ry", "rz")
K, DEPTH, PRESSED, SPEED, H = 1e4, 1e-4, 100.0, 3.0, 1e-3
LAW = Compliant(Springs(normal=PRESSED / DEPTH, tangential=K, each=True))


def floor(kind: str) -> Any:
    if kind == "plane":
        return rigid_plane("floor", (0, 0, 0), (0, 0, 1))
    if kind == "box":
        return rigid_box("floor", size=(0.6, 0.4, 0.1), centre=(0, 0, -0.05), mass=1.0)
    meshed = Body("floor", brick("floor", (0.6, 0.4, 0.1), (6, 4, 1), Material(1e12, 0.3, 1e3)), translation=(-0.3, -0.2, -0.1))
    return meshed if kind == "deformable" else rigid_body(meshed)


def there_and_back(t: Any) -> Any:
    return SPEED * np.minimum(t, 0.1 - t)


def drawn(kind: str, scheme: Any, mu: float) -> list[Step]:
    """A ball that does not turn and is drawn along x, `DEPTH` deep in the floor."""
    ball, ground = rigid_sphere("ball", 0.1, (-0.15, -0.03, 0.1 - DEPTH), 1.0), floor(kind)
    held = Support("floor", ("x", "y", "z"), at=lambda x: x[0] > -np.inf) if kind == "deformable" else Support("floor", HELD)
    supports = [held, Support("ball", ("x",), displacement=there_and_back), Support("ball", ("y", "z", "rx", "ry", "rz"))]
    model = build_model([ball, ground], supports=supports)
    return list(Simulation(model, ExactContacts(model, mu), scheme, round(0.1 / H), SolverSettings(tol=1e-10)))


def pull(steps: list[Step], axis: int = 0) -> Any:
    return np.array([step.contact_force_on(step.model.number["ball"])[axis] for step in steps])


def hysteresis(s: Any, s_0: float, limit: float) -> Any:
    """The force of a spring with a slider on the way s to s_0 and back, half of it each."""
    half = len(s) // 2
    return np.concatenate([-np.minimum(K * s[:half], limit), np.minimum(K * (s_0 - s[half:]) - min(K * s_0, limit), limit)])


@pytest.mark.each_value
@pytest.mark.parametrize("mu", [pytest.param(1000.0, marks=pytest.mark.slow), 5.0])
@pytest.mark.parametrize("kind", ["plane", "box", "mesh", "deformable"])
@pytest.mark.parametrize("scheme", [Theta(H, law=LAW), GeneralisedAlpha(H, 0.9, law=LAW)])
def test_a_spring_goes_with_a_ball_from_facet_to_facet(kind: str, mu: float, scheme: Any) -> None:
    """k s while it sticks, mu N where it slides, k from there on the way back: on a plane, on a face of two triangles, over six cells."""
    force = pull(drawn(kind, scheme, mu))
    middle = there_and_back((np.arange(len(force)) + 0.5) * H)
    assert force == pytest.approx(hysteresis(middle, SPEED * 0.05, mu * PRESSED), abs=0.5 * K * SPEED * H + 1e-6)


@pytest.mark.parametrize("kind", ["plane", "mesh"])
def test_a_spring_goes_with_a_disk_from_segment_to_segment(kind: str) -> None:
    disk = rigid_sphere("ball", 0.1, (-0.15, 0.1 - DEPTH), 1.0)
    meshed = Body("floor", rectangle("floor", (0.6, 0.1), (6, 1), Material(1e12, 0.3, 1e3)), translation=(-0.3, -0.1))
    ground = rigid_plane("floor", (0, 0), (0, 1)) if kind == "plane" else rigid_body(meshed)
    moved = Support("ball", ("x",), displacement=lambda t: SPEED * t)
    model = build_model([disk, ground], supports=[Support("floor", ("x", "y", "rz")), moved, Support("ball", ("y", "rz"))])
    force = pull(list(Simulation(model, ExactContacts(model, 1e3), Theta(H, law=LAW), 100, SolverSettings(tol=1e-10))))
    assert force == pytest.approx(-K * SPEED * H * (np.arange(100) + 0.5), abs=1e-6)


@pytest.mark.parametrize("kind", ["plane", pytest.param("box", marks=pytest.mark.slow), "mesh"])
def test_the_way_slid_goes_with_a_ball_from_facet_to_facet(kind: str) -> None:
    """Friction that falls with the way slid, as it was at the beginning of each step, under a ball's weight."""
    static, dynamic, distance = 0.5, 0.1, 0.2
    ball = rigid_sphere("ball", 0.1, (-0.15, -0.03, 0.1), 1.0)
    drives = [Support("ball", ("x",), displacement=lambda t: SPEED * t), Support("ball", ("y", "rx", "ry", "rz"))]
    supports = [Support("floor", HELD), *drives]
    model = build_model([ball, floor(kind)], supports=supports, gravity=lambda t: (0.0, 0.0, -9.81))
    scheme = Theta(H, law=Gap(friction=SlipWeakening(static, dynamic, distance)))
    steps = list(Simulation(model, ExactContacts(model, static), scheme, 100, SolverSettings(tol=1e-10)))
    slid = SPEED * H * np.arange(1, 101)
    assert [step.law_variables["slip"].max() for step in steps] == pytest.approx(slid, abs=1.1 * SPEED * H)
    mu = np.maximum(dynamic, static - (static - dynamic) * slid / distance)
    assert pull(steps) == pytest.approx(-mu * 9.81, abs=2.2 * SPEED * H * (static - dynamic) / distance * 9.81)


@pytest.mark.parametrize("scheme", [Theta(H, 1.0, law=LAW), QuasiStatic(H, law=LAW)])
def test_a_spring_does_not_act_twice_where_a_step_ends_on_another_facet(scheme: Any) -> None:
    """The facet of the step's end is looked at too, where the step ends: N and the stiffness stay."""
    steps = drawn("mesh", scheme, 5.0)
    assert pull(steps, 2) == pytest.approx(PRESSED, abs=1e-6)
    ends = there_and_back((np.arange(len(steps)) + 1.0) * H)
    assert pull(steps) == pytest.approx(hysteresis(ends, SPEED * 0.05, 5.0 * PRESSED), abs=K * SPEED * H + 1e-6)


def test_a_ball_on_a_spring_rolls_over_cells_as_on_a_plane() -> None:
    """Free, under a slanting weight: the same path and the same forces."""
    seen = []
    for kind in ("plane", "mesh"):
        ball = rigid_sphere("ball", 0.1, (-0.15, 0.01, 0.1 - 1e-5), 1.0)
        model = build_model([ball, floor(kind)], supports=[Support("floor", HELD)], gravity=lambda t: (8.0, 0.3, -10.0))
        scheme = Theta(H, law=Compliant(Springs(normal=1e6, tangential=K, normal_damping=300.0, each=True)))
        run = list(Simulation(model, ExactContacts(model, 0.5), scheme, 155, SolverSettings(tol=1e-10), created=np.inf))
        assert run[-1].state.x[model.dof_offset[model.number["ball"]]] > 0.06
        seen.append([step.contact_force_on(model.number["ball"]) for step in run])
    assert np.array(seen[1]) == pytest.approx(np.array(seen[0]), abs=1e-6)


@pytest.mark.each_value
@pytest.mark.parametrize("kind", ["box", "mesh"])
@pytest.mark.parametrize("shape", [rigid_capsule, rigid_cylinder])
def test_one_that_lies_is_pressed_by_its_ends_alone_on_a_flat_face(shape: Any, kind: str) -> None:
    """Twice the force of a ball, also above nodes within the face, and where an end is just above the edge of two triangles."""
    lying = shape("ball", 0.1, 0.15, (-0.15, 0.01, 0.1 - DEPTH), 1.0, (0, 1, 0))
    drives = [Support("ball", ("x",), displacement=there_and_back), Support("ball", ("y", "z", "rx", "ry", "rz"))]
    model = build_model([lying, floor(kind)], supports=[Support("floor", HELD), *drives])
    steps = list(Simulation(model, ExactContacts(model, 5.0), Theta(H, law=LAW), 100, SolverSettings(tol=1e-10)))
    assert pull(steps, 2) == pytest.approx(2 * PRESSED, abs=1e-6)
    middle = there_and_back((np.arange(100) + 0.5) * H)
    assert pull(steps) == pytest.approx(2 * hysteresis(middle, SPEED * 0.05, 5.0 * PRESSED), abs=K * SPEED * H + 1e-6)


@pytest.mark.each_value
@pytest.mark.parametrize("scheme", [Theta(1e-2, 1.0, law=LAW), Theta(1e-2, 0.5, law=LAW), QuasiStatic(1e-2, law=LAW)])
@pytest.mark.parametrize("deformable", [False, True])
def test_springs_go_on_where_a_corner_is_drawn_over_an_edge(scheme: Any, deformable: bool) -> None:
    """Two corners of a box leave the floor they stand on to the crossings of edges: four springs all along, 4 k s, where two began anew and
    the pull fell by a third; for a step there were six."""
    box = rigid_box("box", (0.2, 0.2, 0.2), (0.0, 0.013, 0.1 - DEPTH), 1.0)
    meshed = Body("floor", brick("floor", (0.5, 0.6, 0.1), (1, 1, 1), Material(1e13, 0.0, 1e3)), translation=(-0.3497, -0.3, -0.1))
    ground = meshed if deformable else rigid_box("floor", (0.5, 0.6, 0.1), (-0.0997, 0.0, -0.05), 1.0)
    held = Support("floor", ("x", "y", "z"), at=lambda x: x[0] > -np.inf) if deformable else Support("floor", HELD)
    drawn_on = Support("box", ("x",), displacement=lambda t: t)
    model = build_model([box, ground], supports=[held, drawn_on, Support("box", ("y", "z", "rx", "ry", "rz"))])
    steps = list(Simulation(model, Everything(model, 1e3), scheme, 9, SolverSettings(tol=1e-10)))
    mean = 1e-2 * (np.arange(9) + 0.5 * (1.0 if scheme.timing.theta == 0.5 else 2.0))
    force = np.array([step.contact_force_on(model.number["box"]) for step in steps])
    assert force[:, 0] == pytest.approx(-4.0 * K * mean, rel=1e-4)
    assert force[:, 2] == pytest.approx(4.0 * PRESSED, rel=1e-4)
