"""Statics that go on in another equilibrium say so, and those that stay on their path do not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import BodyForce
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Cohesive, Compliant, Springs
from fcsim.mesh import Body, Part
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material, saint_venant_kirchhoff
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

ANYWHERE = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)


def arch(load: float, h: float, rise: float = 0.1) -> Simulation:
    """A half sine of 2 m and its rise, 3 cm thick, between clamps, under a weight of `load` t [N/m^3] until t = 2."""
    strip = rectangle("arch", (2.0, 0.03), (40, 2), saint_venant_kirchhoff(1e9, 0.0, 1.0))
    points = strip.points + np.stack([np.zeros(len(strip.points)), rise * np.sin(np.pi * strip.points[:, 0] / 2)], axis=1)
    part = Part("arch", points, strip.cells, strip.cell_type, strip.surfaces, strip.material)
    supports = [Support("arch", ("x", "y"), "x-"), Support("arch", ("x", "y"), "x+")]
    model = build_model([Body("arch", part)], supports=supports, loads=[BodyForce("arch", (0.0, -load), lambda t: t)])
    return Simulation(model, Everything(model, 0.0), QuasiStatic(h), round(2 / h), limits=ANYWHERE, witness=None)


def snaps(simulation: Simulation) -> list[tuple[float, str]]:
    """Times of the steps that say so, and what they say."""
    return [(step.state.t, remark) for step in simulation for remark in step.remarks if "released" in remark]


@pytest.mark.parametrize("h", [pytest.param(0.1, marks=pytest.mark.slow), 0.2])
def test_an_arch_that_snaps_through_is_named_once_with_what_it_releases(h: float) -> None:
    """Under a load that is nearly constant meanwhile, P dx - dE is released: found from positions and energies on both sides."""
    simulation = arch(5e5, h)
    model, found, before = simulation.model, [], None
    for step in simulation:
        told = [remark for remark in step.remarks if "released" in remark]
        if told and before is not None:
            shares = [model.load(s.state.t) for s in (before, step)]
            dx = step.state.x - before.state.x
            found.append(0.5 * float((shares[0] + shares[1]) @ dx) - (step.energy.elastic - before.energy.elastic))
            assert f"{found[-1]:.3g} J are released" in told[0] and "another equilibrium" in told[0]
            middle = np.argmin(np.linalg.norm(model.reference - [1.0, 0.1], axis=1))
            assert model.positions(step.state.x)[middle, 1] < -0.05 < 0.0 < model.positions(before.state.x)[middle, 1]
        before = step
    assert len(found) == 1 and found[0] > 100


def test_an_arch_below_its_load_and_one_that_hangs_say_nothing() -> None:
    assert not snaps(arch(2e5, 0.2))
    assert not snaps(arch(5e5, 0.2, rise=-0.1))


def test_without_a_snap_what_is_left_is_of_third_order_in_the_step() -> None:
    """(f_0 + f_1) . dx / 2 - dE of the arch that hangs, a step and half of it at the same time."""
    left = []
    for h in (0.4, 0.2):
        steps = list(arch(5e5, h, rise=-0.1))
        before, step = (next(s for s in steps if abs(s.state.t - t) < 1e-9) for t in (1.2, 1.2 + h))
        force = [step.model.load(s.state.t) for s in (before, step)]
        work = 0.5 * float((force[0] + force[1]) @ (step.state.x - before.state.x))
        left.append(abs(work - (step.energy.elastic - before.energy.elastic)))
    assert_allclose(np.log2(left[0] / left[1]), 3.0, atol=0.5)


@pytest.mark.parametrize(("unit", "E", "density"), [(1.0, 2e9, 1000.0), (1e3, 2e3, 1e-9)])
def test_a_body_that_is_carried_along_says_nothing(unit: float, E: float, density: float) -> None:
    """Its strain and energy are zero but for round-off, of the coordinates and of the way; unit: of length in m; mm with MPa and tonnes."""
    material = saint_venant_kirchhoff(E, 0.35, density)
    part = rectangle("bar", (0.01 * unit, 0.001 * unit), (30, 3), material)
    floor = rigid_rectangle("floor", (0.1 * unit, 0.01 * unit), (0.0, -0.01 * unit), 1.0)
    supports = [Support("bar", ("y",), "x-"), Support("bar", ("x",), "x-", velocity=6e-3 * unit), Support("floor", ("x", "y", "rz"))]
    model = build_model([Body("bar", part), floor], supports=supports)
    simulation = Simulation(model, Everything(model, 0.3), QuasiStatic(0.05), 20, limits=ANYWHERE, witness=None)
    steps = list(simulation)
    assert not [remark for step in steps for remark in step.remarks if "released" in remark]
    moved = model.positions(steps[-1].state.x)[: len(part.points)] - part.points
    assert_allclose(moved, np.broadcast_to([6e-3 * unit, 0.0], moved.shape), atol=1e-9 * unit)


def test_what_dashpots_of_a_joint_take_is_none_of_it() -> None:
    """Blocks pressed together at 1e-4 m a unit of time on k = 1e8 Pa/m and c = 1e9 Pa s/m: k x + c x'."""
    stiff = Material(1e12, 0.0, 1000.0)
    lower = Body("lower", rectangle("lower", (1.0, 1.0), (1, 1), stiff), translation=np.array([0.0, -1.0]))
    upper = Body("upper", rectangle("upper", (1.0, 1.0), (1, 1), stiff))
    supports = [
        Support("lower", ("x", "y"), "y-"),
        Support("upper", ("y",), "y+", displacement=lambda t: -1e-4 * t),
        Support("upper", ("x",), "y+"),
    ]
    model = build_model([lower, upper], supports=supports)
    pair = SurfacePair(contact_surface(model, [("upper", "y-")]), contact_surface(model, [("lower", "y+")]), 0.5, 0.05, "faces")
    law = Compliant(Springs(normal=1e8, tangential=1e8, normal_damping=1e9))
    steps = list(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, law=law), 4, witness=None))
    assert_allclose(steps[-1].contact_force_on(1)[1], 1e8 * 4e-4 + 1e9 * 1e-4, rtol=1e-3)
    assert not [remark for step in steps for remark in step.remarks if "released" in remark]


