"""Links against closed forms and invariants: pendulums, springs, sliders, tied and bonded bodies, cables; what files hold of them."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fcsim
from fcsim.assembly.stress import stress_operator
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.linkage import (
    Ball,
    Bonded,
    Cable,
    Hinge,
    Linkage,
    Rod,
    Slider,
    SpringDamper,
    Tied,
    WithCables,
    without_contact_of,
)
from fcsim.mesh import Body, Material, brick, rectangle, rigid_box, rigid_cylinder, rigid_rectangle, rigid_sphere
from fcsim.mesh.material import neo_hooke
from fcsim.solvers import solve

G = 9.81


class Nothing:
    """A detection that finds no contacts."""

    def __init__(self, model: fcsim.Model) -> None:
        self.n_nodes, self._d = model.n_nodes, model.dimension
        self.nodes = np.empty(0, dtype=np.int64)

    def __call__(self, positions: Any, displacement: Any = None) -> fcsim.Contacts:
        d, none = self._d, np.empty(0)
        i = np.empty((0, 2), dtype=np.int64)
        return fcsim.Contacts(np.empty((0, d)), np.empty((0, d, d)), none, none, i, np.empty((0, 2)), i, np.empty(0, dtype=np.int64))


def moved(bodies: Any, links: Any, scheme: Any, steps: int, gravity: float = -G, **options: Any) -> list[fcsim.Step]:
    d = bodies[0].dimension
    initial = options.pop("initial", None)
    model = fcsim.build_model(bodies, gravity=lambda t: (*(0.0,) * (d - 1), gravity), **options)
    state = None if initial is None else fcsim.State(0.0, np.zeros(model.n_dofs), initial(model))
    simulation = fcsim.Simulation(model, Nothing(model), scheme, steps, linkage=Linkage(model, links), initial=state, witness=None)
    return list(simulation)


def drift(steps: list[fcsim.Step]) -> float:
    """Swing of the whole energy [J]: kinetic, elastic, of springs, less the work of loads."""
    work = np.cumsum([step.energy.load_work for step in steps])
    return float(np.ptp([s.energy.kinetic + s.energy.elastic + s.energy.links - w for s, w in zip(steps, work, strict=True)]))


@pytest.mark.parametrize("unit", [1.0, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_a_rigid_pendulum_with_order_two(unit: float) -> None:
    """I phi'' = - m g a cos phi from the horizontal, to the other side (1 s; in mm: lengths and g times 1e-3): order 2 in the angle, the
    joint closed, and the balance of energy without residual."""
    rod = rigid_rectangle("rod", (1.0 * unit, 0.05 * unit), (0.5 * unit, 0.0), 2.0)
    inertia = float(rod.inertia[0, 0]) + 2 * (0.5 * unit) ** 2
    exact = solve_ivp(lambda t, y: [y[1], -2 * G * unit * 0.5 * unit * np.cos(y[0]) / inertia], (0, 1), [0, 0], rtol=1e-11, atol=1e-13)
    off = []
    for n in (50, 100):
        steps = moved([rod], [Ball("pin", "rod", None, (0.0, 0.0))], fcsim.Theta(1 / n), n, -G * unit)
        off.append(abs(steps[-1].state.x[2] - exact.y[0, -1]))
        largest = max(step.energy.kinetic for step in steps)
        assert max(abs(step.energy.residual) for step in steps) < 1e-12 * largest
        assert drift(steps) < 30 * largest / n**2
        middle = steps[-1].scheme.detection_configuration(steps[-1].model, steps[-1].state)
        assert np.abs(steps[-1].linked.linkage.rows(middle).gap).max() < 1e-9 * unit
    assert off[0] / off[1] == pytest.approx(4, abs=0.3)
    assert off[1] < 1e-4


@pytest.mark.parametrize("scheme", [fcsim.Theta(5e-3), fcsim.GeneralisedAlpha(5e-3)])
def test_energy_of_mechanisms(scheme: Any) -> None:
    """A double pendulum in 2D; in 3D a hinge with an oblique axis, a ball joint, a rod: energies swing by the order h^2 of the scheme."""
    upper, lower = rigid_rectangle("a", (1.0, 0.05), (0.5, 0.0), 2.0), rigid_rectangle("b", (1.0, 0.05), (1.5, 0.0), 1.0)
    block = rigid_box("a", (1.0, 0.2, 0.1), (0.5, 0, 0), 3.0)
    for bodies, links in (
        ([upper, lower], [Ball("1", "a", None, (0.0, 0.0)), Ball("2", "a", "b", (1.0, 0.0))]),
        ([block], [Hinge("1", "a", None, ((0.0, -0.1, 0.0), (0.0, 0.1, 0.05)))]),
        ([block], [Ball("1", "a", None, (0.0, -0.1, 0.0))]),
        ([block], [Rod("1", "a", None, ((0.0, 0.1, 0.0), (0.0, 0.8, 0.3)))]),
    ):
        steps = moved(bodies, links, scheme, 40)
        largest = max(step.energy.kinetic for step in steps)
        assert drift(steps) < 5e-3 * largest
        assert abs(sum(step.energy.link_work for step in steps)) < 5e-3 * largest
        assert max(abs(step.energy.residual) for step in steps) < 1e-11 * largest
        assert np.mean([len(step.attempts) for step in steps]) < 7


def test_the_force_in_a_pin_of_a_body_at_rest_is_its_weight() -> None:
    """Two bodies that hang on each other: the pins bear 3 g and 1 g; on the first body the ground pulls up, the second one down."""
    upper, lower = rigid_rectangle("a", (0.1, 1.0), (0.0, -0.5), 2.0), rigid_rectangle("b", (0.1, 1.0), (0.0, -1.5), 1.0)
    steps = moved([upper, lower], [Ball("1", "a", None, (0.0, 0.0)), Ball("2", "a", "b", (0.0, -1.0))], fcsim.Theta(1e-2), 3)
    assert steps[-1].link_force("1") == pytest.approx([0, 3 * G], abs=1e-8)
    assert steps[-1].link_force("2") == pytest.approx([0, -G], abs=1e-8)
    with pytest.raises(InputError, match="link '3': expected one of '1', '2'"):
        steps[-1].link_force("3")


@pytest.mark.parametrize("damping", [0.0, pytest.param(6.0, marks=pytest.mark.slow), 200.0])
def test_spring_and_dashpot(damping: float) -> None:
    """m z'' + c z' + k z = - m g, from rest: order 2, the energy balanced, dashpots take what they must and nothing else."""
    m, k = 3.0, 300.0
    body, link = rigid_box("s", (0.2,) * 3, (0, 0, 0), m), SpringDamper("spring", "s", None, ((0, 0, 0), (0, 0, 1.0)), k, damping)
    exact = solve_ivp(lambda t, y: [y[1], -G - (k * y[0] + damping * y[1]) / m], (0, 1), [0, 0], rtol=1e-11, atol=1e-13)
    off = []
    for n in (70, 140):
        steps = moved([body], [link], fcsim.Theta(1 / n), n)
        off.append(abs(steps[-1].state.x[2] - exact.y[0, -1]))
        stored = [0.0, *(step.energy.links for step in steps)]
        dissipated = [-s.energy.link_work - (s.energy.links - before) for s, before in zip(steps, stored, strict=False)]
        assert min(dissipated) > -1e-12
        assert (sum(dissipated) > 0.1) == (damping > 0)
        assert max(abs(step.energy.residual) for step in steps) < 1e-12
    assert off[1] < 3e-4 and off[0] / off[1] == pytest.approx(4, abs=0.5)
    half = solve_ivp(lambda t, y: [y[1], -G - (k * y[0] + damping * y[1]) / m], (0, 1 - 0.5 / n), [0, 0], rtol=1e-11, atol=1e-13).y[:, -1]
    assert steps[-1].link_force("spring")[2] == pytest.approx(-k * half[0] - damping * half[1], abs=0.05)  # the mean over the step


