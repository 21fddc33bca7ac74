"""Joints that were given as closed, with the gaps and overlaps of round-off: statics of groin and flat vaults, and what the law says."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.contact_law.as_built import AsBuilt
from fcsim.errors import InputError
from fcsim.masonry.bodies import HELD
from fcsim.masonry.problem import GRAVITY, Block, MasonryProblem
from fcsim.masonry.structure import as_built, structure
from fcsim.mesh.blocks import rigid_box
from fcsim.mesh.solids.closed_surface import ClosedSurface
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

RHO, ASTRAY = 2200.0, 1e-5
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def groin_vault(rings: int) -> MasonryProblem:
    """Two barrel vaults of 3 m that cross, 0.45 m thick, from the crown 60 degrees down to where they are held: plane joints along and
    across the barrels, mitred at the groins, each voussoir laid astray by up to 10 micrometres along each axis."""
    rng, blocks = np.random.default_rng(1), []
    for turn, side, ring, half in product(range(4), (1, -1), range(rings), (0.0, 0.5)):
        c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn]
        corners = []
        for k, r in product((ring, ring + 1), (3.0, 3.45)):
            y, z = r * math.sin(math.pi / 3 * k / rings), r * math.cos(math.pi / 3 * k / rings)
            corners += [(c * x - s * side * y, s * x + c * side * y, z) for x in (y + part * (4.0 - y) for part in (half, half + 0.5))]
        points = np.array(corners) + rng.uniform(-ASTRAY, ASTRAY, 3)
        polygons = tuple(side_[::side] for side_ in SIDES)
        triangles = np.array([(p[0], p[k], p[k + 1]) for p in polygons for k in (1, 2)])
        surface = ClosedSurface(f"{turn}{'+-'[side < 0]}{ring}/{half}", points, triangles, polygons)
        blocks.append(Block(surface, RHO, support=ring == rings - 1))
    return MasonryProblem("groin vault", 3, tuple(blocks), 0.7)


def flat_vault(n: int, slope: float, thickness: float) -> MasonryProblem:
    """Abeille's flat vault: n x n blocks of 1 m whose sides lean outwards and inwards in turns, each held up by two neighbours and
    holding up two; the outer ones are held. Laid astray by up to 10 micrometres."""
    rng, blocks = np.random.default_rng(0), []
    for i, j in product(range(n), repeat=2):
        lean = slope * (1 if (i + j) % 2 else -1)
        corners = [
            (i + x * (0.5 + lean * z), j + y * (0.5 - lean * z), z)
            for z in (-thickness / 2, thickness / 2)
            for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        polygons = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
        triangles = np.array([(p[0], p[k], p[k + 1]) for p in polygons for k in (1, 2)])
        surface = ClosedSurface(f"{i}/{j}", np.array(corners) + rng.uniform(-ASTRAY, ASTRAY, 3), triangles, polygons)
        blocks.append(Block(surface, RHO, support=min(i, j) == 0 or max(i, j) == n - 1))
    return MasonryProblem("flat vault", 3, tuple(blocks), 0.7)


def volume_and_centroid(block: Block) -> tuple[float, np.ndarray]:
    """By the tetrahedra between the triangles and a corner."""
    corner = block.surface.points[0]
    ends = (block.surface.points - corner)[block.surface.triangles]
    volumes = np.linalg.det(ends) / 6
    return float(volumes.sum()), corner + volumes @ ends.sum(axis=1) / 4 / volumes.sum()


@pytest.mark.parametrize("rings", [4, 6, 12])
def test_a_groin_vault_of_inexact_voussoirs_bears_itself_at_once(rings: int) -> None:
    stands_at_once(groin_vault(rings))


@pytest.mark.parametrize(("n", "slope", "thickness"), [(6, 0.3, 0.3), (6, 0.6, 0.3), (6, 0.2, 0.05), (6, 0.6, 0.02), (8, 0.3, 0.3)])
def test_a_flat_vault_of_inexact_blocks_bears_itself_at_once(n: int, slope: float, thickness: float) -> None:
    """Where four blocks meet, leaning all ways, none leaves through a far face; in thin ones no corner bears beside its edge."""
    stands_at_once(flat_vault(n, slope, thickness))


def stands_at_once(problem: MasonryProblem) -> None:
    """Forces of every free block are in equilibrium to 1e-8 of the weight, moments to 1e-6 m of it, within Coulomb's cones;
    nothing moves.

    Moments are about the points on the blocks: two contacts of a joint had theirs 0.45 m apart within it, on its farther edge. And no
    corner that a neighbour holds by noise leaves through that one's top.
    """
    model, _ = structure(problem)
    law = as_built(problem, model)
    assert ASTRAY / 2 < law.closed < 4 * ASTRAY and ASTRAY / 2 < law.overlap < 4 * ASTRAY
    scheme = QuasiStatic(1.0, GRAVITY / problem.size, law)
    settings = SolverSettings(name="PPA-NSN-AC", tol=1e-9, floor=1e-6 * problem.size, fallback=(), options={"max_iterations": 40})
    simulation = Simulation(model, Everything(model, problem.friction), scheme, 2, settings, cuttings=0)
    step = list(simulation)[-1]
    assert np.abs(step.state.x).max() < 1e-6
    free = [k for k, block in enumerate(problem.blocks) if not block.support]
    blocks = {k: volume_and_centroid(problem.blocks[k]) for k in free}
    total = RHO * GRAVITY * sum(volume for volume, _ in blocks.values())
    contacts = step.contacts
    on_slave = contacts.point + contacts.gap[:, None] * contacts.frame[:, 0]
    for k, (volume, centroid) in blocks.items():
        sign = (contacts.bodies[:, 0] == k) * 1.0 - (contacts.bodies[:, 1] == k)
        forces = sign[:, None] * step.force_in_space
        assert_allclose(forces.sum(axis=0), [0, 0, RHO * GRAVITY * volume], atol=1e-8 * total)
        points = np.where((contacts.bodies[:, 0] == k)[:, None], on_slave, contacts.point)
        assert_allclose(np.cross(points - centroid, forces).sum(axis=0), 0, atol=1e-6 * total)
    r = step.contact_force
    assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= 0.7 * r[:, 0] + 1e-8 * total)


@pytest.mark.parametrize(("gap", "sinks"), [(0.0, 0.0), (9e-4, 0.0), (3e-3, 2e-3), (-9e-4, 0.0), (-3e-3, -1e-3)])
def test_a_block_sinks_or_rises_to_the_range_in_which_it_is_closed(gap: float, sinks: float) -> None:
    """A cube over its ground: where the gap is from -2 to 1 mm it stays; else it moves to the end of that range, by hand."""
    bodies = [rigid_box("ground", (2, 2, 1), (0, 0, -0.5), RHO), rigid_box("cube", (1, 1, 1), (0, 0, 0.5 + gap), RHO)]
    model = build_model(bodies, supports=[Support("ground", HELD[3])], gravity=lambda t: (0, 0, -GRAVITY))
    scheme = QuasiStatic(1.0, GRAVITY, AsBuilt(closed=1e-3, overlap=2e-3))
    step = next(iter(Simulation(model, Everything(model, 0.5, 0.01), scheme, 1, witness=None)))
    assert_allclose(model.node_displacement(step.state.x)[-1], [0, 0, -sinks], atol=1e-9)


def test_refused() -> None:
    for name in ("closed", "overlap"):
        with pytest.raises(InputError, match=f"{name}: expected a length"):
            AsBuilt(**{name: -1.0})
