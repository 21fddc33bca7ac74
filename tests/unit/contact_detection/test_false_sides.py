"""Explicit pairs that hold several sides of a body: a side face that is not touched holds nothing. Answers by statics."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair, split_at_sharp_edges
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.simulation import Simulation, SolverSettings, Step
from fcsim.timestep.theta import Theta

G = 9.81


def on_floor(bodies: Sequence[Body | RigidBody], held: Sequence[str], beta: float = 0.0) -> Model:
    flat = isinstance(bodies[0], RigidBody) and bodies[0].points.shape[1] == 2
    directions = ("x", "y", "rz") if flat else ("x", "y", "z", "rx", "ry", "rz")
    weight = (0, -G) if flat else (0, 0, -G)
    return build_model(bodies, supports=[Support(name, directions) for name in held], gravity=lambda t: weight, beta=beta)


def all_sides(model: Model) -> Detector:
    """All sides of all bodies with each other, split at their edges."""
    sides = contact_surface(model, [(body.name, name) for body in model.bodies for name in body.surfaces])
    parts = split_at_sharp_edges(sides, model.reference)
    return Detector([SurfacePair(a, b, 0.6, 1e-3) for a in parts for b in parts], model.n_nodes)


def last_of(model: Model, detector: Detector, steps: int) -> Step:
    return list(Simulation(model, detector, Theta(1e-3), steps, SolverSettings(name="auto", tol=1e-9)))[-1]


@pytest.mark.parametrize(("kind", "bearing"), [("deformable", 0.02), ("deformable", 0.05), ("rigid", 0.08), ("one facet a face", 0.02)])
def test_a_lintel_on_two_piers(kind: str, bearing: float) -> None:
    """Its corners are `bearing` behind the side planes of the piers, whose tops alone it touches."""
    size, weight = (1.0, 0.2, 0.2), 0.04 * 2000 * G
    piers = [rigid_box(f"pier {x}", (0.4, 0.2, 0.5), (x, 0.1, -0.25), 1.0) for x in (bearing - 0.2, 1.2 - bearing)]
    if kind == "deformable":
        lintel: Body | RigidBody = Body("lintel", brick("lintel", size, (20, 4, 4), Material(3e10, 0.2, 2000.0)))
    else:
        lintel = rigid_box("lintel", size, (0.5, 0.1, 0.1), 80.0, (20, 4, 4) if kind == "rigid" else None)
    names = [pier.name for pier in piers]
    model = on_floor([*piers, lintel], names, beta=1e-3 if kind == "deformable" else 0.0)
    last = last_of(model, all_sides(model), 40)
    assert_allclose(np.abs(last.contacts.frame[:, 0, 2]), 1.0, atol=1e-4)
    force = sum(-last.contact_force_on(model.number[name]) for name in names)
    assert_allclose(force, [0, 0, weight], atol=(5e-3 if kind == "deformable" else 1e-6) * weight)
    assert np.abs(last.state.v).max() < 1e-4


@pytest.mark.parametrize("shift", [0.1, 0.3, 0.6, 0.9])
def test_two_shifted_cubes(shift: float) -> None:
    """The upper one rests, or topples about the edge with alpha = m g a / (m/6 + m (a^2 + 1/4))."""
    model = on_floor([rigid_box("floor", (1, 1, 1), (0, 0, -0.5), 1.0), rigid_box("cube", (1, 1, 1), (shift, 0, 0.5), 1e3)], ["floor"])
    last = last_of(model, all_sides(model), 20)
    arm = max(shift - 0.5, 0.0)
    assert_allclose(last.state.v[model.dof_offset[1] + 4], G * arm / (1 / 6 + arm**2 + 0.25) * 0.02, rtol=0.02, atol=1e-8)


def test_shifted_rectangles_in_the_plane() -> None:
    model = on_floor([rigid_rectangle("floor", (2, 1), (0, -0.5), 1.0), rigid_rectangle("block", (2, 1), (0.9, 0.5), 10.0)], ["floor"])
    last = last_of(model, all_sides(model), 10)
    assert_allclose(last.contact_force_on(1), [0, 10 * G], atol=1e-6)
    assert_allclose(np.abs(last.contacts.frame[:, 0, 1]), 1.0)
    body = Body("block", rectangle("block", (2, 1), (8, 4), Material(1e9, 0.2, 10.0)), translation=(0.0, 0.0))
    model = on_floor([rigid_rectangle("floor", (2, 1), (0.1, -0.5), 1.0), body], ["floor"])
    contacts = all_sides(model)(model.positions(np.zeros(model.n_dofs)))
    assert_allclose(np.abs(contacts.frame[:, 0, 1]), 1.0)


def test_stacked_cubes_shifted_by_half() -> None:
    """27 of them: floor force = weight."""
    places = [(i + k % 2 / 2, j + k % 2 / 2, k + 0.5) for k in range(3) for j in range(3) for i in range(3)]
    bodies = [rigid_box(str(place), (1, 1, 1), place, 1000.0) for place in places]
    model = on_floor([rigid_box("floor", (12, 12, 1), (1, 1, -0.5), 1.0), *bodies], ["floor"])
    last = last_of(model, all_sides(model), 2)
    assert_allclose(last.contact_force_on(0), [0, 0, -27e3 * G], atol=27e3 * G * 1e-6)
    assert np.abs(last.state.v).max() < 1e-7


@pytest.mark.parametrize("candidates", ["nodes", "gauss"])
def test_all_lower_on_all_upper_faces_of_a_running_bond(candidates) -> None:
    """A lower corner stands at the foot of its neighbour in the course, a block's height behind the neighbour's upper face."""
    blocks = [rigid_box("floor", (4, 1, 0.1), (0.7, 0, -0.05), 1.0)]
    for course in range(4):
        x = 0.0
        for number, length in enumerate([0.175, 0.35, 0.35, 0.35, 0.175] if course % 2 else [0.35] * 4):
            blocks.append(
                rigid_box(f"{course} {number}", (length, 0.2, 0.175), (x + length / 2, 0, 0.175 * course + 0.0875), 20 * length / 0.35)
            )
            x += length
    model = on_floor(blocks, ["floor"])
    lower, upper = (contact_surface(model, [(block.name, side) for block in blocks]) for side in ("z-", "z+"))
    last = last_of(model, Detector([SurfacePair(lower, upper, 0.6, 1e-3, candidates)], model.n_nodes), 5)
    assert_allclose(last.contact_force_on(0), [0, 0, -320 * G], atol=320 * G * 1e-6)
    assert np.abs(last.state.v).max() < 1e-7


@pytest.mark.parametrize("depth", [1e-6, 1e-3, 0.02])
def test_what_is_pressed_in_is_held_all_the_same(depth: float) -> None:
    """Cubes face to face, flush at their other sides, one `depth` inside the other: its four corners are held, and by that face alone."""
    model = on_floor([rigid_box("one", (1, 1, 1), (0, 0, 0), 1.0), rigid_box("other", (1, 1, 1), (1 - depth, 0, 0), 1.0)], ["one"])
    one, other = (contact_surface(model, [(name, side) for side in ("x-", "x+", "y-", "y+", "z-", "z+")]) for name in ("one", "other"))
    first, second = (split_at_sharp_edges(sides, model.reference) for sides in (one, other))
    pairs = [SurfacePair(b, a, 0.6, 1e-3) for a in first for b in second]
    contacts = Detector(pairs, model.n_nodes)(model.reference)
    assert_allclose(contacts.gap, -depth, atol=1e-12)
    assert_allclose(contacts.frame[:, 0], np.tile([1.0, 0, 0], (4, 1)))