def test_a_slider_falls_freely_and_does_not_turn() -> None:
    """On a line that is 30 degrees off the vertical: a = g cos^2 along z, and no rotation although the body is not held in its centre."""
    s, c = np.sin(np.pi / 6), np.cos(np.pi / 6)
    body = rigid_box("s", (0.2, 0.3, 0.4), (0.05, 0.02, 0), 3.0)
    link = Slider("slider", None, "s", ((0, 0, 0), (0.5 * s, 0, 0.5 * c)), beside=(0.0, 0.3, 0.0))
    steps = moved([body], [link], fcsim.Theta(2e-2), 25)
    assert steps[-1].state.x == pytest.approx([-0.5 * G * c * s * 0.25, 0, -0.5 * G * c * c * 0.25, 0, 0, 0], abs=1e-10)
    turning = moved([body], [Slider("slider", None, "s", link.ends)], fcsim.Theta(2e-2), 25)[-1]
    assert np.abs(turning.state.x[3:]).max() > 0.01  # without `beside` it turns about the line
    assert np.cross(turning.state.x[3:6], [s, 0, c]) == pytest.approx([0, 0, 0], abs=1e-3)


def test_a_flexible_body_on_a_hinge_swings_without_losing_energy() -> None:
    part = brick("flex", (1.0, 0.1, 0.1), (6, 1, 1), Material(1e7, 0.3, 1000.0), elements="Q1-enhanced")
    steps = moved([Body("flex", part)], [Hinge("h", "flex", None, ((0, 0, 0.05), (0, 0.1, 0.05)))], fcsim.Theta(5e-3), 40)
    assert drift(steps) < 1e-6 * max(step.energy.kinetic for step in steps)


