"""The factor of A = a M + b K over all bodies, and the parts' compliances A^-1 on the dofs that contacts touch.

A is block diagonal over bodies, so only the distinct blocks are factored: bodies of one part, placed alike and supported alike, share
one. The compliance of a block on its contact dofs is formed once; from them each step sums its Delassus operator (`StepCompliance`).
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.body_factors import BodyFactors
from fcsim.assembly.kinematics._rigid_kernels import rows_of_blocks
from fcsim.assembly.model import Model
from fcsim.assembly.rigid import turned_matrices
from fcsim.assembly.shares.group_factor import GroupFactor, own_surface, solved_by_each
from fcsim.assembly.shares.shares import Shares, runs
from fcsim.assembly.whole.elastic_matrix import ElasticMatrix, joined
from fcsim.errors import InputError
from fcsim.linear.sparse._vectors_kernels import weighted_sum
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.ranks import held_in_common, partners, world


class SystemFactor:
    """Factor of the free part of A = mass M + stiffness K along the supports' axes; driven dofs are rows of the identity.

    contact_nodes: global numbers of the nodes that contacts can touch (candidates' and master facets' nodes).
    Solves on the unknowns of the model's problems (without the driven dofs where eliminated).
    """

    def __init__(self, model: Model, mass: float, stiffness: float, contact_nodes: IntArray) -> None:
        self.model, self.mass, self.stiffness = model, mass, stiffness
        touched = np.zeros(model.n_nodes, dtype=bool)
        touched[contact_nodes] = True
        self._groups: list[GroupFactor | BodyFactors] = [
            GroupFactor(model, group, mass, stiffness, touched)
            if group.laws is None
            else BodyFactors(mass, group, stiffness * group.laws.first_tangent[None], own_surface(model, group, touched))
            for group in model.groups
        ]
        self._by_owners()
        if not mass and model.rigid_free.any():
            body = model.rigid[int(np.argmax(model.rigid_free.any(axis=1)))]
            raise InputError(f"rigid body {body.name!r}: it is free to move and has no mass in statics; hold it, or add its mass")
        self._elastic = ElasticMatrix(model, mass, stiffness)
        of_dofs, column = self._bodies_of_dofs()
        self.places = held_in_common(of_dofs), held_in_common(column)
        self.rotation: FloatArray | None = None
        self._where: dict[Shares, tuple[IntArray, IntArray]] = {}  # of this factor and all that follow from it
        self._mine: dict[Shares, tuple[BoolArray, IntArray]] = {}  # see `own_bodies`
        self.kept_layouts: list[object] = []  # the last one that was made of H, likewise
        self._last_product: tuple[FloatArray, FloatArray] | None = None
        self._set_rigid_mass(model.rigid_mass())

    def _by_owners(self) -> None:
        """Make the factors and compliances of linear bodies: all of them, or where ranks share the work this rank's, and its bodies'
        compliances from those who made them."""
        groups, shares = [group for group in self._groups if isinstance(group, GroupFactor)], self.model.shares
        if shares is None:
            for group in groups:
                group.make()
            return
        of_one = [group for group in groups if not group.over_ranks]
        each = shares.each_solves([group.members for group in of_one], [len(group.free) for group in of_one])
        for group, everyones in zip(of_one, each, strict=True):
            group.everyones = everyones
        with shares.world.together("factors"):
            for group in of_one:
                if shares.solver(group.members) == shares.world.number:
                    group.make()
        for group in of_one:
            group.share(shares)
        for group in groups:
            if group.over_ranks:
                group.make_together(shares)

    def _bodies_of_dofs(self) -> tuple[IntArray, IntArray]:
        """The body of each dof (n_dofs,), in the order of `compliances`, -1 for driven ones, and its number in the body's compliance."""
        model = self.model
        body, column = np.full(model.n_dofs, -1), np.zeros(model.n_dofs, dtype=np.int64)
        begin = 0
        for group in self._groups:
            surface = group.first[:, None] + group.surface
            body[surface] = np.arange(begin, begin + len(surface))[:, None]
            column[surface] = np.arange(len(group.surface))
            begin += len(surface)
        free = model.rigid_free
        model.rigid_part(body)[:] = np.where(free, np.arange(begin, begin + len(free))[:, None], -1)
        model.rigid_part(column)[:] = np.arange(free.shape[1])
        return body, column

    def _set_rigid_mass(self, rigid_mass: FloatArray) -> None:
        self.rigid_mass = rigid_mass
        self._rigid_inverse = self.model.rigid_inverse(self.mass * rigid_mass)
        self._matrix: sp.csr_array | None = None

    def with_rigid_mass(self, rigid_mass: FloatArray) -> SystemFactor:
        """The factor with the rigid bodies' mass matrices (nr, k, k) of another configuration; all else is shared. See `rigid_mass`
        of `Model`: the array that the factor has gives the factor itself."""
        if rigid_mass is self.rigid_mass:
            return self
        other = copy.copy(self)
        other._set_rigid_mass(rigid_mass)
        return other

    def turned(self, rotation: FloatArray | None) -> SystemFactor:
        """The factor of T (a M + b K) T^T, where T turns the nodes of each deformable body by rotation (n_deformable, d, d), which
        `ElasticForces.system_rotation` gives: factors and compliances stay what they are in the bodies' axes. None: itself."""
        if rotation is None:
            return self
        other = copy.copy(self)
        other.rotation, other._matrix, other._last_product = rotation, None, None
        return other

    def with_tangents(self, blocks: Sequence[FloatArray], kept: SystemFactor | None, share: float) -> SystemFactor:
        """The factor with other stiffnesses of the bodies of nonlinear materials: of each of their groups blocks (nb, nblocks, d, d), as
        they
        enter A. Bodies whose blocks differ from those of `kept` by less than a share keep blocks and factor. See `blocks`."""
        other = copy.copy(self)
        given = iter(blocks)
        other._groups = []
        for k, group in enumerate(self._groups):
            if isinstance(group, BodyFactors):
                earlier = None if kept is None else kept._groups[k]
                assert earlier is None or isinstance(earlier, BodyFactors)
                group = group.with_blocks(next(given), earlier, share)
            other._groups.append(group)
        other._matrix = None
        return other

    def prepare(self) -> None:
        """Make all factors that are not there yet; raises Indefinite."""
        for group in self.nonlinear_groups:
            with self._section("factors of tangents"):
                group.prepare(self._own(group.members))
            group.prepared()

    def _own(self, members: IntArray) -> BoolArray:
        """Which of the bodies (nb,) this rank works on."""
        shares = self.model.shares
        return np.ones(len(members), dtype=bool) if shares is None else shares.mine(members)

    def _section(self, what: str) -> AbstractContextManager[None]:
        """A block of this rank's own work, whose errors are all ranks'."""
        shares = self.model.shares
        return nullcontext() if shares is None else shares.world.together(what)

    @property
    def nonlinear_groups(self) -> tuple[BodyFactors, ...]:
        """The bodies of nonlinear materials, group by group."""
        return tuple(group for group in self._groups if isinstance(group, BodyFactors))

    def matrix(self) -> sp.csr_array:
        """A as one csr_array on the problems' unknowns: (n_free, n_free), or (n_dofs, n_dofs) with identity rows. Made once."""
        if self._matrix is None:
            plain = self.rotation is None and not self.nonlinear_groups
            rigid = self._rigid_block()
            self._matrix = joined(self._elastic.block, rigid) if plain else self._elastic.at(self.rotation, self._blocks(), rigid)
        return self._matrix

    def product(self, v: FloatArray) -> FloatArray:
        """Return `matrix()` v for v (n,) on the problems' unknowns, without that matrix."""
        model = self.model
        if model.driven == "eliminated":
            moved = np.zeros(model.n_dofs)
            moved[model.free_dofs] = v
        else:
            moved = v.copy()
            moved[model.driven_dofs] = 0.0
        y = model.along(self.apply(model.world(moved)))
        if model.driven == "eliminated":
            return y[model.free_dofs]
        y[model.driven_dofs] = v[model.driven_dofs]
        return y

    @property
    def over_ranks(self) -> bool:
        """Whether ranks have the factor of a body together, so that no rank should have all of A."""
        return any(isinstance(group, GroupFactor) and group.over_ranks for group in self._groups)

    def _blocks(self) -> dict[int, FloatArray]:
        """The blocks of A of the bodies of nonlinear groups, by the group's number."""
        return {k: group.matrices for k, group in enumerate(self._groups) if isinstance(group, BodyFactors)}

    def _rigid_block(self) -> sp.csr_array:
        model = self.model
        blocks = self.mass * turned_matrices(model.rigid_axes, self.rigid_mass)
        indptr, indices, data = rows_of_blocks(np.ascontiguousarray(blocks), model.rigid_free, model.driven == "eliminated")
        return with_short_indices(sp.csr_array((data, indices, indptr), shape=(len(indptr) - 1, len(indptr) - 1)))

    def apply(self, v: FloatArray) -> FloatArray:
        """Return A v (n_dofs,) over all dofs in world axes, driven ones as they are."""
        y = self.model.apply_mass(v, self.rigid_mass)
        moved = self.stiffness and np.any(v[: self.model.n_elastic])
        y = weighted_sum(self.mass, y, self.stiffness, self._stiffness_times(v)) if moved else self.mass * y
        return y + self.apply_tangents(v) if self.nonlinear_groups else y

    def _stiffness_times(self, v: FloatArray) -> FloatArray:
        """K v (n_dofs,) of the linear materials; that of the last v is kept: momentum and supports are asked of the same one."""
        own, last = v[: self.model.n_elastic], self._last_product
        if last is None or not np.array_equal(own, last[0]):
            turned = self.model.elastic.turned_stiffness
            linear = self.model.apply_stiffness(v) if self.rotation is None else turned(self.rotation, v)
            for bodies in self.nonlinear_groups:
                linear[bodies.dofs] = 0
            last = own.copy(), linear
            if world() is partners():  # what one rank alone keeps it would not come to exchange, where the others wait
                self._last_product = last
        return last[1]

    def apply_tangents(self, v: FloatArray) -> FloatArray:
        """The share of A v (n_dofs,) of the nonlinear bodies' stiffness."""
        y = np.zeros_like(v)
        for bodies in self.nonlinear_groups:
            y[bodies.dofs] = bodies.product(v[bodies.dofs])
        return y

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) of the problems' unknowns."""
        model = self.model
        if model.driven == "eliminated":
            full = np.zeros(model.n_dofs)
            full[model.free_dofs] = rhs
            return self._solve_all(full)[model.free_dofs]
        return self._solve_all(rhs)

    def _solve_all(self, rhs: FloatArray) -> FloatArray:
        shares, ranges = self.model.shares, self.model.elastic.ranges
        linear = [group for group in self._groups if isinstance(group, GroupFactor)]
        spread = [group for group in linear if group.over_ranks and shares is not None]
        x, each = solved_by_each(linear, ranges, rhs, self.rotation, shares)
        with self._section("solutions"):
            for group in self._groups:
                if isinstance(group, BodyFactors):
                    own = self._own(group.members)
                    dofs = group.dofs[own][:, group.free]
                    x[dofs] = group.solve(rhs[dofs], own)
                elif shares and group not in spread + each and shares.solver(group.members) == shares.world.number:
                    group.solve(rhs, self.rotation, x, ranges.cuts(group.first, ranges.edges))
        if shares is not None and len((where := self._solved_where(shares))[0]):
            dofs, counts = where
            begin = int(counts[: shares.world.number].sum())
            x[dofs] = shares.world.gathered(x[dofs[begin : begin + counts[shares.world.number]]], counts)
        for group in spread:
            group.solve(rhs, self.rotation, x, (0, len(group.first)))
        rigid, free = self.model.rigid_part(x), self.model.rigid_free
        rigid[free] = np.einsum("aij,aj->ai", self._rigid_inverse, self.model.rigid_part(rhs))[free]
        return x

    def _solved_where(self, shares: Shares) -> tuple[IntArray, IntArray]:
        """See `Shares.solved_where`: of the bodies that some ranks solve for and others do not."""
        if shares not in self._where:
            groups = [group for group in self._groups if isinstance(group, BodyFactors) or not (group.over_ranks or group.everyones)]
            self._where[shares] = shares.solved_where(groups, [isinstance(group, GroupFactor) for group in groups])
        return self._where[shares]

    def ranks(self) -> IntArray:
        """The rank (nb,) that each body is of, in the order of `places`, of a model that ranks share."""
        assert self.model.shares is not None
        count = len(self.model.bodies)
        members = [group.members for group in self._groups] + [np.arange(count - len(self._rigid_inverse), count)]
        return self.model.shares.owner[np.concatenate(members)]

    def own_bodies(self, shares: Shares) -> tuple[BoolArray, IntArray]:
        """Which bodies (nb,) are this rank's, and the body of each dof (n_dofs,), both as in `places`; -1 for others' too."""
        if shares not in self._mine:
            body, mine = self.places[0], self.ranks() == shares.world.number
            self._mine[shares] = mine, np.where(body >= 0, np.where(mine, np.arange(len(mine)), -1)[body], -1)
        return self._mine[shares]

    def compliances(self, asked: BoolArray) -> Iterator[tuple[int, FloatArray, IntArray]]:
        """The compliances of the bodies that this rank works on, in the order of `places`: (first body, C (c, k, k), which of them is
        whose (nb,)); of bodies with factors of their own between the dofs `asked` (n_dofs,) alone."""
        begin = 0
        for group in self._groups:
            own = self._own(group.members)
            if isinstance(group, BodyFactors):
                C, kind = group.compliances(own, asked)
                yield from runs(begin, C, kind)
            elif own.any():
                yield from runs(begin, group.compliance[None], np.where(own, 0, -1))
            begin += len(group.first)
        count = len(self._rigid_inverse)
        own = self._own(np.arange(len(self.model.bodies) - count, len(self.model.bodies)))
        yield from runs(begin, self._rigid_inverse, np.where(own, np.arange(count), -1))
