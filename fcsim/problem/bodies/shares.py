"""W = sum of h C h^T by bodies, where that is known beside W itself: what products and a preconditioner take from the bodies behind W.

C (k, k) is a body's compliance on those of its unknowns that contacts touch, h its part of H^T. Few motions make most of it: the rigid
ones, which inertia alone resists, are thousands of times as compliant as the others, and some that strain a body as a whole come next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.brief import brief
from fcsim.linear.storage import REAL, Work
from fcsim.problem._delassus_kernels import entries_by_body
from fcsim.problem.bodies._shares_kernels import add_modes, sides_of_pairs

EIGEN_UP_TO, SWEEPS, MORE, NEGLIGIBLE = 24, 3, 6, 1e-14
"""Unknowns up to which C's eigenvectors are computed as they are; else iterations of a subspace, wider than what is asked for by MORE.
Eigenvalues below NEGLIGIBLE of the largest are round-off."""

Run = tuple[int, FloatArray, IntArray]
"""What `DelassusSum.add` takes of symmetric C: (first body, C (c, k, k), which of them is whose (nb,)), of bodies one after the other."""


@dataclass(frozen=True, eq=False)
class BodyShares:
    """The shares of W, contact by contact.

    first, contacts, begins, unknowns, weights: h as `entries_by_body` gives it; runs: the compliances, bodies ascending; nc: the
    number of contacts; dimension: d of a contact.
    """

    first: IntArray
    contacts: IntArray
    begins: IntArray
    unknowns: IntArray
    weights: FloatArray
    runs: tuple[Run, ...]
    nc: int
    dimension: int

    __repr__ = brief

    @property
    def count(self) -> int:
        """The number of bodies."""
        return len(self.first) - 1

    @property
    def h(self) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]:
        """first, contacts, begins, unknowns, weights."""
        return self.first, self.contacts, self.begins, self.unknowns, self.weights

    @property
    def work(self) -> Work:
        """Of a product with the compliances alone: flops, and bytes that are read."""
        return sum((Work(flops=2 * len(kind) * C.shape[1] ** 2, bytes=REAL * C.size) for _, C, kind in self.runs), Work())

    def by_three(self, x: FloatArray) -> FloatArray:
        """x (m,) with three numbers a contact, as h has rows: x itself in 3D, zeros in the third place in the plane."""
        if self.dimension == 3:
            return np.ascontiguousarray(x)
        wide = np.zeros((self.nc, 3))
        wide[:, : self.dimension] = x.reshape(-1, self.dimension)
        return wide.ravel()

    def by_dimension(self, u: FloatArray) -> FloatArray:
        """The first d of three numbers a contact, (m,)."""
        return u if self.dimension == 3 else u.reshape(-1, 3)[:, : self.dimension].ravel()

    def bodies(self) -> tuple[IntArray, IntArray] | None:
        """The bodies (nc, 2) of each contact, ascending, -1 where it has one alone, and which of the two each pair of a body and a contact
        is; None where a contact has three."""
        bodies, side = np.full((self.nc, 2), -1), np.empty(len(self.contacts), dtype=np.int64)
        return (bodies, side) if sides_of_pairs(self.first, self.contacts, bodies, side) else None

    def modes(self, k: int, side: IntArray) -> FloatArray:
        """G (nc, d, 2 k): row a of the matrix with which W - G G^T is what is left of W without the k most compliant motions of each body,
        its first k columns those of a contact's first body (side 0), the others of the second."""
        G = np.zeros((self.nc, self.dimension, 2 * k))
        for begin, C, kind in self.runs:
            L = np.stack([compliant_motions(own, k) for own in C]) if C.shape[1] else np.zeros((len(C), 0, k))
            add_modes(self.first, self.contacts, self.begins, self.unknowns, self.weights, begin, kind, L, side, G)
        return G


def by_matrices(runs: Iterable[Run], wanted: BoolArray) -> Iterator[tuple[IntArray, FloatArray]]:
    """Of the bodies `wanted` (bodies,) in `runs`, those that share a C (k, k), and this."""
    known: dict[tuple[int, int], tuple[list[IntArray], FloatArray]] = {}
    for begin, C, kind in runs:
        on = np.flatnonzero(wanted[begin : begin + len(kind)])
        for k in np.unique(kind[on]):
            place = C[k].__array_interface__["data"][0], C.shape[1]  # runs of one part have the same matrix
            known.setdefault(place, ([], C[k]))[0].append(begin + on[kind[on] == k])
    for bodies, own in known.values():
        yield np.concatenate(bodies), own


def compliant_motions(C: FloatArray, k: int) -> FloatArray:
    """L (n, k) with L L^T <= C, both sides of it equal on the space of about the k largest eigenvalues of C (n, n), symmetric and positive
    semidefinite; columns of zeros where C's rank is less.

    L L^T = Y (Q^T Y)^-1 Y^T, Y = C Q, for Q of subspace iterations from a fixed start (P.-G. Martinsson, J. A. Tropp, Acta Numerica 29,
    2020, section 14: Nystrom's approximation, which leaves a positive semidefinite remainder whatever Q is).
    """
    n = len(C)
    if n <= EIGEN_UP_TO:
        values, vectors = np.linalg.eigh(C)
        vectors = vectors * np.sqrt(np.where(values > NEGLIGIBLE * values[-1], values, 0.0))
    else:
        Q = np.random.default_rng(0).standard_normal((n, min(n, k + MORE)))
        for _ in range(SWEEPS):
            Q = np.linalg.qr(C @ Q)[0]
        Y = C @ Q
        values, vectors = np.linalg.eigh(Q.T @ Y)
        regular = values > NEGLIGIBLE * values[-1]
        vectors = Y @ (vectors * np.where(regular, 1 / np.sqrt(np.where(regular, values, 1.0)), 0.0))
    L = np.zeros((n, k))
    L[:, : min(k, vectors.shape[1])] = vectors[:, ::-1][:, :k]
    return L


@dataclass(frozen=True, eq=False)
class KnownShares:
    """What makes the shares of W, for those who ask for them; W: the very matrix that they are known for, as in `Motion`."""

    W: Matrix
    make: Callable[[], BodyShares]

    __repr__ = brief

    def of(self, W: Matrix) -> KnownShares | None:
        """This value if it belongs to W, None if to another matrix."""
        return self if self.W is W else None

    def stored_as(self, W: Matrix, other: Matrix) -> KnownShares | None:
        """The value for `other`, which is W in another storage; None where it does not belong to W."""
        return replace(self, W=other) if self.W is W else None


def shares_of(H: sp.csc_array, body: IntArray, column: IntArray, count: int, dimension: int, runs: tuple[Run, ...]) -> BodyShares:
    """The shares of W = H^T A^-1 H; H, body, column and count as in `DelassusSum`."""
    h: tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]
    nc = H.shape[1] // dimension
    h = entries_by_body(H.indptr, H.indices, H.data, body, column, count, dimension, np.arange(nc))
    return BodyShares(*h, runs, nc, dimension)
