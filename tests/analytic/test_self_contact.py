"""Bodies that fold until they meet themselves, against beam theory: the load at which they touch, and what the contact carries beyond it.

All are of beams so slender and loads so placed that what is added after touching goes through the contact alone.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything, ExactContacts
from fcsim.errors import Penetration
from fcsim.mesh.exact.rigid_shapes import rigid_sphere
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta
from fcsim.witness import Witness
from tests.unit.contact_detection.general.strips import arc, fork, hollow, strip

E = 1e9
RUBBER = Material(E, 0.0, 1000.0)


def carried(model: Model, direction: int, steps: int = 20) -> np.ndarray:
    """Sum of the contacts' forces [N] along an axis after each load step, times going from 0 to 1."""
    exact = any(body.shape is not None for body in model.rigid)
    simulation = Simulation(
        model,
        ExactContacts(model, 0.0) if exact else Everything(model, 0.0),
        QuasiStatic(1 / steps),
        steps,
        SolverSettings(name="auto", tol=1e-9),
    )
    return np.array([np.abs(step.force_in_space[:, direction]).sum() for step in simulation])


def against(found: np.ndarray, touching: float, most: float, rtol: float, share: float = 1.0) -> None:
    """share max(0, P - P*) with P rising to `most`; two steps around P* may see the contact late by a step."""
    load = most * (np.arange(len(found)) + 1) / len(found)
    sure = np.abs(load - touching) > 1.1 * most / len(found)
    assert_allclose(found[sure], share * np.maximum(0, load - touching)[sure], atol=rtol * touching)


@pytest.mark.parametrize(("unit", "beside"), [(1.0, ()), (1e-3, ()), (1.0, ("disk",))])
def test_the_legs_of_a_spring_are_pressed_together(unit: float, beside: tuple[str, ...]) -> None:
    """Two cantilevers: each tip moves by P L^3 / 3 E I, they touch at P* = 3 E I gap / 2 L^3; also beside a disk that only `ExactContacts`
    know."""
    L, t, gap = 1.0 * unit, 0.05 * unit, 0.02 * unit
    part = fork(RUBBER, L, t, gap, 40, 2, plane="stress", elements="Q1-enhanced", thickness=unit)
    touching = 1.5 * E * (unit * t**3 / 12) * gap / L**3
    most = 3 * touching
    loads = [Traction("fork", f"{which} tip", (0, sign * most / (t * unit)), lambda s: s) for which, sign in (("upper", -1), ("lower", 1))]
    disks = [rigid_sphere(name, 0.1, (3.0, 0.0), 1.0) for name in beside]
    supports = [Support("fork", ("x", "y"), "base"), *(Support(name, ("x", "y", "rz")) for name in beside)]
    model = build_model([Body("fork", part), *disks], supports=supports, loads=loads)
    against(carried(model, 1), touching, most, 0.01)


