"""What the contacts that are closed at a race's best iterate hold."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.linear._block_rows_kernels import block_rows_of_dense, row_patterns
from fcsim.solvers.automatic.race import Race
from fcsim.solvers.newton.systems._velocity_kernels import velocities_held
from fcsim.solvers.newton.systems.choice import without_a_factor

STICKING = 1e-6
"""Share of the friction cone next to its surface where a contact is not said to stick."""

POINTS = 3.0
"""Contacts a pair of bodies from which they may be faces, which three points span: 4 and more in blocks, 1.6 to 2.3 in beds."""
POINTS_2D = 1.5
"""Those in the plane, where an edge is spanned by two, and discs touch in one."""
SINGLE = 1.5
"""Contacts a pair of bodies up to which they touch in single points, counted by W's rows: 1.0 to 1.2 of spheres, 2.1 to 2.3 of rocks."""
FACES = 1.3
"""Velocities held, over those that there are, beyond which it is faces that hold: 1.3 to 5 after the first sweeps in walls, towers, layers
of boxes, at most 1.2 in beds of rocks with up to three points a pair."""
UNLIKE = 1e3
"""Largest of the contacts' compliances over the least from which bodies are of unlike masses: 2e4 to 2e8 in beds of masses 1e4 to
1e8 apart, 6 to 300 in beds of discs, spheres, rocks."""
FEW = 128
"""Contacts up to which a bed is small: as many as pass the compiled front door, which has tried proximal Newton."""
LOOSE = {2: SINGLE, 3: 3.75}
"""Contacts a pair of bodies, counted by W's rows, below which few contacts are those of grains: mostly below 3.5 of rocks, of boxes 4 and
more."""
KEPT_UP_TO = 20000
"""Contacts up to which sweeps are NNCG from the beginning."""


def points_a_pair(race: Race) -> float:
    """Contacts over the pairs of bodies that they are between, about, counted once: pairs are told by the first and the last velocity
    behind each contact, so that a body's pairs with fixed ones count as one; 0 where the bodies behind W are not known."""
    if race.points is None:
        motion, d = race.problem.delassus.motion, race.problem.dimension
        race.points = 0.0
        if motion is not None and race.problem.nc and np.all(np.diff(motion.HT.indptr[::d]) > 0):
            columns, begins = motion.HT.indices, motion.HT.indptr[:-1:d]
            pairs = np.minimum.reduceat(columns, begins) * np.int64(motion.HT.shape[1]) + np.maximum.reduceat(columns, begins)
            race.points = race.problem.nc / len(np.unique(pairs))
    return race.points


def in_single_points(race: Race) -> bool:
    """Whether most pairs of bodies touch in one point, as spheres do, told by W alone, in sparse blocks, once: contacts of one pair are
    coupled with the same contacts, so that their rows have one pattern."""
    if race.single is None:
        W, d = race.problem.W, race.problem.dimension
        blocks = isinstance(W, sp.bsr_array) and W.blocksize == (d, d) and bool(np.all(np.diff(W.indptr) > 0))
        race.single = blocks and race.problem.nc <= SINGLE * _row_patterns(W)
    return race.single


def _row_patterns(W: sp.bsr_array) -> int:
    """Patterns of W's rows of blocks, none empty: each is told by the sum of numbers drawn for its columns."""
    drawn = np.random.default_rng(0).integers(2**62, size=len(W.indptr) - 1)
    return len(np.unique(np.add.reduceat(drawn[W.indices], W.indptr[:-1])))


def closed(race: Race) -> int:
    """Contact unknowns whose reaction is not zero at the best iterate."""
    return race.problem.dimension * int(np.count_nonzero(race.best_r().reshape(race.problem.nc, -1)[:, 0]))


def held(race: Race) -> float:
    """Velocities that the contacts which are closed at the best iterate hold, over those that the bodies have, counted once for each
    iterate: rules ask for it some ten times between two turns."""
    r = race.best_r()
    if race.held is None or race.held[0] is not r:
        race.held = r, _held(race, r)
    return race.held[1]


def _held(race: Race, r: FloatArray) -> float:
    """`held` at the reactions r (m,); 0 where the bodies' velocities are not known, or W is regular.

    A sticking contact holds all of its velocity, a sliding one its normal one at least. At r = 0 those hold that are about to close,
    q_N < 0, as Newton's first iteration has them: sticking where |q_T| < mu |q_N|.
    """
    motion = race.problem.delassus.motion
    if motion is None or motion.own is not None:
        return 0.0
    velocities = velocities_held(r if np.any(r) else -race.problem.q, race.problem.mu, 1 - STICKING, race.problem.dimension)
    return float(velocities) / motion.M.shape[0]


