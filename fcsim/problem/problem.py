"""The frictional contact problem in its two forms.

Global form: M v = H r + G l + f, G^T v + b = 0, u = H^T v + w, K* ∋ u + g(u) ⊥ r ∈ K. Local form: u = W r + V l + q,
V^T r + R l + s = 0 with the Delassus operator W. The symbols are those of FCLIB (Acary et al., INRIA report RT-0444).
In dynamics v, u are velocities [m/s] and r impulses [N s]; in quasi-statics v, u are displacement increments [m] and r forces [N].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, cast, runtime_checkable

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.brief import brief, by_fields
from fcsim.errors import InputError
from fcsim.linear.late.late_rows import source_of
from fcsim.linear.over_ranks.implicit_matrix import ImplicitMatrix, LateMatrix, with_entries
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.problem.bodies.shares import KnownShares
from fcsim.problem.delassus import Delassus
from fcsim.problem.distributed import DistributedDelassus, whole_delassus
from fcsim.problem.motion import Motion


def _reals(values: object, what: str, kind: str) -> FloatArray:
    """Real numbers as an array of floats that may be written to: for others, compiled loops would be compiled anew, which takes half a
    minute. A copy where it has to be; InputError for anything else, masked arrays included, of which the mask would be forgotten."""
    try:
        array = np.asarray(values)
        real = array if array.dtype.kind == "c" else np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected a {kind} of numbers, got {type(values).__name__} of something else") from None
    if real.dtype.kind == "c" or isinstance(values, np.ma.MaskedArray):
        got = "complex ones" if real.dtype.kind == "c" else "a masked array"
        raise InputError(f"{what}: expected a {kind} of real numbers, got {got}")
    return real if real.flags.writeable else real.copy()


def as_vector(values: object, what: str) -> FloatArray:
    """`values` as a contiguous vector of finite floats that may be written to; InputError names `what` where they are none."""
    vector = _reals(values, what, "vector")
    if vector.ndim != 1:
        raise InputError(f"{what}: expected a vector, got shape {vector.shape}")
    if not np.all(np.isfinite(vector)):
        raise InputError(f"{what}: expected finite numbers, got NaN or infinity in {np.count_nonzero(~np.isfinite(vector))} entries")
    return np.ascontiguousarray(vector)


def _finite(matrix: Matrix) -> bool:
    """Whether all entries are finite, or what they are made of where they are made late."""
    if (source := source_of(matrix)) is not None:
        return source.finite()
    entries = matrix if isinstance(matrix, np.ndarray) else matrix.data
    with np.errstate(over="ignore", invalid="ignore"):
        total = entries.sum()  # no array of booleans as large as the matrix
    return bool(np.isfinite(total)) or bool(np.all(np.isfinite(entries)))


def as_matrix(values: object, what: str, shape: tuple[int, int]) -> Matrix:
    """`values` as a matrix of that shape with finite floats, dense or sparse; one that is made late, or shared by ranks, as it is.
    InputError names `what` where they are none."""
    matrix: Matrix
    if isinstance(values, DistributedDelassus | ImplicitMatrix):
        if values.shape != shape:
            raise InputError(f"{what}: expected shape {shape}, got {values.shape}")
        return cast(Matrix, values)  # of which methods ask no more than it has
    if not sp.issparse(values):
        matrix = _reals(values, what, "matrix")
    else:
        kept = isinstance(values, sp.sparray) and values.format in ("csr", "csc", "bsr", "coo")
        matrix = cast(Matrix, values) if kept else sp.csr_array(values)
        # entries that are made late are floats that may be written to, and asking for them would make them
        if source_of(matrix) is None and _reals(matrix.data, what, "matrix") is not matrix.data:
            matrix = cast(Matrix, matrix.astype(np.float64, copy=True))
    if tuple(matrix.shape) != shape:
        raise InputError(f"{what}: expected shape {shape}, got {tuple(matrix.shape)}")
    if not _finite(matrix):
        raise InputError(f"{what}: expected finite numbers, got NaN or infinity")
    return matrix


def _friction(values: object, m: int, dimension: int) -> FloatArray:
    if dimension not in (2, 3) or isinstance(dimension, float):
        rolls = " unknowns a contact: with rolling resistance take fcsim.problem.rolling.RollingReduction" if dimension in (5, 6) else ""
        raise InputError(f"dimension: expected 2 or 3, got {dimension}{rolls}")
    mu = as_vector(values, "mu")
    if len(mu) * dimension != m:
        what = f"mu: expected a friction coefficient for every {dimension} contact unknowns in {dimension}D"
        if m % dimension == 0:
            what = f"mu: expected {m // dimension} friction coefficients for {m} contact unknowns in {dimension}D"
        other = 5 - dimension
        hint = f" (as many as in {other}D, dimension={other})" if len(mu) * other == m else ""
        raise InputError(f"{what}, got {len(mu)} for {m}{hint}" if m % dimension else f"{what}, got {len(mu)}{hint}")
    if np.any(mu < 0):
        raise InputError(f"mu: expected friction coefficients >= 0, got {mu.min()} at contact {int(mu.argmin())}")
    return mu


@dataclass(frozen=True, eq=False)
class Answer:
    """What follows from reactions r by the equations alone: u (m,), v (n,) and the multiplier l (p,), None where there is none.

    momentum: ||M v - H r - G l - f|| / ||f||, None for a problem given in local form.
    """

    u: FloatArray
    v: FloatArray | None = None
    multiplier: FloatArray | None = None
    momentum: float | None = None


class Reduced(Protocol):
    """A problem with the way to its local form u = W r + q: a `LocalProblem`, a `Reduction` or an `Elimination`.

    local is formed when it is first asked for; compliance (nc,) as `Delassus.compliance`.
    """

    @property
    def q(self) -> FloatArray: ...

    @property
    def mu(self) -> FloatArray: ...

    @property
    def dimension(self) -> int: ...

    @property
    def compliance(self) -> FloatArray: ...

    @property
    def local(self) -> LocalProblem: ...

    def answer(self, r: FloatArray) -> Answer:
        """What follows from r (m,)."""
        ...


@runtime_checkable
class Followed(Reduced, Protocol):
    """A problem whose free velocity follows its solution, u = W r + q(r), where a nonlinearity changes q by little on the way.

    q is that of the first linearisation; `answer` is of the q that belongs to its r, and None where that does not settle.
    """

    def free(self, r: FloatArray) -> FloatArray:
        """q (m,) linearised anew at r (m,)."""
        ...


class GlobalForm:
    """What global problems share whatever the cone of a contact: M v = H r + G l + f, G^T v + b = 0, u = H^T v + w.

    M given as a `LateMatrix` has its entries from when M is first read on; `momentum` does without.
    """

    M: Matrix
    H: Matrix
    f: FloatArray
    w: FloatArray
    mu: FloatArray
    G: Matrix | None
    b: FloatArray | None
    dimension: int

    def _check_vectors(self) -> None:
        """Make the vectors arrays of floats; InputError for what is none."""
        if (self.G is None) != (self.b is None):
            raise InputError("G and b: expected both or none of the equality constraints' matrix and vector")
        for name in ("f", "w") + (() if self.b is None else ("b",)):
            object.__setattr__(self, name, as_vector(getattr(self, name), name))

    def _check_matrices(self) -> None:
        """Make the matrices arrays of floats; InputError where they do not fit the vectors."""
        columns = {"M": self.n, "H": self.m} | ({} if self.b is None else {"G": len(self.b)})
        for name, count in columns.items():
            object.__setattr__(self, name, with_short_indices(as_matrix(getattr(self, name), name, (self.n, count))))
        if isinstance(self.M, LateMatrix):
            self.__dict__["_late"] = self.__dict__.pop("M")

    if not TYPE_CHECKING:  # where there is `__getattr__`, no name is unknown

        def __getattr__(self, name: str) -> Matrix:
            """M, the first time that it is read, where it is made late."""
            if name != "M" or "_late" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            M = self.__dict__["M"] = self._late.whole
            return M

    def __getstate__(self) -> dict[str, object]:
        """Other processes get M itself."""
        state = dict(self.__dict__)
        return state if state.pop("_late", None) is None else {**state, "M": self.M}

    def momentum(self, v: FloatArray) -> FloatArray:
        """M v (n,) for v (n,)."""
        M: Matrix = self.__dict__.get("_late", None) or self.M
        product: FloatArray = M @ v
        return product

    @property
    def entries(self) -> Matrix:
        """M with its entries, also where it is known by its products alone."""
        return with_entries(self.M)

    @property
    def n(self) -> int:
        return len(self.f)

    @property
    def m(self) -> int:
        return len(self.w)

    @property
    def nc(self) -> int:
        return len(self.mu)


@dataclass(frozen=True, eq=False)
class GlobalProblem(GlobalForm):
    """The global problem: find v, r with M v = H r + f, u = H^T v + w, K* ∋ u + g(u) ⊥ r ∈ K.

    M (n, n), H (n, m), f (n,), w (m,), friction mu (nc,), optionally the equality constraints G^T v + b = 0, G (n, p), b (p,);
    m = dimension * nc, rows of a contact: normal, then tangents. Units: this module's head. InputError: shapes that do not fit, numbers
    that are not finite or not real.
    """

    M: Matrix
    H: Matrix
    f: FloatArray
    w: FloatArray
    mu: FloatArray
    G: Matrix | None = None
    b: FloatArray | None = None
    dimension: int = 3

    __repr__ = brief

    def __post_init__(self) -> None:
        self._check_vectors()
        object.__setattr__(self, "mu", _friction(self.mu, self.m, self.dimension))
        self._check_matrices()

    def with_load(self, f: FloatArray) -> GlobalProblem:
        """The same problem with another right side f (n,): the matrices that are known to fit are not looked at again."""
        other = object.__new__(type(self))  # `copy` would make a late M
        other.__dict__.update(self.__dict__, f=as_vector(f, "f"))
        return other


@dataclass(frozen=True, eq=False)
class LocalProblem:
    """The local problem: find r with u = W r + q, K* ∋ u + g(u) ⊥ r ∈ K, g(u) = mu ||u_T|| N.

    W (m, m), q (m,), friction mu (nc,), optionally V (m, p), R (p, p) and s (p,): u = W r + V l + q, V^T r + R l + s = 0;
    m = dimension * nc, rows of a contact: normal, then tangents. InputError: shapes that do not fit, numbers that are not finite or
    not real.
    motion: W = H^T M^-1 H where few degrees of freedom are behind it; it shortens elimination and changes no answer. shares: W as the
    sum of the bodies' shares, where that is known: it preconditions.
    """

    W: Matrix
    q: FloatArray
    mu: FloatArray
    V: Matrix | None = None
    R: Matrix | None = None
    s: FloatArray | None = None
    dimension: int = 3
    motion: Motion | None = None
    shares: KnownShares | None = None

    __repr__ = brief

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        """With all of W, and without the shares, which are made late by factors of this process."""
        return by_fields(replace(self.whole, shares=None))

    def __post_init__(self) -> None:
        q = as_vector(self.q, "q")
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "mu", _friction(self.mu, len(q), self.dimension))
        given, W = self.W, as_matrix(self.W, "W", (len(q), len(q)))
        if self.motion is None and self.shares is None:  # which are known of the very matrix
            W = with_short_indices(W)
        object.__setattr__(self, "W", W)
        if W is not given and self.motion is not None and self.motion.of(given) is not None:
            object.__setattr__(self, "motion", self.motion.stored_as(given, W))  # it goes with the copy, or solvers would not know it
        if not (self.V is None) == (self.R is None) == (self.s is None):
            raise InputError("V, R and s: expected all or none of the equality constraints' matrices and vector")
        if self.V is not None:
            s = as_vector(self.s, "s")
            object.__setattr__(self, "s", s)
            object.__setattr__(self, "V", with_short_indices(as_matrix(self.V, "V", (len(q), len(s)))))
            object.__setattr__(self, "R", with_short_indices(as_matrix(self.R, "R", (len(s), len(s)))))

    @property
    def m(self) -> int:
        return len(self.q)

    @property
    def nc(self) -> int:
        return len(self.mu)

    @cached_property
    def delassus(self) -> Delassus:
        """W with what is derived from it once: what solvers work on."""
        motion = None if self.motion is None else self.motion.of(self.W)
        shares = None if self.shares is None else self.shares.of(self.W)
        return Delassus(self.W, self.dimension, motion=motion, shares=shares)

    def stored(self) -> LocalProblem:
        """The same problem with W in the storage of its elimination (`Delassus.stored`), or itself."""
        operator = self.delassus.stored
        if operator.W is self.W:
            return self
        motion = None if self.motion is None else self.motion.stored_as(self.W, operator.W)
        shares = None if self.shares is None else self.shares.stored_as(self.W, operator.W)
        return replace(self, W=operator.W, motion=motion, shares=shares)

    @property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d)."""
        return self.delassus.diagonal_blocks

    @property
    def compliance(self) -> FloatArray:
        """tr(W_aa) / d (nc,), see `Delassus.compliance`."""
        return self.delassus.compliance

    @property
    def whole(self) -> LocalProblem:
        """The problem with all of W on every rank where that is distributed; itself else."""
        W = whole_delassus(self.W)
        return self if W is self.W else replace(self, W=W, motion=None, shares=None)

    @property
    def local(self) -> LocalProblem:
        """Itself; a mixed problem must be eliminated first (`reduced`)."""
        if self.V is not None:
            raise InputError("problem: expected a local problem without V, R and s; see fcsim.problem.reduction.reduced")
        return self

    def answer(self, r: FloatArray) -> Answer:
        """u = W r + q."""
        return Answer(self.local.W @ r + self.q)
