"""Joints with teeth between deformable blocks: they slide up each other's flanks, at Patton's strength, tan(arctan(mu) + i)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fcsim import Body, Everything, Material, QuasiStatic, Simulation, Support, Traction, build_model
from fcsim.mesh import rectangle
from fcsim.mesh.part import Part

LENGTH, HEIGHT, TEETH = 0.3, 0.1, 3


def serrated(name: str, slope: float, per_flank: int, below: bool) -> Part:
    """A block whose upper (below) or lower side has teeth of flanks at `slope` [rad], of so many facets each."""
    part = rectangle(name, (LENGTH, HEIGHT), (2 * per_flank * TEETH, 3), Material(E=1e9, nu=0.2, density=2000.0))
    x, y = part.points.T
    pitch = LENGTH / TEETH
    tooth = np.tan(slope) * (pitch / 2 - np.abs(x % pitch - pitch / 2))
    share = y / HEIGHT if below else 1.0 - y / HEIGHT
    return replace(part, points=np.column_stack([x, y + share * tooth]))


@pytest.mark.parametrize("per_flank", [1, 2])
@pytest.mark.parametrize(("slope", "mu"), [(10.0, 0.3), (5.0, 0.6)])
def test_teeth_slide_up_their_flanks(per_flank: int, slope: float, mu: float) -> None:
    """F. D. Patton, Multiple modes of shear failure in rock, 1966. No facets of one or two flanks are chords of a curve."""
    i, pressure = np.deg2rad(slope), 3e4
    bodies = [
        Body("lower", serrated("lower", i, per_flank, True)),
        Body("upper", serrated("upper", i, per_flank, False), translation=(0.0, HEIGHT)),
    ]
    held = [Support("lower", ("x", "y"), "y-"), Support("upper", ("x",), "y+", displacement=lambda t: 2e-4 * t)]
    model = build_model(bodies, supports=held, loads=[Traction("upper", "y+", (0.0, -pressure))])
    last = list(Simulation(model, Everything(model, mu), QuasiStatic(0.25, eta=1e-4), 4))[-1]
    shear, pressed = last.contact_force_on(model.number["upper"])
    assert pressed == pytest.approx(pressure * LENGTH, rel=1e-4)
    assert -shear / pressed == pytest.approx(np.tan(np.arctan(mu) + i), rel=2e-3)
