"""Factor and contact compliance of bodies of linear material that share their operators, made by one rank for all of them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics._frame_kernels import turned_back, turned_forth
from fcsim.assembly.kinematics.ranges import BodyRanges
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.shares.shares import Shares
from fcsim.errors import InputError
from fcsim.linear import factors as linear
from fcsim.linear.block_factors.tridiagonal import factorise_body, find_layers
from fcsim.linear.factors import Factor, SingularMatrix
from fcsim.linear.over_ranks.mumps import MumpsOverRanks
from fcsim.linear.over_ranks.rows import RowsOverRanks, whole
from fcsim.linear.singularity import refuse_singular
from fcsim.linear.sparse._vectors_kernels import columns_of, put_columns
from fcsim.memory import refuse_beyond_memory
from fcsim.runtime import release_freed_memory

FAINT = 1e-8
"""Of a body's stiffness: the regularisation eta / h^2 M that is proposed to who has none, or one that round-off hides."""


def own_surface(model: BodyLayout, group: Group, touched: BoolArray) -> IntArray:
    """Numbers of the contact dofs in the part, driven ones left out."""
    d = model.dimension
    nodes = np.zeros(group.size // d, dtype=bool)
    for first in group.nodes:
        nodes |= touched[first : first + len(nodes)]
    return np.flatnonzero(np.repeat(nodes, d) & ~group.driven)


class GroupFactor:
    """Factor and contact compliance of one group's block."""

    def __init__(self, model: BodyLayout, group: Group, mass: float, stiffness: float, touched: NDArray[np.bool_]) -> None:
        self.first, self.size, self.dofs, self.members = group.first, group.size, group.dofs, group.members
        self.free, self._axes, self._is_free = np.flatnonzero(~group.driven), group.axes, ~group.driven
        self._group, self._factors = group, (mass, stiffness)
        self.surface = own_surface(model, group, touched)
        self.everyones = False  # whether each rank has the factor, of ranks that share the model

    @cached_property
    def factor(self) -> Factor:
        """Made where it is asked for, by all ranks together of a group that is `over_ranks`; InputError where it cannot be."""
        group, (mass, stiffness) = self._group, self._factors
        block = self._block()
        try:
            factor: Factor
            if isinstance(block, RowsOverRanks):
                factor = MumpsOverRanks(block)
            else:
                factor = factorise_body(block, find_layers(block, group.places[self.free]))
            if len(self.free):
                refuse_singular(block, factor)
        except SingularMatrix as error:
            why = "in statics a body needs supports, or a larger eta"
            if mass and not np.any(group.M.diagonal()):
                why = "it has no mass: in dynamics a part needs a density > 0, or supports that hold it; statics: QuasiStatic(h)"
            elif mass:
                sums = [float(A.diagonal().sum()) for A in (group.K, group.M)]
                larger = FAINT * stiffness * sums[0] / (mass * sums[1])
                units = "expected E, density, lengths and the step in one system of units"
                why = f"its stiffness hides its mass in round-off: {units}, in statics a larger eta, about {larger:.0e} times"
            if mass:
                error = SingularMatrix(str(error).removesuffix(" (a body without supports?)"))
            raise InputError(f"part {group.part.name!r}: its system matrix is singular ({error}); {why}") from None
        return factor

    def _block(self) -> sp.csr_array | RowsOverRanks:
        """a M + b K on the free dofs, along the supports' axes."""
        group, (mass, stiffness) = self._group, self._factors
        if isinstance(group.K, RowsOverRanks):
            spread = group.K.plus(stiffness, group.M, mass)
            return (spread if group.axes_matrix is None else spread.turned(group.axes_matrix)).on(self.free)
        block = sp.csr_array(mass * whole(group.M) + stiffness * group.K)
        if (T := group.axes_matrix) is not None:
            block = sp.csr_array(T @ block @ T.T)
        return block[self.free][:, self.free]

    @cached_property
    def compliance(self) -> FloatArray:
        """A^-1 on the contact dofs (k, k); InputError where that does not fit into the free memory."""
        k = len(self.surface)
        what = f"part {self._group.part.name!r}: the compliance between the {k} degrees of freedom of the surface that contact may touch"
        refuse_beyond_memory(what, 8.0 * k**2)
        return _symmetric(linear.inverse_on(np.searchsorted(self.free, self.surface), self.factor, len(self.free)))

    def make(self) -> None:
        """Make the factor and the compliance."""
        self.factor, self.compliance  # noqa: B018 - kept from now on

    def make_together(self, shares: Shares) -> None:
        """Make the factor of a group that is `over_ranks`, and the compliance on the ranks that have bodies of it."""
        assert isinstance(self.factor, MumpsOverRanks)
        keep = bool(shares.mine(self.members).any())
        compliance = self.factor.inverse_on(np.searchsorted(self.free, self.surface), keep=keep)
        if compliance is not None:
            self.compliance = _symmetric(compliance)
        release_freed_memory()

    @property
    def over_ranks(self) -> bool:
        """Whether ranks have the factor together."""
        return self._group.over_ranks

    def share(self, shares: Shares) -> None:
        """Give the compliance from the rank that has made it to those that have bodies of the group."""
        root, size = shares.solver(self.members), len(self.surface)
        given = self.compliance if root == shares.world.number else np.empty((size, size))
        shares.world.broadcast(given, root)
        if shares.mine(self.members).any():
            self.compliance = given

    @cached_property
    def _free_dofs(self) -> IntArray:
        """Of each body (nb, nfree)."""
        return self.dofs[:, self.free]

    def solve(self, rhs: FloatArray, rotation: FloatArray | None, x: FloatArray, ends: Sequence[int]) -> None:
        """A^-1 rhs of the bodies ends[0] to ends[-1] - 1 of the group, those between two ends at once, turned by rotation
        (n_deformable, d, d), None: not, into x; rhs, x (n_dofs,)."""
        for begin, end in itertools.pairwise(ends):
            if begin < end:
                self._solve(slice(begin, end), rhs, rotation, x)

    def _solve(self, some: slice, rhs: FloatArray, rotation: FloatArray | None, x: FloatArray) -> None:
        """`solve` of some of the bodies."""
        first = self.first[some]
        if rotation is None:
            given = np.empty((len(self.free), len(first)))
            columns_of(first, self.free, rhs, given)
            put_columns(first, self.free, self.factor.solve(given), x)
            return
        Q = rotation[self.members[some]]
        if self._axes is None:
            columns, axes = np.empty((len(self.free), len(first))), tuple(range(Q.shape[-1]))
            turned_back(axes, rhs, first, Q, self._is_free, columns, 0)
            turned_forth(axes, self.factor.solve(columns), first, Q, self._is_free, x)
            return
        dofs = self._free_dofs[some]
        own = np.zeros((len(first), self.size))
        own[:, self.free] = rhs[dofs]
        inner = self.along(_turned(Q.transpose(0, 2, 1), self.world(own)))[:, self.free]
        own[:, self.free] = self.factor.solve(np.ascontiguousarray(inner.T)).T
        x[dofs] = self.along(_turned(Q, self.world(own)))[:, self.free]

    def along(self, x: FloatArray) -> FloatArray:
        """Components along the supports' axes of x (nb, n_part) in world axes."""
        return x if self._axes is None else self._along_each(self._axes, x)

    def world(self, x: FloatArray) -> FloatArray:
        """x (nb, n_part) in world axes from its components along the supports' axes."""
        return x if self._axes is None else self._along_each(self._axes.transpose(0, 2, 1), x)

    @staticmethod
    def _along_each(axes: FloatArray, x: FloatArray) -> FloatArray:
        return np.einsum("aij,baj->bai", axes, x.reshape(len(x), *axes.shape[:2])).reshape(x.shape)


def solved_by_each(
    groups: Sequence[GroupFactor], ranges: BodyRanges, rhs: FloatArray, rotation: FloatArray | None, shares: Shares | None
) -> tuple[FloatArray, list[GroupFactor]]:
    """x (n_dofs,), the solutions of the bodies of those groups that every rank has the factor of, each rank for some, see
    `GroupFactor.solve`, and rhs (n_dofs,) else; and these groups."""
    each = [group for group in groups if shares is None or (group.everyones and not group.over_ranks)]
    if not each:
        return rhs.copy(), each
    x, (first, *_, last) = ranges.vector(len(rhs)), ranges.edges
    x[:first], x[last:] = rhs[:first], rhs[last:]

    def between(edges: IntArray) -> None:
        x[edges[0] : edges[-1]] = rhs[edges[0] : edges[-1]]
        for group in each:
            group.solve(rhs, rotation, x, ranges.cuts(group.first, edges))

    ranges.share("solutions", between, x)
    return x, each


TILE = 512


def _symmetric(C: FloatArray) -> FloatArray:
    """(C + C^T) / 2 in the place of C."""
    tiles = [slice(begin, begin + TILE) for begin in range(0, len(C), TILE)]
    for k, i in enumerate(tiles):
        for j in tiles[k:]:
            mean = 0.5 * (C[i, j] + C[j, i].T)
            C[i, j], C[j, i] = mean, mean.T
    return C


def _turned(R: FloatArray, x: FloatArray) -> FloatArray:
    """R_b x of all nodes of body b: x (nb, nn d) as it comes and goes, R (nb, d, d)."""
    turned: FloatArray = (x.reshape(len(x), -1, R.shape[-1]) @ R.transpose(0, 2, 1)).reshape(x.shape)
    return turned