@pytest.mark.parametrize("cells", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_plates_in_space_are_pressed_together(cells: int) -> None:
    """The legs of the spring above as plates in space, one cell thick: what is added beyond P* goes through the contact."""
    L, t, gap, wide, steps = 1.0, 0.05, 0.02, 0.2, 5
    flat = fork(RUBBER, L, t, gap, 20, cells, plane="stress", elements="Q1-enhanced", thickness=wide)
    n = len(flat.points)
    points = np.concatenate([np.insert(flat.points, 2, z, axis=1) for z in (0.0, wide)])
    surfaces = {name: np.concatenate([edges, edges[:, ::-1] + n], axis=1) for name, edges in flat.surfaces.items()}
    part = Part(
        "fork", points, np.concatenate([flat.cells, flat.cells + n], axis=1), "hexahedron", surfaces, RUBBER, elements="Q1-enhanced"
    )
    touching = 1.5 * E * (wide * t**3 / 12) * gap / L**3
    most = 3 * touching
    loads = [
        Traction("fork", f"{which} tip", (0, sign * most / (t * wide), 0), lambda s: s) for which, sign in (("upper", -1), ("lower", 1))
    ]
    model = build_model([Body("fork", part)], supports=[Support("fork", ("x", "y", "z"), "base")], loads=loads)
    against(carried(model, 1, steps), touching, most, 0.01)


def test_a_split_ring_closes() -> None:
    """Forces P at the ends turn them so that their inner corners meet, at c R, c = 1 - t / 2 R. By Castigliano, M = P R (1 - cos a) less
    N R (c - cos a): int (c - cos)(1 - cos) = 2 pi c + pi and int (c - cos)^2 = 2 pi c^2 + pi over the ring close and hold them."""
    R, t, gap = 1.0, 0.04, 0.05
    line, across = arc(R, gap / 2 / R, 2 * np.pi - gap / 2 / R, 240)
    part = strip("ring", line, across, t, 2, RUBBER, plane="stress", elements="Q1-enhanced")
    opposite = np.flatnonzero((np.abs(part.points[:, 1]) < 1e-9) & (part.points[:, 0] < 0))
    held = np.stack([opposite[:-1], opposite[1:]], axis=1)
    part = Part("ring", part.points, part.cells, part.cell_type, {**part.surfaces, "held": held}, RUBBER, "stress", elements=part.elements)
    c = 1 - t / 2 / R
    touching = c * gap * E * t**3 / 12 / (R**3 * (2 * np.pi * c + np.pi))
    most = 3 * touching
    # counter-clockwise: the line begins above the slit and ends below it
    loads = [Traction("ring", "begin", (0, -most / t), lambda s: s), Traction("ring", "end", (0, most / t), lambda s: s)]
    model = build_model([Body("ring", part)], supports=[Support("ring", ("x", "y"), "held")], loads=loads)
    against(carried(model, 1), touching, most, 0.01, share=(2 * c + 1) / (2 * c**2 + 1))


@pytest.mark.parametrize("width", [None, 0.1])
def test_a_hollow_section_is_pinched(width: float | None) -> None:
    """Two plates between stiff webs, clamped there: the middle of each moves by P (L^3 / 192 E I + L / 4 k G A), k = 5/6."""
    L, t, gap, b = 1.0, 0.04, 0.02, width or 1.0
    kind = {"plane": "stress"} if width is None else {}
    part = hollow(RUBBER, L, t, gap, width, elements="Q1-enhanced", **kind)
    free = 0.9 * L
    touching = gap / 2 / (free**3 / (192 * E * b * t**3 / 12) + free / (4 * 5 / 6 * E / 2 * b * t))
    most = 2.5 * touching
    zero = () if width is None else (0.0,)
    pressure = most / (L / 20 * b)
    loads = [Traction("hollow", side, (0, sign * pressure, *zero), lambda s: s) for side, sign in (("up", -1), ("down", 1))]
    directions = ("x", "y") if width is None else ("x", "y", "z")
    model = build_model([Body("hollow", part)], supports=[Support("hollow", directions, "webs")], loads=loads)
    against(carried(model, 1), touching, most, 0.04)


@pytest.mark.parametrize("kinematics", ["linear", "turning"])
def test_a_flying_spring_claps(kinematics: str) -> None:
    """Momentum is kept, no energy made, the legs never in each other; told not to touch itself, the run ends by the witness."""
    model = build_model(
        [Body("fork", fork(Material(1e7, 0.3, 1000.0), 1.0, 0.05, 0.04, 30, 2, elements="Q1-enhanced"))], kinematics=kinematics
    )
    x = model.reference
    v = np.zeros_like(x)
    legs = x[:, 0] > 0
    v[legs, 1] = -2 * np.sign(x[legs, 1]) * x[legs, 0] ** 2
    v[:, 1] += 1.0
    flat = np.zeros(model.n_dofs)
    flat[model.dof_of_node.ravel()] = v.ravel()
    start = State(0.0, at_rest(model).x, flat)
    each = Witness(every=1, tolerance=2e-3)

    def clap(exclude: list[tuple[str, str]]) -> list[Step]:
        everything = Everything(model, 0.2, exclude=exclude)
        return list(Simulation(model, everything, Theta(2e-3), 20, SolverSettings(name="auto", tol=1e-8), start, witness=each))

    steps = clap([])
    assert max(step.contact_force[:, 0].sum() for step in steps) > 100
    momentum = [model.apply_mass(state.v)[model.dof_of_node].sum(axis=0) for state in (start, steps[-1].state)]
    assert_allclose(momentum[1], momentum[0], atol=1e-9 * np.abs(momentum[0]).max())
    ledger = steps[-1].ledger
    assert ledger.created < 1e-4 * ledger.supplied
    with pytest.raises(Penetration, match="'fork' and 'fork'"):
        clap([("fork", "fork")])