E = 200e9
SAME = [("quadrilateral", "Q1"), ("quadrilateral", "Q2"), ("triangle", "P1"), ("triangle", "P2")]
SAME += [("hexahedron", "Q1"), ("hexahedron", "Q2"), ("tetrahedron", "P1"), ("tetrahedron", "P2")]


@pytest.mark.parametrize(("first", "second"), [*((a, a) for a in SAME), (("hexahedron", "Q2"), ("tetrahedron", "P1"))])
def test_tied_meshes_that_do_not_match_pass_the_patch_test(first: Any, second: Any) -> None:
    """Two blocks pulled apart: uniform stress E eps through the tie, lateral contraction free."""
    d = 2 if first[0] in ("quadrilateral", "triangle") else 3
    blocks, up = [], (*(0.0,) * (d - 1), 2.0)
    for name, (cell, elements), n, origin in (("a", second, (4, 2), (0.0,) * d), ("b", first, (7, 3), up)):
        divisions = n if d == 2 else ((2, 2, 1) if name == "a" else (3, 3, 1))
        options = {"plane": "stress"} if d == 2 else {}
        make: Any = rectangle if d == 2 else brick
        part = make(name, (2.0,) * d, divisions, Material(E, 0.3, 7800.0), cell, origin=origin, elements=elements, **options)
        blocks.append(Body(name, part))
    axis = "xyz"[d - 1]
    supports = [fcsim.Support("a", (axis,), f"{axis}-"), fcsim.Support("b", (axis,), f"{axis}+", velocity=1e-3)]
    supports += [fcsim.Support(name, (c,), f"{c}-") for name in "ab" for c in "xyz"[: d - 1]]
    model = fcsim.build_model(blocks, supports=supports)
    linkage = Linkage(model, [Tied("tie", ("b", f"{axis}-"), ("a", f"{axis}+"))])
    step = list(fcsim.Simulation(model, Nothing(model), fcsim.QuasiStatic(0.5), 2, linkage=linkage, witness=None))[-1]
    eps = 1e-3 / 4
    exact = model.reference * (-0.3 * eps)
    exact[:, -1] = eps * model.reference[:, -1]
    assert np.abs(step.state.x.reshape(-1, d) - exact).max() < 1e-9  # of 1e-3
    uniform = np.zeros(6)
    uniform[d - 1] = E * eps
    for k, body in enumerate(model.deformable):
        own = step.state.x[model.dof_offset[k] : model.dof_offset[k + 1]]
        assert np.abs((stress_operator(body.part) @ own).reshape(-1, 6) - uniform).max() < 1e-6 * E * eps
    assert step.link_force("tie")[-1] == pytest.approx(-E * eps * 2 ** (d - 1), rel=1e-6)
    assert abs(step.energy.link_work) < 1e-9 * step.energy.elastic


