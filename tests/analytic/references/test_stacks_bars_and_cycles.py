"""Problems of statics and dynamics of no list, each beside its closed form: what stands, slides, strikes, ratchets and goes through."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import (
    Body,
    DrivenRotation,
    Everything,
    ExactContacts,
    QuasiStatic,
    Simulation,
    Support,
    Theta,
    at_rest,
    build_model,
)
from fcsim.mesh import brick, part_from_gmsh, rectangle, rigid_plane, rigid_rectangle, rigid_sphere
from fcsim.mesh.material import Material, Plastic, Thermal, neo_hooke
from fcsim.runtime import gmsh_model

G = 9.81
FLAT, SPACE = ("x", "y", "rz"), ("x", "y", "z", "rx", "ry", "rz")


@pytest.mark.each_value
@pytest.mark.parametrize(("above", "below", "stands"), [(0.275, 0.2, True), (0.26, 0.2, False), (0.5, 0.092, True), (0.5, 0.087, False)])
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_log_on_two_logs(unit: float, above: float, below: float, stands: bool) -> None:
    """Moments of a lower log and its equilibrium: tan(15) between the logs, tan(15) / 3 on the floor (0.2679, 0.0893)."""
    r = 0.05 * unit
    places = {"a": (-r, r), "b": (r, r), "c": (0.0, (1 + np.sqrt(3)) * r)}
    bodies = [rigid_plane("floor", (0, 0), (0, 1)), *(rigid_sphere(name, r, place, 2.0) for name, place in places.items())]
    model = build_model(bodies, supports=[Support("floor", FLAT)], gravity=lambda t: (0, -G * unit))
    mu = {("c", "a"): above, ("c", "b"): above, ("a", "b"): 0.0, ("floor", "*"): below}
    *_, last = Simulation(model, ExactContacts(model, mu), Theta(2e-3), 120)
    fallen = -last.state.x[model.dof_offset[model.number["c"]] + 1] / r
    assert fallen < 1e-9 if stands else fallen > 5e-3


@pytest.mark.parametrize(("held", "times"), [(False, 3), (True, 5)])
def test_a_brick_is_drawn_out_of_a_stack(held: bool, times: int) -> None:
    """Of five, the middle one: what lies on it comes along, and mu 3 W below it is the force; held there, mu 2 W above it as well."""
    mu, weight, size = 0.4, 20.0 * G, (0.2, 0.05)
    bodies = [rigid_rectangle("floor", (4.0, 0.1), (0.0, -0.05), 1.0)]
    bodies += [rigid_rectangle(f"b{k}", size, (0.0, size[1] * (k + 0.5)), 20.0) for k in range(5)]
    pull, stop = Support("b2", ("x",), velocity=0.01), [Support("b3", ("x",))] if held else []
    model = build_model(bodies, supports=[Support("floor", FLAT), pull, *stop], gravity=lambda t: (0, -G))
    steps = list(Simulation(model, Everything(model, mu=mu), Theta(1e-3), 60))
    assert_allclose([step.support_force(pull)[0] for step in steps[20:]], times * mu * weight, rtol=1e-6)


def test_a_billiard_ball_with_backspin() -> None:
    """G.-G. Coriolis (1835): it ends with 5/7 (v - 2/5 R w), rolling, whatever the friction."""
    r, v, w = 0.03, 2.0, 30.0
    bodies = [rigid_plane("table", (0, 0, 0), (0, 0, 1)), rigid_sphere("ball", r, (0, 0, r), 0.2)]
    model = build_model(bodies, supports=[Support("table", SPACE)], gravity=lambda t: (0, 0, -G))
    thrown = np.zeros(model.n_dofs)
    own = int(model.dof_offset[model.number["ball"]])
    thrown[own], thrown[own + 4] = v, -w
    *_, last = Simulation(model, ExactContacts(model, mu=0.2), Theta(2e-3), 300, initial=replace(at_rest(model), v=thrown))
    ends = 5 / 7 * (v - 0.4 * r * w)
    assert_allclose(last.state.v[[own, own + 4]], [ends, ends / r], rtol=1e-6)


def test_bars_of_unlike_impedance_strike() -> None:
    """B. de Saint-Venant: steel on aluminium twice as long: v Z1 Z2 / (Z1 + Z2) while the wave goes to and fro in the first, then
    (Z1 - Z2) / (Z1 + Z2) of it."""
    A, v, n = 0.02, 2.0, 200
    laws = Material(2e11, 0.0, 7800.0), Material(7e10, 0.0, 2700.0)
    c = [float(np.sqrt(law.E / law.density)) for law in laws]
    z = [A * law.density * speed for law, speed in zip(laws, c, strict=True)]
    bars = [rectangle(name, (k * 1.0, A), (40 * k, 1), laws[k - 1], plane="stress") for k, name in ((1, "steel"), (2, "aluminium"))]
    model = build_model([Body("steel", bars[0], translation=(-1.0, 0.0)), Body("aluminium", bars[1], translation=(1e-6, 0.0))])
    thrown = np.zeros(model.n_dofs)
    thrown[: model.dof_offset[1] : 2] = v
    h = 4 / c[0] / n
    initial = replace(at_rest(model), v=thrown)
    steps = list(Simulation(model, Everything(model, mu=0.0), Theta(h, 0.5), n, initial=initial, witness=None))
    force = np.array([step.contact_force_on(1)[0] for step in steps])
    expected = v * z[0] * z[1] / (z[0] + z[1])
    assert_allclose(np.median(force[7:93]), expected, rtol=0.01)
    assert_allclose(np.median(force[114:190]), expected * (z[0] - z[1]) / (z[0] + z[1]), rtol=0.02)


@pytest.mark.parametrize(("mu", "nu"), [(0.3, 0.4), (0.1, 0.3)])
def test_a_column_in_a_silo(mu: float, nu: float) -> None:
    """H. A. Janssen (1895), for a column that presses on its walls by nu / (1 - nu) of what it bears: the floor that sinks away bears
    rho g l (1 - exp(-H / l)), l = w (1 - nu) / (2 mu nu). Stress is not even across the width: 2 %."""
    w, H, rho = 0.1, 1.0, 2000.0
    half = rectangle("column", (w / 2, H), (6, 60), Material(1e6, nu, rho), elements="Q2")
    sinks = Support("column", ("y",), "y-", velocity=-0.02)
    supports = [Support("column", ("x",), "x-"), sinks, Support("wall", FLAT)]
    bodies = [Body("column", half), rigid_rectangle("wall", (0.1, 3.0), (w / 2 + 0.05, 0.5), 1.0)]
    model = build_model(bodies, supports=supports, gravity=lambda t: (0, -G * min(1.0, 4 * t)))
    *_, last = Simulation(model, Everything(model, mu=mu), QuasiStatic(0.125), 16)
    length = w * (1 - nu) / (2 * mu * nu)
    assert_allclose(last.support_force(sinks)[1], rho * G * length * (1 - np.exp(-H / length)) * w / 2, rtol=0.02)


def test_a_slab_under_cycles_of_heat_ratchets() -> None:
    """J. Bree (1967): a slab that bears 0.6 of its yield stress, kept from bending, heated on one side to 2.2 of it and cooled, grows by
    2 s_t / E (1 - 2 sqrt((s_y - s_p) / s_t)) a cycle. Driven with that growth, as fibres have it, it bears what they bear."""
    sp, st, E, alpha = 0.6, 2.2, 1000.0, 1e-5
    per_cycle = 2 * st / E * (1 - 2 * np.sqrt((1 - sp) / st))
    y, eps, plastic = (np.arange(400) + 0.5) / 400, [0.0], np.zeros(400)
    for k in range(1, 49):
        heat = 2 * st / E * y * (1 - abs(1 - k / 8 % 2))
        low, high = -0.1, 0.1
        for _ in range(60):  # the strain at which the fibres bear the load
            middle = 0.5 * (low + high)
            stress = np.clip(E * (middle - heat - plastic), -1, 1)
            low, high = (middle, high) if stress.mean() < sp * min(1.0, k / 2) else (low, middle)
        plastic, eps = middle - heat - stress / E, [*eps, middle]
    assert_allclose(np.diff(eps[16::16]), per_cycle, rtol=1e-3)
    law = Thermal(Plastic(E, 0.3, 1.0, 1.0), alpha, lambda X, t: 2 * st / (E * alpha) * X[:, 1] * (1 - abs(1 - t % 2)))
    slab = rectangle("slab", (0.5, 1.0), (1, 8), law, plane="stress", elements="Q2")
    driven = Support("slab", ("x",), "x+", displacement=lambda t: 0.5 * np.interp(t, np.arange(49) / 8, eps))
    supports = [Support("slab", ("x",), "x-"), Support("slab", ("y",), at=(0.0, 0.0)), driven]
    model = build_model([Body("slab", slab)], supports=supports)
    steps = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(1 / 8), 32))
    assert_allclose([step.support_force(driven)[0] for step in steps[3:]], sp, rtol=3e-3)


@pytest.mark.slow
def test_a_square_bar_twisted_till_it_flows() -> None:
    """A. Nadai (1923), the heap of sand: k a^3 / 3, from above; ends that do not warp and cells of 1/6 of the side take 1 % more."""
    sy, a = 1.0, 1.0
    bar = brick("bar", (a, a, 3 * a), (6, 6, 6), Plastic(500.0, 0.3, 1.0, sy), elements="Q2")
    supports = [
        Support("bar", ("x", "y", "z"), "z-"),
        DrivenRotation("bar", lambda t: 0.06 * t, (a / 2, a / 2, 0.0), (0.0, 0.0, 1.0), surface="z+"),
    ]
    model = build_model([Body("bar", bar)], supports=supports)
    *_, last = Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.125), 8, witness=None)
    end = np.unique(bar.surfaces["z+"])
    (x, y), (fx, fy) = (bar.points[end][:, :2] - a / 2).T, last.support_impulse.reshape(-1, 3)[end, :2].T
    assert_allclose((x * fy - y * fx).sum(), sy / np.sqrt(3) * a**3 / 3, rtol=0.015)


@pytest.mark.slow
def test_a_rubber_roller_is_pushed_through_a_smooth_slot() -> None:
    """A roller of 100 mm between two posts 85 mm apart: what is put in until it is half way comes back, and it leaves as it came."""
    r, gap, n = 0.05, 0.085, 45
    with gmsh_model("roller") as gmsh:
        gmsh.option.setNumber("Mesh.MeshSizeMax", r / 4)
        gmsh.model.occ.addDisk(0, 0, 0, r, r)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="roller")
        gmsh.model.mesh.generate(2)
        part = part_from_gmsh(gmsh, "roller", neo_hooke(1e6, 0.45, 1000.0), elements="P2")
    posts = [rigid_sphere(name, r, (side * (r + gap / 2), -0.09), 1.0) for name, side in (("left", -1), ("right", 1))]

    def core(x: np.ndarray) -> np.ndarray:
        return np.hypot(*x) < 0.35 * r

    push = Support("roller", ("y",), at=core, displacement=lambda t: -0.18 * t)
    supports = [push, Support("roller", ("x",), at=core), *(Support(post.name, FLAT) for post in posts)]
    model = build_model([Body("roller", part), *posts], supports=supports)
    steps = list(Simulation(model, ExactContacts(model, mu=0.0), QuasiStatic(1 / n), n))
    force = np.array([step.support_force(push)[1] for step in steps])
    work = -0.18 / n * force
    assert force.min() < -2000 and force.max() > 2000
    assert abs(work.sum()) < 0.01 * work[work > 0].sum()
    assert steps[-1].energy.elastic < 1e-6 * max(step.energy.elastic for step in steps)
