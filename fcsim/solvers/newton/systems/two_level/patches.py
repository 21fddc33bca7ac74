"""Patches of joints around those that one of Newton's systems has left unsolved are solved one by one, before the next system.

A patch is a joint whose contacts miss their equations with all other joints of its two bodies. For the contacts J of a patch, with u_J and
r_J where the system has led and all other reactions held,

    F(u_J + W_JJ x, r_J + x) = 0,

by Newton's method with steps that are halved until ||F|| falls. Patches of one round have no joint in common; the worst joint has the
first choice. Rounds go on while the error of all contacts falls.

Why: after a system of a wall of 2565 bricks half of what is missed is in one joint of 7606, 99 % in ten to twenty: contacts that were
taken for sliding, sticking or open ones and are not. The next system would set them right, but what they then carry or no longer carry
sets others wrong, joint by joint. A patch goes through these changes at once: its middle joint's bodies move with all that they touch. A
joint alone has no more than inertia against it and leaves what it gives off to its neighbours.

Sources: P. J. Lanzkron, D. J. Rose, J. T. Wilkes, SIAM J. Sci. Comput. 17, 1996; X.-C. Cai, D. E. Keyes, SIAM J. Sci. Comput. 24, 2002;
V. Dolean, M. J. Gander, W. Kheriji, F. Kwok, R. Masson, SIAM J. Sci. Comput. 38, 2016 (nonlinear subdomains between Newton's steps). That
patches are chosen where the equations are missed, worst first, follows R. V. Southwell, Relaxation Methods in Engineering Science, 1940.
"""

from __future__ import annotations

import itertools
from functools import partial
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.solvers.newton.systems.held import dense_part
from fcsim.solvers.newton.systems.two_level import _settling_kernels as kernels
from fcsim.solvers.newton.systems.two_level.settling import ContactIterate
from fcsim.threads import pieces, side_by_side

ROUNDS, PART = 10, 0.1
"""Rounds of patches after a system, and the share of the error up to which a joint is left as it is."""
SHARE = 0.05
"""Of all contacts that a round's patches have about, at the most: what solves them takes as long as three or four iterations of GMRES."""
PATCH_UP_TO, MANY = 300, 12
"""Contacts of a patch at the most, and joints of a body from which on it joins none to a patch: a foundation lies under a whole wall."""
ITERATIONS, FALLS, LEAPS = 15, 1e-2, 4
"""Of Newton's method in a patch: at most, the ||F|| relative to where it began at which it ends, for the next round goes on, and how often
a whole step is taken though ||F|| does not fall."""
EDGE = 0.8
"""Of what friction holds beyond which a contact of a patch may slide in the next steps, see `_held_kernels`."""
EASED = 1e-5
"""Of W's diagonal that is added to it in Newton's matrices: checkerboards, which hardly resist, do not grow by what a system has left in
them. In single precision, whose rounding did as much, walls took as many systems; in double precision without it a tenth more."""


class JointsOfPatches(Protocol):
    """What is taken of `Joints`."""

    count: int
    bodies: IntArray
    cuts: IntArray
    order: IntArray

    @property
    def beside(self) -> tuple[IntArray, IntArray]:
        """As `joints_beside`."""
        ...


def joints_beside(bodies: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """begins (joints + 1,) and for each joint of bodies (joints, 2), -1 for none, of `count` the others that have one of these, ascending;
    bodies of more than MANY joints join none."""
    own = bodies >= 0
    joint, body = np.nonzero(own)[0], bodies[own]
    few = np.bincount(body, minlength=count)[body] <= MANY
    on = sp.csr_array((np.ones(np.count_nonzero(few)), (joint[few], body[few])), shape=(len(bodies), count))
    beside = (on @ on.T).tocsr()
    beside.setdiag(0)
    beside.eliminate_zeros()
    beside.sort_indices()
    return beside.indptr.astype(np.int64), beside.indices.astype(np.int64)


def chosen(joints: JointsOfPatches, missed: FloatArray, limit: float, share: float = SHARE) -> list[IntArray]:
    """The contacts of the patches around joints whose `missed` (joints,) is above `limit`, worst first; of all contacts about `share`."""
    above = np.flatnonzero(missed > limit)
    worst = above[np.argsort(-missed[above], kind="stable")]
    starts, which = kernels.choose_patches(worst, *joints.beside, joints.cuts, PATCH_UP_TO, share * len(joints.order))
    contacts = [joints.order[joints.cuts[k] : joints.cuts[k + 1]] for k in which]
    return [np.concatenate(contacts[i:j]) for i, j in itertools.pairwise(starts)]


def missed_by_joints(joints: JointsOfPatches, at: ContactIterate) -> FloatArray:
    """||weight F|| (joints,) on the contacts of each joint."""
    missed: FloatArray = np.sqrt(np.add.reduceat(at.misses[joints.order], joints.cuts[:-1]))
    return missed


def solved(W: FloatArray, at: ContactIterate) -> FloatArray:
    """r (n, d) of a patch with W (n d, n d) where the system has led."""
    found: FloatArray = kernels.settle_patch(W, at.u, at.r, at.mu, at.rho, at.weight, ITERATIONS, FALLS, LEAPS, EDGE, EASED)
    return found


def patched(joints: JointsOfPatches, W: Matrix, at: ContactIterate, limit: float) -> FloatArray | None:
    """r (nc, d) with a round of patches solved around joints in which ||weight F|| is above `limit`, None where there are none."""
    patches, found = chosen(joints, missed_by_joints(joints, at), limit), at.r.copy()

    def solve(begin: int, end: int) -> None:
        for own in patches[begin:end]:
            found[own] = solved(dense_part(W, at.r.shape[1], own, own), at.take(own))

    if not patches:
        return None
    side_by_side([partial(solve, begin, end) for begin, end in pieces(len(patches), 1)])
    return found