def glued(G: float, h: float, steps: int, springs: Springs | None = None) -> Simulation:
    """Two blocks of 1 m together, E = 1e9 Pa, glued by 1e5 Pa and drawn apart by 1 m/s: they give 1e-9 m per Pa, the glue 2 G / 1e10."""
    stone = Material(1e9, 0.0, 1000.0)
    bodies = [Body("lower", rectangle("lower", (1.0, 0.5), (3, 2), stone))]
    bodies.append(Body("upper", rectangle("upper", (1.0, 0.5), (5, 2), stone), translation=(0.0, 0.5)))
    supports = [Support("lower", ("x", "y"), "y-"), Support("upper", ("x",), "y+"), Support("upper", ("y",), "y+", velocity=1.0)]
    model = build_model(bodies, supports=supports)
    pair = SurfacePair(contact_surface(model, [("upper", "y-")]), contact_surface(model, [("lower", "y+")]), 0.3, 0.02, "mortar")
    law = Cohesive(tension=1e5, mode_1=G, mode_2=G, springs=springs)
    return Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(h, law=law), steps)


@pytest.mark.parametrize("h", [3e-4, 1e-3])
def test_glue_that_breaks_slower_than_its_blocks_give_way_says_nothing(h: float) -> None:
    """Along one path of equilibria; what opened glue loses of its force was said to be released."""
    assert not snaps(glued(200.0, h, 5))


def test_glue_that_breaks_faster_than_its_blocks_give_way_snaps() -> None:
    """At 0.78 of its strength they hold 0.78^2 5 J and are given 0.78 (0 + 1e5) / 2 times 3.9e-5 m until it is gone, which takes 1 J."""
    ((_, said),) = snaps(glued(1.0, 3.9e-5, 3))
    assert float(said.split(": ")[1].split(" J")[0]) == pytest.approx(0.78**2 * 5 + 0.78e5 / 2 * 3.9e-5 - 1.0, rel=0.01)


@pytest.mark.parametrize("h", [3.9e-5, 9e-5])
def test_glue_on_springs_releases_what_they_held(h: float) -> None:
    """They give 1e-9 m per Pa as the blocks do, together 2e-4 m at the strength, the glue 1.2e-4: at f of it they hold f^2 10 J and are
    given f 1e5 / 2 h until it is gone, which takes 6 J. The springs' part was counted as taken by the fracture: no snap was named."""
    f = h * (2e-4 // h) / 2e-4
    ((_, said),) = snaps(glued(6.0, h, 6, Springs(normal=1e9, tangential=1e9)))
    assert float(said.split(": ")[1].split(" J")[0]) == pytest.approx(f**2 * 10 + f * 1e5 / 2 * h - 6.0, rel=0.01)


def test_glue_on_springs_that_breaks_slowly_says_nothing() -> None:
    """The glue gives 3e-4 m, beyond what blocks and springs give at its strength."""
    assert not snaps(glued(15.0, 9e-5, 6, Springs(normal=1e9, tangential=1e9)))
