"""All loads that follow deformable bodies, pressures and forces, as what a step solves for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.following.forces import FollowingForces
from fcsim.assembly.kinematics.following.pressures import FollowingPressures
from fcsim.assembly.kinematics.following.when import When
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.loads import Follower, FollowerForce, FollowerPressure
from fcsim.linear.sparse.short_indices import with_short_indices


class FollowingLoads:
    """Pressures and forces; displacements x (n_dofs,) [m], forces (n_dofs,) [N].

    Of their tangent the symmetric part of the pressures' has the pattern of the bodies' stiffness (`with_blocks`); what is not symmetric,
    and the forces', which joins all nodes of a surface, stand apart (`apart`).
    """

    def __init__(self, layout: BodyLayout, loads: Sequence[Follower]) -> None:
        self.pressures = FollowingPressures(layout, [load for load in loads if isinstance(load, FollowerPressure)])
        self.forces = FollowingForces(layout, [load for load in loads if isinstance(load, FollowerForce)])

    @property
    def loads(self) -> tuple[Follower, ...]:
        return *self.pressures.loads, *self.forces.loads

    def __bool__(self) -> bool:
        return bool(self.loads)

    def force(self, x: FloatArray, when: When) -> FloatArray:
        """F (n_dofs,)."""
        return self.pressures.force(x, when) + self.forces.force(x, when)

    def with_blocks(self, x: FloatArray, when: When, groups: Sequence[Group], blocks: Sequence[FloatArray], w: float) -> list[FloatArray]:
        """See `FollowingPressures.with_blocks`."""
        return self.pressures.with_blocks(x, when, groups, blocks, w)

    def apart(self, x: FloatArray, when: When, whole: bool) -> sp.csr_array:
        """dF/dx (n_dofs, n_dofs) less what is in `with_blocks`; whole: all of it."""
        pressed = self.pressures.derivative(x, when) if whole else self.pressures.skew(x, when)
        return with_short_indices(sp.csr_array(pressed + self.forces.derivative(x, when)))

    def nodes(self, whole: bool) -> IntArray:
        """Numbers of the nodes that `apart` joins."""
        return np.union1d(self.pressures.nodes if whole else self.pressures.rims, self.forces.nodes)


def following_loads(layout: BodyLayout, groups: Sequence[Group], loads: Sequence[Follower]) -> FollowingLoads:
    """Of loads on deformable bodies those that follow them: on bodies of which any rotation is no strain."""
    rotating = {int(number) for group in groups if group.rotates for number in group.members}
    return FollowingLoads(layout, [load for load in loads if layout.body_number(load.body) in rotating])
