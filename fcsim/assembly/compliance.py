"""The factor of A = a M + b K over all bodies, and the Delassus operator W = H^T A^-1 H from the parts' compliances.

A is block diagonal over bodies, so only the distinct blocks are factored: bodies of one part, placed alike and supported alike, share
one. The compliance of a block on its contact dofs is formed once; each step then needs products with the few entries of H.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.assembly.groups import Group
from fcsim.assembly.model import Model
from fcsim.assembly.supports import DIRECTIONS
from fcsim.errors import InputError
from fcsim.linear import Factor, SingularMatrix, factorise
from fcsim.reduction import assemble_delassus, refuse_singular

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SOLVED_AT_ONCE = 8_000_000
"""Numbers of right-hand sides that are solved for together (64 MB, of which a factor's solution takes a few copies)."""


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
        k = len(DIRECTIONS[model.dimension])
        driven = np.zeros(model.n_dofs, dtype=bool)
        driven[model.driven_dofs] = True
        free = ~driven[model.n_elastic :].reshape(-1, k)
        if not mass and free.any():
            body = model.rigid[int(np.argmax(free.any(axis=1)))]
            raise InputError(f"rigid body {body.name!r}: it is free to move and has no mass in statics; hold it, or add its mass")
        self._rigid_inverse = _free_inverse(mass * model.rigid_mass, free)

    def matrix(self) -> Any:
        """A as one csr_array on the problems' unknowns: (n_free, n_free), or (n_dofs, n_dofs) with identity rows."""
        model = self.model
        A = model.matrix(self.mass, self.stiffness)
        if model.driven == "eliminated":
            return sp.csr_array(A[model.free_dofs][:, model.free_dofs])
        free = np.zeros(model.n_dofs)
        free[model.free_dofs] = 1
        A = sp.csr_array(sp.diags_array(free) @ A @ sp.diags_array(free) + sp.diags_array(1 - free))
        A.eliminate_zeros()
        return A

    def apply(self, v: FloatArray) -> FloatArray:
        """Return A v (n_dofs,) over all dofs, driven ones as they are."""
        y = self.mass * self.model.apply_mass(v)
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
        n, k = self.model.n_elastic, len(DIRECTIONS[self.model.dimension])
        driven = x[n:].copy()
        x[n:] = np.einsum("aij,aj->ai", self._rigid_inverse, rhs[n:].reshape(-1, k)).ravel()
        held = self.model.driven_dofs[self.model.driven_dofs >= n]
        x[held] = driven[held - n]
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
                    yield contacts, h @ (h @ group.compliance).T
        k = len(DIRECTIONS[self.model.dimension])
        own = np.arange(k)
        for number, inverse in enumerate(self._rigid_inverse):
            contacts, h = _contact_columns(H, self.model.n_elastic + k * number, k, own, d)
            if len(contacts) and np.any(inverse):
                dense = h.toarray()
                yield contacts, dense @ inverse @ dense.T


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
        self.compliance = _inverse_on(self.factor, len(self.free), np.searchsorted(self.free, self.surface))


def _inverse_on(factor: Factor, size: int, place: IntArray) -> FloatArray:
    """Return (A^-1)[place, place] (k, k) of a factored symmetric A (size, size), a few columns at a time: all would be k size numbers."""
    k = len(place)
    inverse = np.empty((k, k))
    count = max(1, SOLVED_AT_ONCE // max(size, 1))
    for first in range(0, k, count):
        own = place[first : first + count]
        units = np.zeros((size, len(own)))
        units[own, np.arange(len(own))] = 1
        inverse[:, first : first + count] = factor.solve(units)[place]
    return 0.5 * (inverse + inverse.T)


def _contact_columns(H: Any, first: int, size: int, surface: IntArray, d: int) -> tuple[IntArray, Any]:
    """Return the contacts that touch the dofs first ... first + size - 1 of H, and H^T there: rows d a + i, columns the surface dofs."""
    begin, end = H.indptr[first], H.indptr[first + size]
    column, data = H.indices[begin:end], H.data[begin:end]
    row = np.repeat(np.arange(size), np.diff(H.indptr[first : first + size + 1]))
    contact = column // d
    contacts, place = np.unique(contact, return_inverse=True)
    h = sp.csr_array((data, (place * d + column % d, np.searchsorted(surface, row))), shape=(len(contacts) * d, len(surface)))
    return contacts, h


def _free_inverse(matrices: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    """Invert each (k, k) matrix on its free dofs; zero elsewhere."""
    inverse = np.zeros_like(matrices)
    for result, matrix, own in zip(inverse, matrices, free, strict=True):
        if own.any():
            result[np.ix_(own, own)] = np.linalg.inv(matrix[np.ix_(own, own)])
    return inverse
