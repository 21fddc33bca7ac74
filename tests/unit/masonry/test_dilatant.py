"""Walls for which limit problems with Tresca's friction end in one without an answer: slip that opens joints a little settles them."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.masonry import Block, MasonryProblem, analyse, pushed
from fcsim.masonry.remarks import remarks
from fcsim.mesh.solids.closed_surface import ClosedSurface, closed_surface

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], dtype=float)
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def box(name: str, x: tuple[float, float], z: tuple[float, float]) -> ClosedSurface:
    return closed_surface(name, (CORNERS * (x[1] - x[0], 1.0, z[1] - z[0]) + (x[0], 0.0, z[0])).tolist(), FACES)


def wall(seed: int) -> MasonryProblem:
    """Five courses of chance with an opening, some stone of which only its neighbours' friction holds, pushed along x."""
    dice, blocks, z = np.random.default_rng(seed), [Block(box("floor", (-9, 9), (-1, 0)), support=True)], 0.0
    for row in range(5):
        height = dice.uniform(0.15, 0.4)
        ends = np.unique(np.round(np.concatenate([[0], np.sort(dice.uniform(0.15, 2.85, 4)), [3.0]]), 2))
        ends = ends[np.concatenate([[True], np.diff(ends) > 0.1])]
        ends[-1] = 3.0
        for k in range(len(ends) - 1):
            if row not in (1, 2) or not 1.2 < ends[k] < 1.7:
                density = dice.uniform(1500, 2500)
                blocks.append(Block(box(f"{row} {k}", (ends[k], ends[k + 1]), (z, z + height)), density=density))
        z += height
    mu = float(np.random.default_rng(seed).uniform(0.2, 0.7))
    return pushed(MasonryProblem(f"wall {seed}", 2, tuple(blocks), mu=mu), (1.0 if seed % 2 else -1.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", [6, 15])
def test_what_was_undecided_is_a_state_of_collapse_whose_slip_opens_a_little(seed: int) -> None:
    """Equilibrium, Coulomb's cones, friction against the slip and no force where joints open, each from the contacts themselves."""
    found = analyse(wall(seed))
    limit, state, mu = found.limit, found.coulomb, found.problem.mu
    assert state.outcome == "limit" and 0 < state.dilatancy < 0.04
    assert state.multiplier <= found.associative.multiplier * (1 + 1e-9)
    load = (limit.dead + state.multiplier * limit.live)[limit.free]
    assert np.abs(limit.H @ state.r + load).max() < 1e-6 * limit.scale
    normal, shear = state.r.reshape(-1, 2).T
    parting, slip = (limit.H.T @ state.v[limit.free]).reshape(-1, 2).T
    slight, slow = 1e-6 * limit.scale, 1e-6 * np.abs(slip).max()
    assert (normal > -slight).all() and (np.abs(shear) < mu * normal + slight).all()
    widened = parting - state.dilatancy * mu * np.abs(slip)  # what slip does not open
    assert widened.min() > -slow
    slides = (np.abs(slip) > slow) & (widened < slow)
    assert slides.any() and (np.abs(shear + mu * normal * np.sign(slip))[slides] < slight).all()
    assert (np.abs(normal[widened > slow]) < slight).all()
    assert any(joint.state == "sliding" for joint in found.joints)
    assert any("slip opens joints a little" in said for said in remarks(found, None))
