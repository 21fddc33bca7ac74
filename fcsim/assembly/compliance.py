"""The factor of A = a M + b K over all bodies, and the Delassus operator W = H^T A^-1 H from the parts' compliances.

A is block diagonal over bodies, so only the distinct blocks are factored: bodies of one part, placed alike and supported alike, share
one. The compliance of a block on its contact dofs is formed once; each step then needs products with the few entries of H.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim import linear
from fcsim._kernels import congruence
from fcsim.assembly.groups import Group
from fcsim.assembly.model import Model
from fcsim.assembly.rigid import inverse_on
from fcsim.errors import InputError
from fcsim.linear import Factor, SingularMatrix, factorise
from fcsim.reduction import assemble_delassus, refuse_singular

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class SystemFactor:
    """Factor of the free part of A = mass M + stiffness K; driven dofs are rows of the identity.

    contact_nodes: global numbers of the nodes that contacts can touch (candidates' and master facets' nodes).
    Implements `fcsim.reduction.MassFactor` on the unknowns of the model's problems (without the driven dofs where eliminated).
    """

    def __init__(self, model: Model, mass: float, stiffness: float, contact_nodes: IntArray) -> None:
        self.model, self.mass, self.stiffness = model, mass, stiffness
        touched = np.zeros(model.n_nodes, dtype=bool)
        touched[contact_nodes] = True
        self._groups = [_GroupFactor(model, group, mass, stiffness, touched) for group in model.groups]
        if not mass and model.rigid_free.any():
            body = model.rigid[int(np.argmax(model.rigid_free.any(axis=1)))]
            raise InputError(f"rigid body {body.name!r}: it is free to move and has no mass in statics; hold it, or add its mass")
        self._elastic = _ElasticMatrix(model, mass, stiffness)
        self._set_rigid_mass(model.rigid_mass())

    def _set_rigid_mass(self, rigid_mass: FloatArray) -> None:
        self.rigid_mass = rigid_mass
        self._rigid_inverse = inverse_on(self.model.rigid_free, self.mass * rigid_mass)
        self._matrix: Any = None

    def with_rigid_mass(self, rigid_mass: FloatArray) -> SystemFactor:
        """The factor with the rigid bodies' mass matrices (nr, k, k) of another configuration; all else is shared. See `rigid_mass`
        of `Model`: the array that the factor has gives the factor itself."""
        if rigid_mass is self.rigid_mass:
            return self
        other = copy.copy(self)
        other._set_rigid_mass(rigid_mass)
        return other

    def matrix(self) -> Any:
        """A as one csr_array on the problems' unknowns: (n_free, n_free), or (n_dofs, n_dofs) with identity rows. Made once."""
        if self._matrix is None:
            self._matrix = _joined(self._elastic.block, self._rigid_block())
        return self._matrix

    def _rigid_block(self) -> Any:
        model, k = self.model, self.rigid_mass.shape[-1]
        free = model.rigid_free
        blocks = np.where(free[:, :, None] & free[:, None, :], self.mass * self.rigid_mass, 0.0)
        blocks[:, range(k), range(k)] += ~free
        rigid = sp.csr_array(sp.bsr_array((blocks, np.arange(len(blocks)), np.arange(len(blocks) + 1)), shape=(free.size, free.size)))
        if model.driven == "eliminated":
            rigid = sp.csr_array(rigid[free.ravel()][:, free.ravel()])
        rigid.eliminate_zeros()
        return rigid

    def apply(self, v: FloatArray) -> FloatArray:
        """Return A v (n_dofs,) over all dofs, driven ones as they are."""
        y = self.mass * self.model.apply_mass(v, self.rigid_mass)
        if self.stiffness:
            y += self.stiffness * self.model.apply_stiffness(v)
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
        x = rhs.copy()
        for group in self._groups:
            dofs = group.dofs[:, group.free]
            x[dofs] = group.factor.solve(np.ascontiguousarray(rhs[dofs].T)).T
        rigid, free = self.model.rigid_part(x), self.model.rigid_free
        rigid[free] = np.einsum("aij,aj->ai", self._rigid_inverse, self.model.rigid_part(rhs))[free]
        return x

    def delassus(self, H: Any, dimension: int) -> Any:
        """Return W = H^T A^-1 H (m, m) for H (n, m) on the problems' unknowns."""
        H = sp.csr_array(H)
        model = self.model
        if model.driven == "eliminated":
            counts = np.zeros(model.n_dofs, dtype=H.indptr.dtype)
            counts[model.free_dofs] = np.diff(H.indptr)
            H = sp.csr_array((H.data, H.indices, np.concatenate([[0], np.cumsum(counts)])), shape=(model.n_dofs, H.shape[1]))
        return assemble_delassus(self._tiles(H, dimension), H.shape[1] // dimension, dimension)

    def _tiles(self, H: Any, d: int) -> Iterator[tuple[IntArray, FloatArray]]:
        """Each body's contacts and its share of W on them."""
        for group in self._groups:
            for first in group.first:
                contacts, h = _contact_columns(H, first, group.size, group.surface, d)
                if len(contacts):
                    yield contacts, congruence(h.indptr, h.indices, h.data, group.compliance)
        yield from _rigid_tiles(H, self.model.n_elastic, self._rigid_inverse, d)


class _ElasticMatrix:
    """The deformable bodies' block of A on the problems' unknowns, made where it is asked for."""

    def __init__(self, model: Model, mass: float, stiffness: float) -> None:
        self._model, self._mass, self._stiffness = model, mass, stiffness

    @cached_property
    def block(self) -> Any:
        model, n = self._model, self._model.n_elastic
        A = model.matrix(self._mass, self._stiffness)[:n, :n]
        free = np.ones(n)
        free[model.driven_dofs[model.driven_dofs < n]] = 0
        if model.driven == "eliminated":
            return sp.csr_array(A[free > 0][:, free > 0])
        A = sp.csr_array(sp.diags_array(free) @ A @ sp.diags_array(free) + sp.diags_array(1 - free))
        A.eliminate_zeros()
        return A


def _joined(first: Any, second: Any) -> Any:
    """diag(first, second) of two csr_arrays as one."""
    n = first.shape[0]
    return sp.csr_array(
        (
            np.concatenate([first.data, second.data]),
            np.concatenate([first.indices, second.indices + n]),
            np.concatenate([first.indptr, first.indptr[-1] + second.indptr[1:]]),
        ),
        shape=(n + second.shape[0], n + second.shape[0]),
    )


class _GroupFactor:
    """Factor and contact compliance of one group's block."""

    def __init__(self, model: Model, group: Group, mass: float, stiffness: float, touched: NDArray[np.bool_]) -> None:
        self.first, self.size, self.dofs = group.first, group.size, group.dofs
        self.free = np.flatnonzero(~group.driven)
        block = sp.csr_array(mass * group.M + stiffness * group.K)[self.free][:, self.free]
        try:
            self.factor: Factor = factorise(block, positive_definite=True)
            if len(self.free):
                refuse_singular(block, self.factor)
        except SingularMatrix as error:
            raise InputError(
                f"part {group.part.name!r}: its system matrix is singular ({error}); in statics a body needs supports, or a larger eta"
            ) from None
        d = model.dimension
        nodes = np.zeros(self.size // d, dtype=bool)
        for first in group.nodes:
            nodes |= touched[first : first + len(nodes)]
        # numbers of the contact dofs in the part, driven ones left out
        surface = np.repeat(nodes, d) & ~group.driven
        self.surface = np.flatnonzero(surface)
        compliance = linear.inverse_on(np.searchsorted(self.free, self.surface), self.factor, len(self.free))
        self.compliance = 0.5 * (compliance + compliance.T)


def _rigid_tiles(H: Any, first: int, inverse: FloatArray, d: int) -> Iterator[tuple[IntArray, FloatArray]]:
    """The tiles of rigid bodies, whose dofs begin at `first`: h M^-1 h^T with the inverses (nr, k, k) of their mass matrices."""
    k, nc = inverse.shape[-1], H.shape[1] // d
    begin = H.indptr[first]
    column, data = H.indices[begin:], H.data[begin:]
    row = np.repeat(np.arange(len(inverse) * k), np.diff(H.indptr[first:]))
    touching, place = np.unique(row // k * nc + column // d, return_inverse=True)
    h = np.zeros((len(touching), d, k))
    h[place, column % d, row % k] = data
    body, contact = np.divmod(touching, nc or 1)
    end = np.searchsorted(body, np.arange(len(inverse)), side="right")
    for number in np.flatnonzero((np.diff(end, prepend=0) > 0) & inverse.any(axis=(1, 2))):
        own = slice(end[number - 1] if number else 0, end[number])
        block = h[own].reshape(-1, k)
        yield contact[own], block @ inverse[number] @ block.T


def _contact_columns(H: Any, first: int, size: int, surface: IntArray, d: int) -> tuple[IntArray, Any]:
    """Return the contacts that touch the dofs first ... first + size - 1 of H, and H^T there: rows d a + i, columns the surface dofs."""
    begin, end = H.indptr[first], H.indptr[first + size]
    column, data = H.indices[begin:end], H.data[begin:end]
    row = np.repeat(np.arange(size), np.diff(H.indptr[first : first + size + 1]))
    contact = column // d
    contacts, place = np.unique(contact, return_inverse=True)
    h = sp.csr_array((data, (place * d + column % d, np.searchsorted(surface, row))), shape=(len(contacts) * d, len(surface)))
    return contacts, h
