"""Factors and compliances of bodies that each have a stiffness of their own: those of nonlinear materials."""

from __future__ import annotations

import copy
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.assembly.inner_forces import changed, mass_blocks
from fcsim.errors import FcsimError
from fcsim.linear.block_factors.tridiagonal import factorise_body, find_layers
from fcsim.linear.factors import Factor, SingularMatrix, inverse_on

FEW = 1 / 3
"""Share of a body's contact dofs up to which its compliance is made on those alone that contacts touch."""


class Indefinite(FcsimError, ArithmeticError):
    """A body's system matrix is not positive definite: body (number) whose tangent has lost its stiffness."""

    def __init__(self, body: int, why: str) -> None:
        super().__init__(why)
        self.body = body

    def __reduce__(self) -> tuple[type[Indefinite], tuple[int, str]]:
        """Other ranks raise it too."""
        return type(self), (self.body, str(self))


class BodyFactors:
    """The factors of a M + blocks on the free dofs of a group's bodies along the supports' axes, each made when it is first asked for.

    blocks (nb, nblocks, d, d), or (1, ...) where all bodies share them; kind (nb,): which of the factors is whose
    """

    def __init__(self, mass: float, group: Group, blocks: FloatArray, surface: IntArray) -> None:
        assert group.laws is not None
        self._group, self._mass = group, mass
        self.first, self.dofs, self.members = group.first, group.dofs, group.members
        self.free, self.surface = np.flatnonzero(~group.driven), surface
        self._mass_blocks = mass * mass_blocks(group) if mass else np.zeros(blocks.shape[1:])
        self._set(blocks, {}, {})
        self._layers = find_layers(self._matrix(0), group.places[self.free])

    def _set(self, blocks: FloatArray, factors: dict[int, Factor], compliances: dict[int, tuple[BoolArray, FloatArray]]) -> None:
        self._prepared = False
        self.blocks, self._factors, self._compliances = blocks, factors, compliances
        self.kind: IntArray = np.arange(len(self.members)) % len(blocks)
        self.fresh = len(blocks)

    def with_blocks(self, blocks: FloatArray, kept: BodyFactors | None, share: float) -> BodyFactors:
        """The factors with other blocks (nb, nblocks, d, d); bodies keep blocks and factor where those of `kept` differ by less than a
        share of
        the largest entry of the whole matrix."""
        other = copy.copy(self)
        other.__dict__.pop("matrices", None)
        factors: dict[int, Factor] = {}
        compliances: dict[int, tuple[BoolArray, FloatArray]] = {}
        stay = np.empty(0, dtype=np.int64)
        if kept is not None and len(kept.blocks) == len(blocks):
            stay = np.flatnonzero(~changed(blocks + self._mass_blocks, kept.blocks + self._mass_blocks, share))
            blocks = blocks.copy()
            blocks[stay] = kept.blocks[stay]
            factors = {b: kept._factors[b] for b in stay.tolist() if b in kept._factors}
            compliances = {b: kept._compliances[b] for b in stay.tolist() if b in kept._compliances}
        other._set(blocks, factors, compliances)
        other.fresh -= len(stay) if kept is not None and kept._prepared else len(factors)
        return other

    @property
    def first_stiffness(self) -> FloatArray:
        """The tangent (nblocks, d, d) [N/m] at the beginning in world axes."""
        assert self._group.laws is not None
        R: FloatArray = self._group.rotation
        first: FloatArray = R @ self._group.laws.first_tangent @ R.T
        return first

    @property
    def mass(self) -> FloatArray:
        """The mass (nblocks, d, d) [kg] of a body in world axes."""
        return mass_blocks(self._group)

    @cached_property
    def matrices(self) -> FloatArray:
        """a M + blocks (nb, nblocks, d, d) of all bodies."""
        matrices: FloatArray = (self.blocks + self._mass_blocks)[self.kind]
        return matrices

    def factor(self, k: int) -> Factor:
        """The factor of the k-th stiffness; raises Indefinite."""
        if k not in self._factors:
            try:
                self._factors[k] = factorise_body(self._matrix(k), self._layers)
            except SingularMatrix as error:
                raise Indefinite(int(self.members[k]), str(error)) from None
        return self._factors[k]

    def _matrix(self, k: int) -> sp.csr_array:
        """The k-th a M + blocks on the free dofs along the supports' axes."""
        assert self._group.laws is not None
        A, T = self._group.laws.graph.matrix(self.blocks[k] + self._mass_blocks), self._group.axes_matrix
        return sp.csr_array((A if T is None else (T @ A @ T.T).tocsr())[self.free][:, self.free])

    def prepare(self, own: BoolArray) -> None:
        """Make the factors of the bodies `own` (nb,) that are not there yet; raises Indefinite."""
        for k in np.unique(self.kind[own]).tolist():
            self.factor(k)

    def prepared(self) -> None:
        """Note that the factors of all bodies are there, here or with their owners."""
        self._prepared = True

    def solve(self, rhs: FloatArray, own: BoolArray) -> FloatArray:
        """A^-1 rhs of the bodies `own` (nb,): (number of own, nfree) as rhs."""
        found = [self.factor(k).solve(of_body) for k, of_body in zip(self.kind[own].tolist(), rhs, strict=True)]
        return np.array(found).reshape(rhs.shape)

    def compliances(self, own: BoolArray, asked: BoolArray) -> tuple[FloatArray, IntArray]:
        """A^-1 on the contact dofs (c, k, k) of the bodies `own` (nb,), and which is whose (nb,); -1: of none of them, or not asked for.

        asked (n_dofs,): the dofs between which it is wanted; where they are few of a body's contact dofs it is zero on the others. What
        is made depends on A and `asked` alone, not on what was made before, so that a run that goes on has the same bits.
        """
        touched = asked[self.dofs[:, self.surface]] & own[:, None]
        kinds = np.unique(self.kind[touched.any(axis=1)])
        size = len(self.surface)
        made = []
        for k in kinds.tolist():
            of_kind: BoolArray = touched[self.kind == k].any(axis=0)
            if np.count_nonzero(of_kind) > FEW * size:
                of_kind = np.ones(size, dtype=bool)
            before = self._compliances.get(k)
            if before is None or not np.array_equal(before[0], of_kind):
                self._compliances[k] = of_kind, self._compliance(k, of_kind)
            made.append(self._compliances[k][1])
        place = np.where(touched.any(axis=1), np.searchsorted(kinds, self.kind), -1)
        return made[0][None] if len(made) == 1 else np.array(made).reshape(len(made), size, size), place

    def _compliance(self, k: int, asked: BoolArray) -> FloatArray:
        """A^-1 of the k-th stiffness on the contact dofs (size, size), zero where not asked for (size,)."""
        C = inverse_on(np.searchsorted(self.free, self.surface[asked]), self.factor(k), len(self.free))
        C = 0.5 * (C + C.T)
        if asked.all():
            return C
        whole, places = np.zeros((len(asked), len(asked))), np.flatnonzero(asked)
        whole[places[:, None], places] = C
        return whole

    def product(self, v: FloatArray) -> FloatArray:
        """blocks v (nb, n_part)."""
        assert self._group.laws is not None
        graph = self._group.laws.graph
        return np.array([graph.matrix(self.blocks[k]) @ own for k, own in zip(self.kind.tolist(), v, strict=True)])
