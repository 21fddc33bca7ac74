"""A strip bent on a round former, beside the beam: what lies round it has its curvature and no shear, and bears at its end alone."""

from __future__ import annotations

import pytest

from fcsim import ExactContacts, QuasiStatic, Simulation, Support, Traction, build_model
from fcsim.mesh import Body, rectangle, rigid_sphere
from fcsim.mesh.material import saint_venant_kirchhoff


def test_a_clamped_strip_presses_its_former_with_the_force_at_its_tip() -> None:
    """P L > E I / R: M = E I / R where the strip lies on the former, so that the clamp bears no force and the former P.

    On the middles of its chords, their height off at the vertices, the clamp drew and the former bore eight times as much.
    """
    length, thick, R, E, P = 1.0, 0.01, 5.0, 1e9, 30.0
    strip = rectangle("strip", (length, thick), (24, 1), saint_venant_kirchhoff(E, 0.0, 1000.0), elements="Q2", plane="stress")
    model = build_model(
        [rigid_sphere("former", R, (0.0, -R), 1.0), Body("strip", strip)],
        supports=[Support("former", ("x", "y", "rz")), Support("strip", ("x", "y"), "x-")],
        loads=[Traction("strip", "x+", (0.0, -P / thick), lambda t: t)],
    )
    *_, last = Simulation(model, ExactContacts(model, 0.0), QuasiStatic(0.5), 2)
    assert last.contact_force_on(model.number["former"])[1] == pytest.approx(-P, rel=0.01)
