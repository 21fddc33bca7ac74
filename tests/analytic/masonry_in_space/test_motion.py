"""Blocks of a corner in its fall, joints with stiffness: every step at 1e-8 at once, its momentum that of weight and floor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.contact_detection import Everything
from fcsim.contact_law import Compliant, Springs
from fcsim.masonry import Acceleration, read_masonry, structure
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta
from tests.analytic.masonry_in_space.stones import G, corner, write


def test_a_corner_with_joint_stiffness_falls_in_solved_steps(tmp_path: Path) -> None:
    """Tilted to tan = 0.7, where mu = 0.6; at each contact E A / L of a quarter of a bed joint, 10 GPa x 0.01 m^2 / 0.2 m."""
    pull = Rotation.from_rotvec(np.arctan(0.7) * np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0])).apply([0.0, 0.0, -G])
    x, y, z = pull.tolist()
    problem = read_masonry(write(tmp_path / "corner.json", corner(7)))
    problem = replace(problem, loads=(Acceleration((x, y, z)),))
    model, _ = structure(problem)
    k, h = 5e8, 5e-3
    springs = Springs(normal=k, tangential=0.4 * k, normal_damping=1e-3 * k, tangential_damping=4e-4 * k, each=True)
    scheme = Theta(h, law=Compliant(springs))
    along = np.zeros((3, model.n_dofs))
    for axis in range(3):
        model.rigid_part(along[axis])[1:, axis] = 1.0  # all but the floor
    weight = pull * (along[2] @ model.apply_mass(along[2]))
    fastest = 0.0
    for step in Simulation(model, Everything(model, problem.friction), scheme, 12, created=np.inf, witness=None):
        assert step.result.error <= 1e-8
        assert {attempt.solver for attempt in step.attempts} == {"auto"}, "no fallback was needed"
        assert step.substeps == 1
        gained = along @ model.apply_mass(step.state.v - step.previous.v)
        impulse = h * (weight - step.contact_force_on(0))
        assert_allclose(gained, impulse, rtol=0, atol=1e-9 * h * np.linalg.norm(weight))
        fastest = float(np.abs(step.state.v).max())
    assert fastest > 0.1, "it moves"