def test_bonded_parts_are_one_body() -> None:
    """A bar of two parts with the nodes of one mesh moves as the bar of one part, in statics and turning in free flight."""
    whole = brick("w", (2.0, 0.2, 0.2), (8, 1, 1), Material(1e8, 0.3, 1000.0))
    halves = [brick("h", (1.0, 0.2, 0.2), (4, 1, 1), Material(1e8, 0.3, 1000.0), origin=(x, 0, 0)) for x in (0.0, 1.0)]

    def spun(model: fcsim.Model) -> Any:
        x = model.reference - [1.0, 0.1, 0.1]
        return np.asarray(np.cross([0.0, 2.0, 3.0], x) + np.array([0.1, 0, 0])).ravel()

    one = moved([Body("w", whole)], [], fcsim.Theta(1e-2), 20, initial=spun)[-1]
    two = moved([Body("a", halves[0]), Body("b", halves[1])], [Bonded("bond", "a", "b")], fcsim.Theta(1e-2), 20, initial=spun)[-1]
    for place in ([0, 0, 0], [2, 0.2, 0.2], [1, 0.2, 0]):
        ends = [step.state.x.reshape(-1, 3)[np.argmin(np.linalg.norm(step.model.reference - place, axis=1))] for step in (one, two)]
        assert ends[1] == pytest.approx(ends[0], abs=5e-4)  # two frames for one: the strain is small, not zero
    assert two.energy.kinetic + two.energy.elastic == pytest.approx(one.energy.kinetic + one.energy.elastic, rel=1e-4)


def test_bonded_parts_of_rubber_are_one_body() -> None:
    """Nothing is approximated there: the halves have the strains of the whole, in free flight with spin, to the tolerance of the step."""
    rubber = neo_hooke(1e8, 0.3, 1000.0)
    whole = brick("w", (2.0, 0.2, 0.2), (8, 1, 1), rubber)
    halves = [brick("h", (1.0, 0.2, 0.2), (4, 1, 1), rubber, origin=(x, 0, 0)) for x in (0.0, 1.0)]

    def spun(model: fcsim.Model) -> Any:
        x = model.reference - [1.0, 0.1, 0.1]
        return np.asarray(np.cross([0.0, 2.0, 3.0], x) + np.array([0.1, 0, 0])).ravel()

    one = moved([Body("w", whole)], [], fcsim.Theta(1e-2), 8, initial=spun)[-1]
    two = moved([Body("a", halves[0]), Body("b", halves[1])], [Bonded("bond", "a", "b")], fcsim.Theta(1e-2), 8, initial=spun)[-1]
    for place in ([0, 0, 0], [2, 0.2, 0.2], [1, 0.2, 0]):
        ends = [step.state.x.reshape(-1, 3)[np.argmin(np.linalg.norm(step.model.reference - place, axis=1))] for step in (one, two)]
        assert ends[1] == pytest.approx(ends[0], abs=1e-9)
    assert abs(two.energy.residual) < 1e-9 * two.energy.kinetic


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("rubber", [True, False])
def test_a_rigid_plate_glued_to_a_block(d: int, rubber: bool) -> None:
    """The block's top stays as flat as the plate, which falls on it; both by linear elasticity and as rubber, the balance closed."""
    material: Any = neo_hooke(1e6, 0.3, 1000.0) if rubber else Material(1e6, 0.3, 1000.0)
    if d == 3:
        block, plate = brick("b", (1.0,) * 3, (2, 2, 2), material), rigid_box("r", (1.0, 1.0, 0.2), (0.5, 0.5, 1.1), 200.0)
    else:
        block, plate = rectangle("b", (1.0,) * 2, (3, 3), material), rigid_rectangle("r", (1.0, 0.2), (0.5, 1.1), 200.0)
    axis = "xyz"[d - 1]
    tie, held = Tied("glue", ("b", f"{axis}+"), ("r", f"{axis}-")), fcsim.Support("b", tuple("xyz"[:d]), f"{axis}-")
    steps = moved([Body("b", block), plate], [tie], fcsim.Theta(2e-3), 10, supports=[held])
    model, x = steps[-1].model, steps[-1].model.positions(steps[-1].state.x)
    top = np.flatnonzero(np.isclose(model.reference[: len(block.points), -1], 1.0))
    assert np.ptp(x[top, -1]) < 1e-9 and x[top, -1].max() < 1 - 1e-3
    assert np.diff(x[top], axis=0) == pytest.approx(np.diff(model.reference[top], axis=0), abs=1e-9)
    assert steps[-1].link_force("glue")[-1] < 0
    assert all(abs(step.energy.residual) < 1e-9 * steps[-1].energy.kinetic for step in steps)


