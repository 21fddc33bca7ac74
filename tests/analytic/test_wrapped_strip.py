"""A strip bent on a round former, beside the beam: what lies round it has its curvature and no shear, and bears at its end alone."""

from __future__ import annotations

import pytest

from fcsim import ExactContacts, QuasiStatic, Simulation, Support, Traction, build_model
from fcsim.mesh import Body, rectangle, rigid_sphere
from fcsim.mesh.material import saint_venant_kirchhoff
from fcsim.timestep import Step


def pressed(cells: int, steps: int, P: float) -> Step:
    """The last step of a strip that is clamped at its end on a former of 5 m, and whose tip P [N/m] draws down."""
    strip = rectangle("strip", (1.0, 0.01), (cells, 1), saint_venant_kirchhoff(1e9, 0.0, 1000.0), elements="Q2", plane="stress")
    model = build_model(
        [rigid_sphere("former", 5.0, (0.0, -5.0), 1.0), Body("strip", strip)],
        supports=[Support("former", ("x", "y", "rz")), Support("strip", ("x", "y"), "x-")],
        loads=[Traction("strip", "x+", (0.0, -P / 0.01), lambda t: t)],
    )
    *_, last = Simulation(model, ExactContacts(model, 0.0), QuasiStatic(1.0 / steps), steps)
    return last


def test_a_clamped_strip_presses_its_former_with_the_force_at_its_tip() -> None:
    """P L > E I / R: M = E I / R where the strip lies on the former, so that the clamp bears no force and the former P.

    On the middles of its chords, their height off at the vertices, the clamp drew and the former bore eight times as much.
    """
    last = pressed(24, 2, 30.0)
    assert last.contact_force_on(last.model.number["former"])[1] == pytest.approx(-30.0, rel=0.01)


def test_a_strip_of_many_cells_comes_to_lie_round_its_former_in_a_few_problems() -> None:
    """Newton's method converges quadratically; with two middles of chords more left out at each iterate it took 31 of its 40."""
    assert len(pressed(100, 1, 30.0).linearised) < 10
