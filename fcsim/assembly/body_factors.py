"""Factors and compliances of bodies that each have a stiffness of their own: those of nonlinear materials."""

from __future__ import annotations

import copy
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.assembly.inner_forces import changed, mass_blocks
from fcsim.errors import FcsimError
from fcsim.linear.factors import Factor, SingularMatrix, factorise, inverse_on
from fcsim.linear.storage import BLOCK_UP_TO


class Indefinite(FcsimError, ArithmeticError):
    """A body's system matrix is not positive definite: body (number) whose tangent has lost its stiffness."""

    def __init__(self, body: int, why: str) -> None:
        super().__init__(why)
        self.body = body


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

    def _set(self, blocks: FloatArray, factors: dict[int, Factor], compliances: dict[int, FloatArray]) -> None:
        self.blocks, self._factors, self._compliances = blocks, factors, compliances
        self.kind: IntArray = np.arange(len(self.members)) % len(blocks)
        self.fresh = len(blocks) - len(factors)

    def with_blocks(self, blocks: FloatArray, kept: BodyFactors | None, share: float) -> BodyFactors:
        """The factors with other blocks (nb, nblocks, d, d); bodies keep blocks and factor where those of `kept` differ by less than a
        share of
        the largest entry of the whole matrix."""
        other = copy.copy(self)
        other.__dict__.pop("matrices", None)
        factors: dict[int, Factor] = {}
        compliances: dict[int, FloatArray] = {}
        if kept is not None and len(kept.blocks) == len(blocks):
            stay = np.flatnonzero(~changed(blocks + self._mass_blocks, kept.blocks + self._mass_blocks, share))
            blocks = blocks.copy()
            blocks[stay] = kept.blocks[stay]
            factors = {b: kept._factors[b] for b in stay.tolist() if b in kept._factors}
            compliances = {b: kept._compliances[b] for b in stay.tolist() if b in kept._compliances}
        other._set(blocks, factors, compliances)
        return other

    @property
    def first_stiffness(self) -> FloatArray:
        """The tangent (nblocks, d, d) [N/m] at the beginning in world axes."""
        assert self._group.laws is not None
        R: FloatArray = self._group.rotation
        first: FloatArray = R @ self._group.laws.first_tangent @ R.T
        return first

    @cached_property
    def matrices(self) -> FloatArray:
        """a M + blocks (nb, nblocks, d, d) of all bodies."""
        matrices: FloatArray = (self.blocks + self._mass_blocks)[self.kind]
        return matrices

    def factor(self, k: int) -> Factor:
        """The factor of the k-th stiffness; raises Indefinite."""
        if k not in self._factors:
            assert self._group.laws is not None
            A, T = self._group.laws.graph.matrix(self.blocks[k] + self._mass_blocks), self._group.axes_matrix
            A = (A if T is None else (T @ A @ T.T).tocsr())[self.free][:, self.free]
            try:
                self._factors[k] = factorise(A.toarray() if A.shape[0] <= BLOCK_UP_TO else A, positive_definite=True)
            except SingularMatrix as error:
                raise Indefinite(int(self.members[k]), str(error)) from None
        return self._factors[k]

    def solve(self, rhs: FloatArray) -> FloatArray:
        """A^-1 rhs (nb, nfree)."""
        return np.array([self.factor(k).solve(own) for k, own in zip(self.kind.tolist(), rhs, strict=True)])

    def compliances(self) -> FloatArray:
        """A^-1 on the contact dofs (c, k, k)."""
        for k in range(len(self.blocks)):
            if k not in self._compliances:
                C = inverse_on(np.searchsorted(self.free, self.surface), self.factor(k), len(self.free))
                self._compliances[k] = 0.5 * (C + C.T)
        return np.array([self._compliances[k] for k in range(len(self.blocks))])

    def product(self, v: FloatArray) -> FloatArray:
        """blocks v (nb, n_part)."""
        assert self._group.laws is not None
        graph = self._group.laws.graph
        return np.array([graph.matrix(self.blocks[k]) @ own for k, own in zip(self.kind.tolist(), v, strict=True)])