def test_a_chain_of_many_links_falls_freely_at_its_end() -> None:
    """100 links, 300 rows: S is sparse there. Falling from level, the free end falls freely until the bend reaches it; no energy drifts."""
    n, a = 100, 0.1
    bodies: list[Any] = [rigid_box(f"c{k}", (a, 0.02, 0.02), ((k + 0.5) * a, 0.0, 0.0), 0.1) for k in range(n)]
    links: list[Any] = [Ball(f"j{k}", f"c{k - 1}" if k else None, f"c{k}", (k * a, 0.0, 0.0)) for k in range(n)]
    steps = moved(bodies, links, fcsim.Theta(1e-3), 10)
    t, model = steps[-1].state.t, steps[-1].model
    assert model.rigid_part(steps[-1].state.x)[-1, 2] == pytest.approx(-0.5 * G * t**2, rel=1e-6)
    assert drift(steps) < 1e-5 * max(step.energy.kinetic for step in steps)  # the start from level is a jump of the forces: O(h^2)
    held = steps[-1].linked
    assert held is not None and np.abs(held.missing(model, steps[-1].scheme, steps[-1].state.v, steps[-1].state)).max() < 1e-9


def test_a_cable_is_slack_then_taut() -> None:
    """A body thrown up sideways on a cable of 1 m flies freely until it is taut (t = 1/3 s), then never farther than its length."""
    ball = rigid_box("s", (0.02,) * 3, (0, 0, 0), 1.0)
    model = fcsim.build_model([ball])
    linkage = Linkage(model, [Cable("cable", "s", None, ((0, 0, 0), (0, 0, 0.5)), length=1.0)])
    v = np.zeros(6)
    v[0] = 2.0
    state = fcsim.State(0.0, np.zeros(6), v)
    simulation = fcsim.Simulation(
        model, WithCables(Nothing(model), linkage), fcsim.Theta(1e-2), 100, linkage=linkage, initial=state, witness=None
    )
    taut = np.sqrt(1 - 0.25)
    for step in simulation:
        x = step.state.x
        distance = np.linalg.norm(x[:3] - [0, 0, 0.5])
        assert distance < 1 + 1e-3
        if 2.0 * step.state.t < taut - 0.05:
            assert x[0] == pytest.approx(2.0 * step.state.t)
    assert step.state.x[0] < 1.0 and step.contact_force[0, 0] >= 0


def test_a_cable_that_a_load_step_turns_is_longer_and_no_body_lies_in_another_one() -> None:
    """Drawn aside by its weight: what the cable is longer at a step's end, 24 mm, was said to be a penetration."""
    model = fcsim.build_model([rigid_box("s", (0.2,) * 3, (0, 0, 0), 1.0)], gravity=lambda t: (10.0 * t, 0.0, -10.0))
    linkage = Linkage(model, [Cable("cable", "s", None, ((0, 0, 0), (0, 0, 0.5)), length=0.5)])
    scheme = fcsim.QuasiStatic(0.25, eta=1.0)
    steps = list(fcsim.Simulation(model, WithCables(Nothing(model), linkage), scheme, 4, linkage=linkage, witness=None))
    assert max(float(np.linalg.norm(step.state.x[:3] - [0, 0, 0.5])) for step in steps) > 0.51
    assert all(step.penetration == 0 for step in steps)


def test_the_tension_of_cables_on_a_wheel_and_where_nothing_else_is_linked() -> None:
    """3 and 2 kg on cables at both sides of a wheel of 2 kg: a = g (3 - 2) / (3 + 2 + I / R^2), tensions 3 (g - a) and 2 (g + a); and a
    body that hangs: its weight, on the first body towards the second, upwards. A slack cable pulls nothing."""
    R = 0.5
    hung = [rigid_rectangle(n, (0.1, 0.1), (x, -1.05), m) for n, x, m in (("a", -R, 3.0), ("b", R, 2.0))]
    bodies = [rigid_sphere("wheel", R, (0, 0), 2.0), *hung]
    model = fcsim.build_model(bodies, gravity=lambda t: (0.0, -G))
    cables = [Cable(f"to {n}", "wheel", n, ((x, 0.0), (x, -1.0))) for n, x in (("a", -R), ("b", R))]
    slack = Cable("slack", "wheel", "a", ((0, 0), (-R, -1.0)), length=2.0)
    linkage = Linkage(model, [Ball("axle", "wheel", None, (0.0, 0.0)), *cables, slack])
    detection = WithCables(Nothing(model), linkage)
    *_, last = fcsim.Simulation(model, detection, fcsim.Theta(1e-4), 10, linkage=linkage, witness=None)
    a = G / 6
    assert last.link_force("to a") == pytest.approx([0, -3 * (G - a)], rel=1e-4, abs=1e-2)
    assert last.link_force("to b") == pytest.approx([0, -2 * (G + a)], rel=1e-4, abs=1e-2)
    assert last.link_force("slack") == pytest.approx([0, 0], abs=1e-12)

    model = fcsim.build_model([rigid_box("s", (0.02,) * 3, (0, 0, 0), 1.0)], gravity=lambda t: (0.0, 0.0, -G))
    linkage = Linkage(model, [Cable("rope", "s", None, ((0, 0, 0), (0, 0, 0.5)))])
    *_, last = fcsim.Simulation(model, WithCables(Nothing(model), linkage), fcsim.Theta(1e-2), 3, linkage=linkage, witness=None)
    assert last.link_force("rope") == pytest.approx([0, 0, G], rel=1e-8)
    with pytest.raises(InputError, match="link 'roep': expected one of 'rope'"):
        last.link_force("roep")


