"""The linear systems (1 + K W) dr = rhs of the pieces of a path, K (nc, d, d) of which changes at one contact from piece to piece.

Source: W. W. Hager, SIAM Review 31, 1989 (the inverse of a matrix that was changed by one of low rank: Sherman, Morrison, Woodbury).
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple, Protocol, cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.block_factors._single_factor_kernels import factorise_single
from fcsim.linear.block_factors.analysis import Plan
from fcsim.linear.factors import DenseLU, SingularMatrix
from fcsim.problem import Delassus
from fcsim.solvers.newton.systems.choice import eliminated_in_velocities
from fcsim.solvers.newton.systems.velocity import bodies_of, faces_of
from fcsim.solvers.proximal._inner_kernels import product

Fronts = tuple[IntArray, FloatArray, IntArray, FloatArray, Plan, tuple[FloatArray | IntArray, ...]]
"""unknowns, h, places, M in the pattern, its plan, the fronts' arrays: as of `Bodies.fronts`."""


class Arrays(NamedTuple):
    """What `follow_in_velocities` and `newton_on_pieces` read of bodies and contacts, in their order, and where they put their factors; the
    contacts in `InVelocities.order`."""

    faces: IntArray
    unknowns: NDArray[np.uint64]
    h: FloatArray
    normals: FloatArray
    rows: FloatArray
    places: IntArray
    masses: FloatArray
    plan: Plan
    fronts: tuple[FloatArray | IntArray, ...]
    mass: tuple[IntArray | FloatArray, ...]