def singular_here(race: Race) -> bool:
    """Whether Newton's matrix is sure to be singular here, since the closed contacts hold more velocities than the bodies have."""
    return held(race) > 1


def edges(race: Race) -> bool:
    """Whether edges of bodies in 2D hold one another: two points an edge hold four unknowns of two bodies' three velocities."""
    return race.problem.dimension == 2 and singular_here(race)


def faces(race: Race) -> bool:
    """Whether faces of bodies in 3D hold one another: four points a face hold twelve unknowns of two bodies' six velocities. Grains that
    stick in single points may hold as much, but are no faces."""
    return race.problem.dimension == 3 and held(race) > FACES and points_a_pair(race) >= POINTS


def held_as_blocks(race: Race) -> bool:
    """Whether edges or faces hold one another, as between bricks, not points, as between grains."""
    return edges(race) or faces(race)


def in_blocks(race: Race) -> bool:
    """Whether most pairs of bodies touch in an edge or a face, be these held or about to slide and part."""
    return points_a_pair(race) >= (POINTS if race.problem.dimension == 3 else POINTS_2D)


def regular(race: Race) -> bool:
    """Whether every contact unknown is known to have a compliance of its own."""
    motion = race.problem.delassus.motion
    return motion is not None and motion.regular


def on_springs(race: Race) -> bool:
    """Whether joints between bodies of few velocities have stiffness, as between blocks: W is regular, whatever the contacts hold, and
    Newton's systems are solved in the bodies' velocities."""
    return race.joints is None and race.prices.in_velocities and regular(race)


def elastic_joints(race: Race) -> bool:
    """Whether contacts come in joints of bodies of many velocities, as of elastic bricks, be some among them rigid."""
    return race.joints is not None and not race.prices.in_velocities


def in_bed(race: Race) -> bool:
    """Whether grains lie in a bed, from zero: neither joints nor edges or faces that hold one another."""
    return race.joints is None and not race.warm and not held_as_blocks(race)


def in_small_bed(race: Race) -> bool:
    """Whether few grains lie in a bed, from zero, told by W alone, once. Where they stick they may hold as much as blocks."""
    if race.small is None:
        problem, d = race.problem, race.problem.dimension
        loose = race.joints is None and not small_and_elastic(race) and not on_springs(race)
        small = loose and not race.warm and 0 < problem.nc <= FEW
        race.small = small and problem.nc < LOOSE[d] * _patterns_of_rows(problem.W, d)
    return race.small


def swept_at_the_door(race: Race) -> bool:
    """Whether the compiled front door has left a small bed, where sweeps cost more than an interior point then: not so of unlike masses, of
    which sweeps still solve some."""
    return race.passed and in_small_bed(race) and not unlike(race)


def _patterns_of_rows(W: Matrix, d: int) -> int:
    """Patterns of the rows of blocks of W (m, m) of few contacts."""
    if isinstance(W, sp.bsr_array) and W.blocksize == (d, d) and W.has_sorted_indices:
        return int(row_patterns(W.indptr, W.indices))
    starts, columns, _ = block_rows_of_dense(np.ascontiguousarray(W if isinstance(W, np.ndarray) else W.toarray()), d)
    return int(row_patterns(starts, columns))


def unlike(race: Race) -> bool:
    """Whether bodies of very unlike masses touch, told by the contacts' own blocks of W."""
    compliance = race.problem.compliance
    return bool(compliance.max() > UNLIKE * compliance.min())


def newton_stays(race: Race) -> bool:
    """Whether what Newton's systems are made of serves beyond its first iterations: where bodies' velocities are many and a memory keeps it
    for the next steps, or the bodies behind a large W in joints are known, so that nothing of W is factored."""
    if race.prices.in_velocities:
        return False
    return race.monitor.memory is not None or (race.joints is not None and without_a_factor(race.problem.delassus))


def kept(race: Race) -> bool:
    """Whether sweeps are NNCG from the beginning, with one direction: up to twenty thousand contacts, not in joints, from zero, or warm on
    a sparse W whose bodies are not eliminated, as in beds of grains in motion, where the start says little."""
    loose = race.problem.nc <= KEPT_UP_TO and race.joints is None
    return loose and (not race.warm or (sp.issparse(race.problem.W) and not race.prices.in_velocities))


def small_and_elastic(race: Race) -> bool:
    """Whether it is a step of few contacts between bodies of which an elastic one is some: W is dense, in no joints, no bodies' velocities
    stand behind it, and a memory goes from step to step."""
    dense = race.joints is None and isinstance(race.problem.W, np.ndarray) and race.problem.delassus.motion is None
    return dense and race.monitor.memory is not None


def elastic(race: Race) -> bool:
    """Whether elastic bodies touch in joints, or in few contacts in a step."""
    return elastic_joints(race) or small_and_elastic(race)