def test_cables_that_the_detection_does_not_know_are_refused() -> None:
    model = fcsim.build_model([rigid_box("s", (0.02,) * 3, (0, 0, 0), 1.0)], gravity=lambda t: (0.0, 0.0, -G))
    linkage = Linkage(model, [Cable("rope", "s", None, ((0, 0, 0), (0, 0, 0.5)))])
    with pytest.raises(InputError, match=r"link 'rope': expected a detection that knows of cables, WithCables\(detector, linkage\)"):
        fcsim.Simulation(model, fcsim.Everything(model, 0.0), fcsim.Theta(1e-2), 3, linkage=linkage, witness=None)


def test_links_and_contact_in_one_problem_as_files_hold_it(tmp_path: Any) -> None:
    """Two hinged flexible bars, a spring between them, fallen on a floor: the step's answer solves the exported global problem with G
    and b, by another method too; redundant links (the hinge twice) change nothing but the shares of their forces."""
    material = Material(1e7, 0.3, 1000.0)
    bars = [
        Body(name, rectangle(name, (1.0, 0.1), (4, 1), material, origin=(x, 0.001), elements="Q1-enhanced"))
        for name, x in (("a", 0.0), ("b", 1.0))
    ]
    floor = rigid_rectangle("floor", (4.0, 1.0), (1.0, -0.5), 1.0)
    answers = []
    for twice in (False, True):
        model = fcsim.build_model([*bars, floor], supports=[fcsim.Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, -G))
        links = [Ball("pin", "a", "b", (1.0, 0.051)), SpringDamper("s", "a", "b", ((0.5, 0.1), (1.5, 0.1)), 1e4, 10.0)]
        links += [Ball("again", "a", "b", (1.0, 0.051))] if twice else []
        surfaces = [fcsim.contact_surface(model, [(name, "y-")]) for name in "ab"]
        top = fcsim.contact_surface(model, [("floor", "y+")])
        pairs = [fcsim.SurfacePair(surface, top, 0.4, 0.05) for surface in surfaces]
        simulation = fcsim.Simulation(
            model, fcsim.Detector(pairs, model.n_nodes), fcsim.Theta(5e-3), 12, linkage=Linkage(model, links), witness=None
        )
        answers.append(list(simulation)[-1])
    step = answers[0]
    assert step.problem.G is not None and len(step.contacts) == 10
    assert step.contact_force_on(2)[1] < 0
    path = tmp_path / "step.hdf5"
    write_fclib(path, step.problem)
    read = read_fclib(path).problem
    found = solve(read, "NSN-AC", tol=1e-10, linear="kkt")
    assert found.solved
    assert found.v == pytest.approx(step.result.v, abs=1e-7)
    assert found.multiplier == pytest.approx(step.result.multiplier, abs=1e-6 * np.abs(step.result.multiplier).max())
    assert np.abs(answers[1].state.x - step.state.x).max() < 1e-9
    pyvista = pytest.importorskip("pyvista")
    from fcsim.running.vtk_series import SeriesWriter

    SeriesWriter(tmp_path, step.model).write(step)
    points = pyvista.read(next(tmp_path.glob("links_*.vtp")))
    assert points["force [N]"][points["link"] == 0].sum(axis=0)[:2] == pytest.approx(step.link_force("pin"))
    assert points.points[0, :2] == pytest.approx([1.0, 0.05], abs=0.02)
    assert answers[1].link_force("pin") == pytest.approx(0.5 * step.link_force("pin"), rel=1e-4, abs=1e-4)


