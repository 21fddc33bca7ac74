"""The cohesive panel, small: what fracture takes is the fracture energies of the broken joints, and friction is left."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.running.case import load_case

CASE = load_case(Path(__file__).parents[2] / "cases" / "cohesive_panel")


@pytest.mark.slow
def test_what_a_sheared_panel_dissipates_is_the_fracture_energy_of_what_broke() -> None:
    """Low and wide: it slides on a bed joint, at last with mu N. The energies, from areas of the mesh: G_I and G_II times the shares that
    opening and slip broke of the joints, at most; what slides under tension takes less."""
    p = replace(CASE.parameters(), courses=2, width=2, steps=220, speed=0.04)
    simulation = CASE.build(p).simulation
    found = list(simulation)
    last = found[-1].law_variables
    area, W = last["area"], last["fracture"]
    joints = p.thickness * (3 * p.width * p.brick[0] + (2 * p.width - 1) * p.brick[1])
    assert_allclose(area.sum(), joints, rtol=1e-9)
    took = sum(step.energy.fracture_dissipation for step in found)
    work_1, work_2 = last["work_1"].sum(), last["work_2"].sum()
    assert_allclose(took, work_1 + work_2, rtol=1e-12)
    shares = (last["work_1"] / p.mode_1 + last["work_2"] / p.mode_2) / area
    assert np.all(shares <= W * (1 + 1e-9)) and shares @ area > 0.8 * W @ area  # the ends slide under tension
    bed = p.width * p.brick[0] * p.thickness
    assert W @ area > 0.98 * bed and work_2 > 0.85 * p.mode_2 * bed
    for step in found:
        assert abs(step.energy.residual) < 1e-7
    force = [abs(float(step.contact_force_on(len(simulation.model.bodies) - 1)[0])) for step in found[-20:]]
    assert_allclose(np.mean(force), p.mu * p.pressure * bed, rtol=1e-3)
