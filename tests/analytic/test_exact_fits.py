"""Exact disks and cylinders in elastic rings, on facets of any length: Lame's pressure of a press fit, the torque at which it slips."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fcsim import DrivenRotation, ExactContacts, Force, Material, QuasiStatic, Simulation, Step, Support, Witness, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import Body, Part, RigidBody, rigid_cylinder, rigid_sphere

INNER, OUTER, TIGHT = 0.02, 0.03, 1e-5  # [m] radii of the ring, by how much the shaft is larger
E, NU = 210e9, 0.3


def ring(around: int, unit: float, length: float | None = None) -> Part:
    """`around` cells of first order around, two across; a layer along z of a length [m], None: in the plane."""
    radii, angle = np.linspace(INNER, OUTER, 3) * unit, 2 * np.pi * np.arange(around) / around
    points = np.array([[r * np.cos(t), r * np.sin(t)] for t in angle for r in radii])
    first, then = 3 * np.arange(around), 3 * np.roll(np.arange(around), -1)
    cells = np.concatenate([np.stack([first + j, first + j + 1, then + j + 1, then + j], axis=1) for j in range(2)])
    outside = np.stack([first + 2, then + 2], axis=1)
    steel = Material(E=E / unit, nu=NU, density=7800.0 / unit**3)
    if length is None:
        return Part(points=points, cells=cells, cell_type="quadrilateral", material=steel, surfaces={"outside": outside}, name="ring")
    n, z = len(points), length * unit / 2
    points = np.concatenate([np.column_stack([points, np.full(n, at)]) for at in (-z, z)])
    sides = {"z-": cells[:, ::-1], "z+": cells + n}
    return Part(points=points, cells=np.hstack([cells, cells + n]), cell_type="hexahedron", material=steel, surfaces=sides, name="ring")


def pressed(part: Part, shaft: RigidBody, more: Sequence[Support | DrivenRotation], steps: int = 1, mu: float = 0.1) -> list[Step]:
    held = [Support("shaft", DIRECTIONS[part.dimension]), *more]
    model = build_model([Body("ring", part), shaft], supports=held)
    scheme = QuasiStatic(1.0, eta=1e4)  # the ring is held by contact alone
    return list(Simulation(model, ExactContacts(model, mu), scheme, steps, witness=Witness(initial="allow")))


def lame() -> float:
    """[Pa] On a rigid shaft, plane strain: u = p a / E' ((c^2 + a^2) / (c^2 - a^2) + nu') = the interference."""
    a, c = INNER, OUTER
    stiffness, nu = E / (1 - NU**2), NU / (1 - NU)
    return TIGHT * stiffness / a / ((c**2 + a**2) / (c**2 - a**2) + nu)


@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize("around", [24, 48])
def test_a_ring_of_chords_on_a_disk_bears_lames_pressure(around: int, unit: float) -> None:
    """The height of the chords is 43 um of 48, beside 10 um of interference: on their middles the disk bore 5.3 times as much."""
    (step,) = pressed(ring(around, unit), rigid_sphere("shaft", (INNER + TIGHT) * unit, (0.0, 0.0), 1.0), [])
    force = step.contact_force[:, 0].sum()
    assert force / (2 * np.pi * INNER * unit) == pytest.approx(lame() / unit, rel=0.01)


@pytest.mark.parametrize("around", [24, pytest.param(64, marks=pytest.mark.slow)])
def test_a_tube_of_long_cells_on_a_cylinder_bears_lames_pressure(around: int) -> None:
    """Held at both ends; cells as long as the tube, whose vertices are those of its rims: 18.5 times as much with 24, 3.5 with 64."""
    length = 0.01
    shaft = rigid_cylinder("shaft", INNER + TIGHT, 2 * length, (0.0, 0.0, 0.0), 1.0, (0.0, 0.0, 1.0))
    ends = [Support("ring", ("z",), side) for side in ("z-", "z+")]
    (step,) = pressed(ring(around, 1.0, length), shaft, ends)
    assert step.contact_force[:, 0].sum() / (2 * np.pi * INNER * length) == pytest.approx(lame(), rel=0.015)


def test_a_press_fit_slips_at_its_torque() -> None:
    """mu N a, when the ring's outer side is turned on: all contacts slide."""
    mu = 0.15
    turned = DrivenRotation("ring", lambda t: 4e-4 * max(t - 1.0, 0.0), (0.0, 0.0), surface="outside")
    shaft = rigid_sphere("shaft", INNER + TIGHT, (0.0, 0.0), 1.0)
    *_, last = pressed(ring(48, 1.0), shaft, [turned], steps=5, mu=mu)
    normal, tangential = last.contact_force.T
    assert abs(tangential.sum()) == pytest.approx(mu * normal.sum(), rel=1e-6)


def test_a_pin_sinks_alike_in_holes_of_few_and_of_many_chords() -> None:
    """2 um of clearance, chords 43 um high with 48 cells, 2.7 um with 192: in the first it jammed, all around."""
    clearance, sinks = 1e-4 * INNER, []
    for around in (48, 192):
        pin = rigid_sphere("shaft", INNER - clearance, (0.0, 0.0), 1.0)
        held = [Support("ring", ("x", "y"), "outside"), Support("shaft", ("x", "rz"))]
        model = build_model([Body("ring", ring(around, 1.0)), pin], supports=held, loads=[Force("shaft", (0.0, -1e6))])
        *_, last = Simulation(model, ExactContacts(model, 0.0), QuasiStatic(1.0, eta=1e6), 4)
        force = last.contact_force_on(model.number["shaft"])
        assert force[1] == pytest.approx(1e6, rel=1e-3)
        sinks.append(-model.rigid_part(last.state.x)[0, 1])
    assert sinks[0] > clearance
    assert sinks[0] == pytest.approx(sinks[1], rel=0.02)