def test_contact_of_linked_bodies_can_be_left_out() -> None:
    blocks = [rigid_box(name, (1.0, 1.0, 1.0), (x, 0, 0), 1.0) for name, x in (("a", 0.0), ("b", 1.0), ("c", 2.0))]
    model = fcsim.build_model(blocks)
    everything = fcsim.Everything(model, 0.5)
    left = without_contact_of(everything, model, [("b", "a")])
    pairs = {tuple(sorted(pair)) for pair in left(model.reference).bodies.tolist()}
    assert pairs == {(1, 2)} and len(everything(model.reference)) > len(left(model.reference))


@pytest.mark.parametrize(
    ("links", "message"),
    [
        ([Ball("p", "a", None, (0, 0, 0)), Ball("p", "b", None, (1, 0, 0))], "different names"),
        ([Ball("p", "a", "nobody", (0, 0, 0))], "body 'nobody': expected one of"),
        ([Ball("p", "a", "a", (0, 0, 0))], "two different bodies"),
        ([Ball("p", "flex", None, (9, 9, 9))], "Ball 'p': expected a place in the body 'flex'"),
        ([Ball("p", "a", None, (0, 0))], "places of 3 finite numbers"),
        ([Hinge("p", "a", None, ((0, 0, 0), (0, 0, 0)))], "two ends apart"),
        ([SpringDamper("p", "a", None, ((0, 0, 0), (1, 0, 0)), 0.0)], "not both 0"),
        ([SpringDamper("p", "a", None, ((0, 0, 0), (1, 0, 0)), -1.0)], ">= 0"),
        ([Slider("p", None, "a", ((0, 0, 0), (1, 0, 0)), (2, 0, 0))], "a place beside the line"),
        ([Tied("p", ("a", "x+"), ("flex", "x-"))], "face each other within"),
        ([Bonded("p", "a", "flex")], "nodes of 'a' and 'flex' at the same places, got none"),
        ([Cable("p", "a", None, ((0, 0, 0), (1, 0, 0)), -1.0)], "a length >= 0"),
    ],
)
def test_links_that_cannot_be(links: Any, message: str) -> None:
    flex = Body("flex", brick("flex", (1.0, 1.0, 1.0), (1, 1, 1), Material(1e9, 0.3, 1000.0), origin=(5, 5, 5)))
    blocks = [rigid_box(name, (1.0, 1.0, 1.0), (x, 0, 0), 1.0) for name, x in (("a", 0.0), ("b", 1.0))]
    with pytest.raises(InputError, match=message):
        Linkage(fcsim.build_model([flex, *blocks]), links)


def test_links_that_contradict_supports_are_named() -> None:
    blocks = [rigid_box(name, (1.0, 1.0, 1.0), (x, 0, 0), 1.0) for name, x in (("a", 0.0), ("b", 1.0))]
    directions = ("x", "y", "z", "rx", "ry", "rz")
    supports = [fcsim.Support("a", directions), fcsim.Support("b", directions, velocity=1.0)]
    with pytest.raises(InputError, match="link 'p': expected links and supports that can be kept together"):
        moved(blocks, [Ball("p", "a", "b", (0.5, 0.0, 0.0))], fcsim.Theta(1e-2), 2, supports=supports)


@pytest.mark.parametrize(("unit", "mass"), [(1e-3, 1e-9), pytest.param(1e3, 1e9, marks=pytest.mark.slow)])
def test_links_do_not_depend_on_units(unit: float, mass: float) -> None:
    """A double pendulum in mm and 1e-9 kg, in km and 1e9 kg: the same angles, with as many solves."""
    ends = []
    for u, m in ((1.0, 1.0), (unit, mass)):
        bodies = [rigid_rectangle(n, (u, 0.05 * u), (x * u, 0.0), k * m) for n, x, k in (("a", 0.5, 2.0), ("b", 1.5, 1.0))]
        links = [Ball("1", "a", None, (0.0, 0.0)), Ball("2", "a", "b", (u, 0.0))]
        steps = moved(bodies, links, fcsim.Theta(1e-2), 25, -G * u)
        ends.append((*steps[-1].state.x[[2, 5]], sum(len(step.attempts) for step in steps)))
    assert ends[1] == pytest.approx(ends[0], rel=1e-9)


