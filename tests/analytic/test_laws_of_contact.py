"""Penetration that exists, flat impacts, and energy that contact may not create: exact answers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, Velocity
from fcsim.contact_law.coulomb import RECOVERY
from fcsim.mesh.blocks import rigid_box, rigid_rectangle
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.creation import EnergyCreated
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

G = 9.81
HELD_3D = ("x", "y", "z", "rx", "ry", "rz")


def block_in_floor(depth: float, size: float, h: float, steps: int, law: Gap, mass: float = 1600.0, **options: float) -> list[Step]:
    """A rigid cube that begins `depth` inside a held floor, under its weight."""
    block, floor = (
        rigid_box("block", (size,) * 3, (0, 0, size / 2 - depth), mass),
        rigid_box("floor", (9 * size,) * 3, (0, 0, -4.5 * size), 1.0),
    )
    model = build_model([block, floor], supports=[Support("floor", HELD_3D)], gravity=lambda t: (0, 0, -G))
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), 0.5, 0.1 * size)
    return list(Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=law), steps, witness=None, **options))


@pytest.mark.parametrize(("size", "mass"), [(0.2, 1600.0), (20.0, 1e3), (2e-4, 1.0)])
def test_a_block_that_begins_in_the_floor_is_pushed_out_slowly(size: float, mass: float) -> None:
    """At recovery sizes a second, so that after depth / (recovery size) it lies on the floor; its kinetic energy is that of this speed."""
    depth, speed = 0.05 * size, RECOVERY * size
    h = depth / speed / 50
    steps = block_in_floor(depth, size, h, 60, Gap(), mass, created=np.inf)
    heights = np.array([step.state.x[2] for step in steps])
    velocities = np.array([step.state.v[2] for step in steps])
    within = 1e-5 + 1e-8 * G * h / speed  # a solve is right to 1e-8 of the velocity that gravity gives in a step
    assert velocities.max() <= speed * (1 + within)
    assert_allclose(velocities[1:48], speed, rtol=within)
    assert heights[-1] <= depth + speed**2 / (2 * G) + speed * h and heights.max() >= depth * (1 - 1e-6)
    assert max(step.energy.kinetic for step in steps) <= 0.5 * mass * speed**2 * (1 + 2 * within)


def test_the_law_of_the_wall_throws_it_out_and_the_run_says_so() -> None:
    """In one step by depth / h; a run stops there with the joules, unless they are allowed."""
    with pytest.raises(EnergyCreated, match=r"step 1, .*contacts have created .* J.*'block' in 'floor' by 0.01 m"):
        block_in_floor(0.01, 0.2, 5e-3, 10, Gap(recovery=np.inf))
    steps = block_in_floor(0.01, 0.2, 5e-3, 3, Gap(recovery=np.inf), created=np.inf)
    assert steps[0].state.v[2] == pytest.approx(0.01 / 5e-3, rel=1e-6)
    assert steps[0].ledger.created == pytest.approx(1600 * (0.5 * 2.0**2 + G * 0.5 * 0.01), rel=0.02)


def cradle(e: float, steps: int = 40) -> list[Step]:
    """Five flat frictionless squares side by side but for 1 mm; the first comes at 1 m/s."""
    side, gap, h = 0.1, 1e-3, 5e-4
    bodies = [rigid_rectangle(f"body {k}", (side, side), (k * (side + gap), 0.3 + 1e-3 * np.pi), 2.0) for k in range(5)]
    model = build_model(bodies)
    pairs = [
        SurfacePair(contact_surface(model, [(f"body {a}", s)]), contact_surface(model, [(f"body {b}", m)]), 0.0, 0.02)
        for k in range(4)
        for a, s, b, m in ((k, "x+", k + 1, "x-"), (k + 1, "x-", k, "x+"))
    ]
    initial = at_rest(model)
    initial.v[0] = 1.0
    solver = SolverSettings(tol=1e-11)  # two digits below what is asked of the velocities
    return list(Simulation(model, Detector(pairs, model.n_nodes), Theta(h, law=Velocity(e)), steps, solver, initial=initial))


def test_newtons_cradle_leaves_without_spin() -> None:
    """Flat impacts one after the other hand the velocity on: only the last moves, and nothing turns."""
    last = cradle(1.0)[-1].state
    v = last.v.reshape(5, 3)
    assert_allclose(v[:, 2], 0, atol=1e-9)
    assert_allclose(v[:, 1], 0, atol=1e-9)
    assert_allclose(v[:, 0], [0, 0, 0, 0, 1], atol=1e-9)


def test_an_inelastic_row_moves_on_together_without_spin() -> None:
    v = cradle(0.0, 60)[-1].state.v.reshape(5, 3)
    assert_allclose(v[:, 1:], 0, atol=1e-9)
    assert v[:, 0].sum() == pytest.approx(1.0, abs=1e-9)
    assert np.all(np.diff(v[:, 0]) >= -1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("h", [1e-3, 5e-4])
def test_a_frictionless_tumbling_box_keeps_its_energy(h: float) -> None:
    """With restitution 1 at theta = 1/2, through its impacts on a plane: up to O(h^2) of the turning of its inertia."""
    box, floor = rigid_box("box", (0.4, 0.25, 0.1), (0, 0, 0.5), 3.0), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    model = build_model([box, floor], supports=[Support("floor", HELD_3D)], gravity=lambda t: (0, 0, -G))
    pair = SurfacePair(
        contact_surface(model, [("box", side) for side in box.surfaces]), contact_surface(model, [("floor", "z+")]), 0.0, 0.05
    )
    x = np.zeros(model.n_dofs)
    v = np.zeros(model.n_dofs)
    v[:6] = [0.1, 0, -1.0, 5.0, 3.0, 2.0]
    run = Simulation(
        model, Detector([pair], model.n_nodes), Theta(h, law=Velocity(1.0)), round(0.9 / h), initial=State(0.0, x, v), witness=None
    )

    def energy(state: State) -> float:
        return 0.5 * float(state.v @ model.apply_mass(state.v, model.rigid_mass(state.x))) + 3.0 * G * float(state.x[2])

    steps = list(run)
    energies = np.array([energy(State(0.0, x, v)), *(energy(step.state) for step in steps)])
    struck = np.array([bool(np.any(step.result.r)) for step in steps])
    assert struck.sum() >= 3
    assert np.abs(np.diff(energies)[struck]).max() < 150 * h**2 * energies[0]
    assert_allclose(energies, energies[0], rtol=500 * h**2)
    assert steps[-1].ledger.created <= 1e-9 * energies[0]