class Pieces(Protocol):
    """K (nc, d, d): what is solved with; sign: of det(1 + K W). `factor` and `change` raise SingularMatrix."""

    K: FloatArray
    sign: int

    def factor(self, K: FloatArray) -> None:
        """Take K (nc, d, d)."""
        ...

    def change(self, contact: int, K: FloatArray) -> None:
        """Take K (nc, d, d), of which only what this contact has differs by much."""
        ...

    def solve(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(dr, W dr), each (nc, d), for rhs (nc, d)."""
        ...

    def product(self, r: FloatArray) -> FloatArray:
        """W r (nc, d)."""
        ...


def pieces_of(operator: Delassus) -> Pieces:
    """In the velocities of bodies with few degrees of freedom, else in the reactions of the contacts that are not open."""
    rigid = operator.motion is not None and operator.motion.own is None
    return InVelocities(operator) if rigid and eliminated_in_velocities(operator) else InReactions(operator)


MOST_CHANGED = 12
"""Contacts that are changed before the matrix is factored anew: an elimination costs about twenty solutions with its factor."""


class InVelocities:
    """(M + H K H^T) dv = H rhs and dr = rhs - K H^T dv for W = H^T M^-1 H; both determinants have one sign (Sylvester).

    With the factor of K_0 and J_0 = M + H K_0 H^T, Z = J_0^-1 H_c of the contacts c that were changed, and C = K_c - K_0c,

        dv = y - Z C (1 + H_c^T Z C)^-1 H_c^T y,    y = J_0^-1 H rhs.
    """

    def __init__(self, operator: Delassus) -> None:
        self._bodies, self._shape = bodies_of(operator), (operator.nc, operator.dimension)
        self.K, self.sign = np.empty(0), 1
        assert operator.motion is not None
        self._mass = sp.csr_array(operator.motion.M)
        self.mean_mass = float(self._mass.diagonal().mean())

    @property
    def order(self) -> IntArray:
        """The contacts (nc,) as compiled paths have them: `Bodies.order`."""
        return self._bodies.order

    def ordered[T: np.generic](self, values: NDArray[T]) -> NDArray[T]:
        """Values (nc, ...) of the contacts in `order`, in their own."""
        found = np.empty_like(values)
        found[self.order] = values
        return found

    @cached_property
    def arrays(self) -> Arrays:
        """What paths read that are followed in one compiled call, and where they put their factors: see `follow_in_velocities`."""
        mass = self._mass.indptr, self._mass.indices, self._mass.data
        unknowns, rows, places, masses, plan, fronts = cast(Fronts, self._bodies.fronts(self._mass))
        unknowns, rows, places = unknowns[self.order], rows[self.order], places[self.order]
        touched = np.where(unknowns < 0, len(mass[0]) - 1, unknowns).astype(np.uint64)
        h = np.zeros((len(rows), rows.shape[2], 4))
        h[:, :, : rows.shape[1]] = rows.transpose(0, 2, 1)
        return Arrays(faces_of(unknowns), touched, h, h[:, :, 0].copy(), rows, places, masses, plan, fronts, mass)

    @cached_property
    def mass(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """M factored for `newton_on_pieces`: the last three of the fronts' arrays."""
        arrays = self.arrays
        _, first, starts, _, offsets, values, borders, pivots = arrays.fronts
        own = np.empty(len(values)), np.empty(len(borders)), np.empty(len(pivots), dtype=np.int64)
        if not factorise_single(arrays.plan, first, starts, offsets, arrays.masses, *own):
            raise SingularMatrix("the bodies' M is singular")
        return own

    def impulses(self, r: FloatArray) -> FloatArray:
        """H r (n,) of r (nc, d)."""
        found: FloatArray = self._bodies.H @ r.ravel()
        return found

    def factor(self, K: FloatArray) -> None:
        self.K, self._before = K.copy(), K
        self._inverse, self._first = self._bodies.factored(K)
        self.sign, self._changed = self._first, np.empty(0, dtype=np.int64)
        self._small: DenseLU | None = None
        self._Z = np.empty((self._bodies.HT.shape[1], 0))

    def change(self, contact: int, K: FloatArray) -> None:
        bodies, d = self._bodies, self._shape[1]
        if contact not in self._changed:
            if len(self._changed) == MOST_CHANGED:
                self.factor(K)
                return
            columns = np.zeros((d, len(self._Z)))
            known = bodies.unknowns[contact] >= 0
            columns[:, bodies.unknowns[contact, known]] = bodies.h[contact][:, known]
            self._Z = np.column_stack([self._Z, *(self._inverse(column) for column in columns)])
            self._changed = np.append(self._changed, contact)
        self.K[contact] = K[contact]
        C = self.K[self._changed] - self._before[self._changed]
        self._ZC = np.matmul(self._Z.reshape(len(self._Z), -1, 1, d), C)[:, :, 0].reshape(self._Z.shape)
        small = self._small = DenseLU(self._at_changed(self._ZC) + np.eye(self._ZC.shape[1]))
        self.sign = self._first * small.sign

    def _at_changed(self, v: FloatArray) -> FloatArray:
        """H_c^T v (d changed, ...) for v (n, ...); unknowns that a contact lacks have zeros in h."""
        h, places = self._bodies.h[self._changed], self._bodies.unknowns[self._changed]
        found: FloatArray = np.matmul(h, v[places].reshape(*places.shape, -1)).reshape(-1, *v.shape[1:])
        return found

    def solve(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        bodies = self._bodies
        dv = self._inverse(bodies.H @ rhs.ravel())
        if self._small is not None:
            dv = dv - self._ZC @ self._small.solve(self._at_changed(dv))
        Wdr = (bodies.HT @ dv).reshape(self._shape)
        return rhs - np.einsum("aij,aj->ai", self.K, Wdr), Wdr

    def product(self, r: FloatArray) -> FloatArray:
        arrays = self.arrays
        found = product(arrays.faces, arrays.unknowns, arrays.h, arrays.fronts, self.mass, self.impulses(r))
        return self.ordered(found)[:, : self._shape[1]]


class InReactions:
    """Dense LU of the rows and columns of contacts whose K is not zero; the others' dr is rhs."""

    def __init__(self, operator: Delassus) -> None:
        self._operator, self._shape = operator, (operator.nc, operator.dimension)
        W = operator.W
        self._W = W if isinstance(W, np.ndarray) else W.toarray()
        self.K, self.sign = np.empty(0), 1

    def factor(self, K: FloatArray) -> None:
        self.K = K
        nc, d = self._shape
        closed = np.flatnonzero(K[:, 0, 0])
        self._closed = (d * closed[:, None] + np.arange(d)).ravel()
        rows = self._W[self._closed].reshape(len(closed), d, nc * d)
        self._KW = np.einsum("aij,ajm->aim", K[closed], rows).reshape(-1, nc * d)
        self._factor = DenseLU(self._KW[:, self._closed] + np.eye(len(self._closed)), overwrite=True) if len(closed) else None
        self.sign = 1 if self._factor is None else self._factor.sign

    def change(self, contact: int, K: FloatArray) -> None:
        self.factor(K)

    def solve(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        dr = rhs.ravel().copy()
        if self._factor is not None:
            others = dr.copy()
            others[self._closed] = 0.0
            dr[self._closed] = self._factor.solve(dr[self._closed] - self._KW @ others)
        return dr.reshape(self._shape), self.product(dr)

    def product(self, r: FloatArray) -> FloatArray:
        product: FloatArray = self._operator @ r.ravel()
        return product.reshape(self._shape)