def test_a_tied_body_in_free_flight_keeps_energy_and_angular_momentum() -> None:
    """Q2 on P2 with meshes that do not match, spun at 5 rad/s: no moment and no work from the tie."""
    material = Material(1e8, 0.3, 1000.0)
    one = brick("p", (1.0, 0.5, 0.5), (2, 1, 1), material, elements="Q2")
    two = brick("q", (1.0, 0.5, 0.5), (2, 2, 2), material, "tetrahedron", elements="P2", origin=(1.0, 0, 0))
    tie = Tied("tie", ("q", "x-"), ("p", "x+"))

    def spun(model: fcsim.Model) -> Any:
        return np.cross([0, 0, 5.0], model.reference - [1.0, 0.25, 0.25]).ravel()

    steps = moved([Body("p", one), Body("q", two)], [tie], fcsim.Theta(4e-3), 12, 0.0, initial=spun)
    moments = [
        np.cross(s.model.reference + s.state.x.reshape(-1, 3), s.model.apply_mass(s.state.v).reshape(-1, 3)).sum(axis=0) for s in steps
    ]
    assert np.ptp(moments, axis=0).max() < 1e-10 * np.abs(moments[0]).max()
    assert drift(steps) < 1e-10 * steps[-1].energy.kinetic


@pytest.mark.each_value
@pytest.mark.parametrize("spin", [100.0, 300.0])
def test_a_gyroscope_that_turns_by_half_a_radian_a_step_closes_in_a_few_rounds(spin: float) -> None:
    """A disc on a ball joint, its axis level at first, beside the equations of a heavy symmetric top: L' = l e x m g, e' = L x e / I.
    Rounds that only add what is missing close by some rate of what it turns by in a step: ten at 0.2 rad, at 0.6 none did."""
    r, l, h = 0.1, 0.2, 2e-3
    disc = rigid_cylinder("disc", r, 0.02, (l, 0, 0), 1.0, axis=(1, 0, 0))
    model = fcsim.build_model([disc], gravity=lambda t: (0, 0, -G))
    linkage = fcsim.Linkage(model, [Ball("pivot", "disc", None, (0, 0, 0))])
    start = fcsim.at_rest(model)
    start.v[3] = spin
    detection = fcsim.ExactContacts(model, 0.3)
    steps = list(fcsim.Simulation(model, detection, fcsim.Theta(h), 40, linkage=linkage, initial=start))
    assert max(len(step.attempts) for step in steps) <= 7
    across, along = disc.inertia[1, 1] + l**2, disc.inertia[0, 0]

    def top(t: float, y: Any) -> Any:
        e, L = y[:3], y[3:]
        return np.concatenate([np.cross(L, e) / across, np.cross(l * e, (0, 0, -G))])

    times = np.array([step.state.t for step in steps])
    begin = (1, 0, 0, along * spin, 0, 0)
    e = solve_ivp(top, (0, times[-1]), begin, t_eval=times, rtol=1e-10, atol=1e-12).y[:3].T
    found = np.array([step.state.x[:3] for step in steps]) / l + (1, 0, 0)
    assert np.abs(found - e).max() < 0.05 * (spin * h) ** 2 * np.abs(e - e[0]).max()


def test_a_loop_that_jams_is_cut_and_closed_not_called_contradictory() -> None:
    """Two bars on parallel hinges and a ball near their dead point, thrown out of their plane: what rounds add hardly changes there, and
    mixed, it led off what can be kept together, which ended the run as links that contradict each other."""
    bars = [rigid_box(f"bar {i}", (1, 0.3, 0.2), (1 + 2 * i, 0, 0), 1.0) for i in range(2)]
    left, knee = (
        Hinge(name, *of, ((x, y, 0), (x, y + 0.3, 0)))
        for name, of, x, y in (("left", ("bar 0", None), 0, 0.0), ("knee", ("bar 1", "bar 0"), 2, 0.1))
    )
    model = fcsim.build_model(bars)
    linkage = Linkage(model, [left, knee, Ball("right", "bar 1", None, (4, 0, 0))])
    start, scheme = fcsim.at_rest(model), fcsim.Theta(2e-3)
    start.v[:] = 50 * np.random.default_rng(0).standard_normal(12)
    start.v.reshape(2, 6)[:, :3] = 0
    steps = list(fcsim.Simulation(model, Nothing(model), scheme, 2, linkage=linkage, initial=start, witness=None))
    assert any(attempt.status == "did not close" for step in steps for attempt in step.attempts), "it does not jam, and tests nothing"
    missing = [linkage.rows(scheme.detection_configuration(model, step.state)).gap for step in steps]
    assert np.abs(missing).max() < 1e-9
