"""Solves one frictional contact problem with Siconos, on request; run by the Python that has `siconos.numerics`.

    python3 siconos_worker.py PROBLEM.npz      then one JSON request a line on stdin, one JSON reply a line on stdout
    python3 siconos_worker.py --check          says whether Siconos can be imported

PROBLEM.npz: dimension, mu (nc,), and W (m, m), q (m,) for the local solvers; for a global problem also M (n, n), H (n, m), f (n,),
w (m,). A matrix X is stored as compressed rows X.data, X.indices, X.indptr, X.shape. Siconos' conventions are ours: M v = H r + f,
u = H^T v + w, u = W r + q, normal component first.

The first line on stdout lists the configurations that fit the problem: [name, storage] pairs. Request: configuration, storage, tol,
limit [s], and optionally memory [MiB] and `iterations` (run exactly so many, for the speed of a sweep). Reply: status, info, iterations,
seconds and cpu_seconds of the driver's call alone (median of repetitions where it is short), and r.
Each request runs in a forked child, so that a hang or crash of a solver ends that request only.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, MutableMapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Protocol, TypedDict

import numpy as np
from numpy.typing import NDArray

if __name__ == "__main__":  # by a Python without fcsim: the file beside this one
    from killable import FINISHED, Row, Task, die_with_parent, run_killable  # type: ignore[import-not-found] # not on mypy's path
else:
    from fcsim.bench.workers.killable import FINISHED, Row, Task, die_with_parent, run_killable

DENSE_UP_TO = 3000
REPEAT_WITHIN, REPEAT_AT_MOST = 0.3, 7
UNLIMITED = 10_000_000
NEWTON_ITERATIONS = 1000

BLOCKS = ("block", "dense")
FACTORS = ("sparse", "dense")


class Configuration(TypedDict, total=False):
    """A solver by the names of Siconos' constants, and the storages of W that it takes; rho: it is given one over the norm of W."""

    solver: str
    internal: str
    iparam: dict[str, str | int]
    storages: tuple[str, ...]
    rho: str


class SolverOptions(Protocol):
    """Siconos' options."""

    iparam: MutableMapping[int, int]
    dparam: MutableMapping[int, float]


def _newton(solver: str, **iparam: str) -> Configuration:
    return {"solver": solver, "iparam": {"IPARAM_MAX_ITER": NEWTON_ITERATIONS, **iparam}, "storages": FACTORS}


def _sweeps(solver: str, internal: str = "", storages: tuple[str, ...] = BLOCKS, **iparam: str | int) -> Configuration:
    return {"solver": solver, "internal": internal, "iparam": {"IPARAM_MAX_ITER": UNLIMITED, **iparam}, "storages": storages}


_NSN, _ONE = "FRICTION_3D_NSN_", "FRICTION_3D_ONECONTACT_"
_JEAN_MOREAU = {_NSN + "FORMULATION": _NSN + "FORMULATION_JEANMOREAU_STD"}
_NO_SEARCH = {_NSN + "LINESEARCH": _NSN + "LINESEARCH_NO"}

# names are Siconos' without its prefix SICONOS_; what is not given keeps Siconos' default
LOCAL_3D: dict[str, Configuration] = {
    "NSGS": _sweeps("FRICTION_3D_NSGS"),
    "NSGS NSN": _sweeps("FRICTION_3D_NSGS", _ONE + "NSN"),
    "NSN_AC no line search": _newton("FRICTION_3D_NSN_AC", **_NO_SEARCH),
    "NSN_AC": _newton("FRICTION_3D_NSN_AC"),
    "ADMM": _sweeps("FRICTION_3D_ADMM", storages=FACTORS),
    "PROX NSN_AC": _sweeps("FRICTION_3D_PROX", storages=FACTORS),
    "NSGS NSN_GP": _sweeps("FRICTION_3D_NSGS", _ONE + "NSN_GP"),
    "NSGS ProjectionOnCone": _sweeps("FRICTION_3D_NSGS", _ONE + "ProjectionOnCone"),
    "NSGS ProjectionOnConeWithLocalIteration": _sweeps("FRICTION_3D_NSGS", _ONE + "ProjectionOnConeWithLocalIteration"),
    "NSGS ProjectionOnConeWithDiagonalization": _sweeps("FRICTION_3D_NSGS", _ONE + "ProjectionOnConeWithDiagonalization"),
    "NSGS ProjectionOnConeWithRegularization": _sweeps("FRICTION_3D_NSGS", _ONE + "ProjectionOnConeWithRegularization"),
    "NSGS QUARTIC": _sweeps("FRICTION_3D_NSGS", _ONE + "QUARTIC"),
    "NSGS QUARTIC_NU": _sweeps("FRICTION_3D_NSGS", _ONE + "QUARTIC_NU"),
    "NSGS NCPGlockerFBNewton": _sweeps("FRICTION_3D_NSGS", "FRICTION_3D_NCPGlockerFBNewton"),
    "NSGS shuffled": _sweeps("FRICTION_3D_NSGS", FRICTION_3D_NSGS_SHUFFLE="FRICTION_3D_NSGS_SHUFFLE_TRUE_EACH_LOOP"),
    "NSGS sparse": _sweeps("FRICTION_3D_NSGS", storages=("sparse",)),
    "NSN_AC JEANMOREAU": _newton("FRICTION_3D_NSN_AC", **_JEAN_MOREAU),
    "NSN_AC JEANMOREAU no line search": _newton("FRICTION_3D_NSN_AC", **_JEAN_MOREAU, **_NO_SEARCH),
    "NSN_AC hybrid VI_EG": _newton("FRICTION_3D_NSN_AC", **{_NSN + "HYBRID_STRATEGY": _NSN + "HYBRID_STRATEGY_VI_EG_NSN"}),
    "NSN_AC CSLUSOL": _newton("FRICTION_3D_NSN_AC", **_NO_SEARCH, **{_NSN + "LINEAR_SOLVER": _NSN + "USE_CSLUSOL"}),
    "NSN_AC_TEST": _newton("FRICTION_3D_NSN_AC_TEST"),
    "NSN_FB": _newton("FRICTION_3D_NSN_FB"),
    "NSN_FB no line search": _newton("FRICTION_3D_NSN_FB", **_NO_SEARCH),
    "NSN_NM": _newton("FRICTION_3D_NSN_NM"),
    "NSN_NM no line search": _newton("FRICTION_3D_NSN_NM", **_NO_SEARCH),
    "PROX NSGS": _sweeps("FRICTION_3D_PROX", "FRICTION_3D_NSGS"),
    "PROX regularisation": _sweeps(
        "FRICTION_3D_PROX", storages=FACTORS, FRICTION_3D_PROXIMAL_IPARAM_STRATEGY="FRICTION_3D_PROXIMAL_REGULARIZATION"
    ),
    "ADMM balanced": _sweeps(
        "FRICTION_3D_ADMM",
        storages=FACTORS,
        FRICTION_3D_ADMM_IPARAM_RHO_STRATEGY="FRICTION_3D_ADMM_RHO_STRATEGY_SCALED_RESIDUAL_BALANCING",
        FRICTION_3D_ADMM_IPARAM_INITIAL_RHO="FRICTION_3D_ADMM_INITIAL_RHO_NORM_INF",
    ),
    "ADMM rho by norm": _sweeps(
        "FRICTION_3D_ADMM",
        storages=FACTORS,
        FRICTION_3D_ADMM_IPARAM_RHO_STRATEGY="FRICTION_3D_ADMM_RHO_STRATEGY_CONSTANT",
        FRICTION_3D_ADMM_IPARAM_INITIAL_RHO="FRICTION_3D_ADMM_INITIAL_RHO_NORM_INF",
    ),
    "NSGSV": _sweeps("FRICTION_3D_NSGSV", _ONE + "ProjectionOnCone_velocity"),
    "TFP": _sweeps("FRICTION_3D_TFP"),
    "TFP given tolerance": _sweeps(
        "FRICTION_3D_TFP", FRICTION_3D_IPARAM_INTERNAL_ERROR_STRATEGY="FRICTION_3D_INTERNAL_ERROR_STRATEGY_GIVEN_VALUE"
    ),
    "TFP CONVEXQP_PG_CYLINDER": _sweeps("FRICTION_3D_TFP", "FRICTION_3D_CONVEXQP_PG_CYLINDER"),
    "TFP VI_FPP_Cylinder": _sweeps("FRICTION_3D_TFP", "FRICTION_3D_VI_FPP_Cylinder"),
    "ACLMFP": _sweeps("FRICTION_3D_ACLMFP"),
    "SOCLCP": _sweeps("FRICTION_3D_SOCLCP"),
    "PFP": _sweeps("FRICTION_3D_PFP"),
    "VI_EG": _sweeps("FRICTION_3D_VI_EG"),
    "VI_FPP": _sweeps("FRICTION_3D_VI_FPP"),
    "EG": _sweeps("FRICTION_3D_EG"),
    "FPP": _sweeps("FRICTION_3D_FPP") | {"rho": "1 / norm"},
    "DSFP": _sweeps("FRICTION_3D_DSFP") | {"rho": "1 / norm"},
    "HP": _sweeps("FRICTION_3D_HP"),
}
GLOBAL_3D: dict[str, Configuration] = {
    "GLOBAL NSN_AC": _newton("GLOBAL_FRICTION_3D_NSN_AC"),
    "GLOBAL NSN_AC_WR": _newton("GLOBAL_FRICTION_3D_NSN_AC_WR"),
    "GLOBAL NSGS_WR": _sweeps("GLOBAL_FRICTION_3D_NSGS_WR"),
    "GLOBAL NSGS": _sweeps("GLOBAL_FRICTION_3D_NSGS"),
    "GLOBAL ADMM": _sweeps("GLOBAL_FRICTION_3D_ADMM"),
    "GLOBAL ADMM_WR": _sweeps("GLOBAL_FRICTION_3D_ADMM_WR"),
    "GLOBAL IPM": _newton("GLOBAL_FRICTION_3D_IPM"),
    "GLOBAL PROX_WR": _sweeps("GLOBAL_FRICTION_3D_PROX_WR"),
    "GLOBAL ACLMFP": _sweeps("GLOBAL_FRICTION_3D_ACLMFP"),
    "GLOBAL TFP_WR": _sweeps("GLOBAL_FRICTION_3D_TFP_WR"),
    "GLOBAL NSGSV_WR": _sweeps("GLOBAL_FRICTION_3D_NSGSV_WR", _ONE + "ProjectionOnCone_velocity"),
    "GLOBAL DSFP_WR": _sweeps("GLOBAL_FRICTION_3D_DSFP_WR"),
    "GLOBAL VI_EG": _sweeps("GLOBAL_FRICTION_3D_VI_EG"),
    "GLOBAL VI_FPP": _sweeps("GLOBAL_FRICTION_3D_VI_FPP"),
}
LOCAL_2D: dict[str, Configuration] = {
    "2D NSGS": _sweeps("FRICTION_2D_NSGS"),
    "2D CPG": _sweeps("FRICTION_2D_CPG", storages=("dense",)),
    "2D LEMKE": _sweeps("FRICTION_2D_LEMKE", storages=("dense",)),
    "2D ENUM": {"solver": "FRICTION_2D_ENUM", "iparam": {}, "storages": ("dense",)},
}
CONFIGURATIONS = {**LOCAL_3D, **GLOBAL_3D, **LOCAL_2D}


class Triplets:
    """A matrix of the .npz file and the texts by which Siconos reads it, one a storage."""

    def __init__(self, arrays: Mapping[str, NDArray], letter: str) -> None:
        self.shape = tuple(int(size) for size in arrays[f"{letter}.shape"])
        indptr = arrays[f"{letter}.indptr"]
        row = np.repeat(np.arange(self.shape[0]), np.diff(indptr))
        column, value = arrays[f"{letter}.indices"].astype(np.int64), arrays[f"{letter}.data"]
        kept = value != 0
        self.row, self.column, self.value = row[kept], column[kept], value[kept]

    def toarray(self) -> NDArray[np.float64]:
        dense = np.zeros(self.shape)
        np.add.at(dense, (self.row, self.column), self.value)
        return dense

    def text(self, storage: str, d: int, numerics: ModuleType) -> Iterator[str]:
        rows, columns = self.shape
        kind = {"dense": numerics.NM_DENSE, "block": numerics.NM_SPARSE_BLOCK, "sparse": numerics.NM_SPARSE}[storage]
        yield f"{kind}\n{rows}\n{columns}\n"
        if storage == "dense":  # read in the order of memory, column by column
            yield f"{rows}\t{columns}\n"
            yield numbers(self.toarray().T.ravel())
        elif storage == "sparse":
            count = len(self.value)
            yield f"{numerics.NSM_TRIPLET}\nCSparse\ntriplet: {rows}-by-{columns}, nzmax: {count} nnz: {count}\n"
            triplets = zip(self.row.tolist(), self.column.tolist(), self.value.tolist(), strict=True)
            yield "".join(f"    {i} {j} : {value!r}\n" for i, j, value in triplets)
        else:
            yield from self._blocks(d)

    def _blocks(self, d: int) -> Iterator[str]:
        nb = self.shape[0] // d
        key = (self.row // d) * nb + self.column // d
        present = np.union1d(key, np.arange(nb) * (nb + 1))
        data = np.zeros((len(present), d, d))
        np.add.at(data, (np.searchsorted(present, key), self.column % d, self.row % d), self.value)  # blocks column by column
        ends = " ".join(str(d * (k + 1)) for k in range(nb)) + "\n"
        first = np.searchsorted(present, np.arange(nb + 1) * nb)
        yield f"{len(present)}\n{nb}\n{nb}\n{ends}{ends}{nb + 1}\n{len(present)}\n"
        yield " ".join(map(str, first.tolist())) + "\n" + " ".join(map(str, (present % nb).tolist())) + "\n"
        for k, block in enumerate(data.reshape(len(present), -1).tolist()):
            yield f"{k}\n" + "\n".join(map(repr, block)) + "\n"


def numbers(values: NDArray[np.float64]) -> str:
    return "\n".join(map(repr, values.tolist())) + "\n"


class Problem:
    """The problem as Siconos holds it, by storage, read when first needed."""

    def __init__(self, path: str, numerics: ModuleType) -> None:
        self.numerics = numerics
        with np.load(path) as file:
            self.arrays = dict(file)
        self.d = int(self.arrays["dimension"])
        self.m, self.nc = len(self.arrays["q"]), len(self.arrays["mu"])
        self.is_global = "M.data" in self.arrays
        self._held: dict[str, object] = {}

    def configurations(self) -> list[tuple[str, str]]:
        local = LOCAL_2D if self.d == 2 else LOCAL_3D
        fitting = [
            (name, storage)
            for name, configuration in local.items()
            for storage in configuration["storages"]
            if (storage != "dense" or self.m <= DENSE_UP_TO) and (configuration["solver"] != "FRICTION_2D_ENUM" or self.nc <= 10)
        ]
        return fitting + [(name, "global") for name in GLOBAL_3D if self.is_global and self.d == 3]

    def held(self, storage: str) -> object:
        """The problem in Siconos' memory: `storage` is dense, block or sparse for W, or global."""
        if storage not in self._held:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "problem.dat"
                vectors = ("f", "w", "mu") if storage == "global" else ("q", "mu")
                with path.open("w", encoding="ascii") as file:
                    file.write(f"{self.d}\n{self.nc}\n")
                    if storage == "global":
                        for letter in ("M", "H"):
                            file.writelines(Triplets(self.arrays, letter).text("sparse", self.d, self.numerics))
                    else:
                        file.writelines(Triplets(self.arrays, "W").text(storage, self.d, self.numerics))
                    for letter in vectors:
                        file.write(numbers(self.arrays[letter]))
                n = self.numerics
                read = n.globalFrictionContact_new_from_filename if storage == "global" else n.frictionContact_new_from_filename
                self._held[storage] = read(str(path))
        return self._held[storage]

    def norm(self) -> float:
        """An upper bound of the spectral norm of W: sqrt(||W||_1 ||W||_inf)."""
        W = Triplets(self.arrays, "W")
        sums = [np.bincount(index, np.abs(W.value), self.m).max() for index in (W.row, W.column)]
        return float(np.sqrt(sums[0] * sums[1]))

    def options(self, request: Row) -> SolverOptions:
        n, configuration = self.numerics, CONFIGURATIONS[request["configuration"]]

        def constant(name: str | int) -> int:
            return getattr(n, f"SICONOS_{name}") if isinstance(name, str) else name

        options = n.SolverOptions(constant(configuration["solver"]))
        if configuration.get("internal"):
            n.solver_options_update_internal(options, 0, constant(configuration["internal"]))
        for name, value in configuration["iparam"].items():
            options.iparam[constant(name)] = constant(value)
        options.dparam[n.SICONOS_DPARAM_TOL] = request["tol"]
        if "rho" in configuration:
            options.dparam[3] = request["rho"]
        if "iterations" in request:
            options.iparam[n.SICONOS_IPARAM_MAX_ITER] = request["iterations"]
            options.iparam[n.SICONOS_FRICTION_3D_IPARAM_ERROR_EVALUATION] = n.SICONOS_FRICTION_3D_NSGS_ERROR_EVALUATION_LIGHT
        return options

    def solve(self, request: Row) -> Row:
        """Run the solver once from r = 0."""
        n, problem, options = self.numerics, self.held(request["storage"]), self.options(request)
        r, u = np.zeros(self.m), np.zeros(self.m)
        vectors = [r, u]
        driver = n.fc2d_driver if self.d == 2 else n.fc3d_driver
        if request["storage"] == "global":
            vectors.append(np.zeros(len(self.arrays["f"])))  # v
            driver = n.gfc3d_driver
        wall, cpu = time.perf_counter(), time.process_time()
        info = driver(problem, *vectors, options)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        iterations = int(options.iparam[n.SICONOS_IPARAM_ITER_DONE])
        return {"info": int(info), "iterations": iterations, "seconds": wall, "cpu_seconds": cpu, "r": r.tolist()}

    def runs(self, request: Row) -> Iterator[Row]:
        """One run; where it is short, then the medians of several (with what Siconos keeps in the problem, to its advantage)."""
        runs = [self.solve(request)]
        yield runs[0]
        if runs[0]["seconds"] < REPEAT_WITHIN:
            while sum(run["seconds"] for run in runs) < REPEAT_WITHIN and len(runs) < REPEAT_AT_MOST:
                runs.append(self.solve(request))
            yield {**runs[-1], **{key: statistics.median(run[key] for run in runs) for key in ("seconds", "cpu_seconds")}}


def answer(problem: Problem, request: Row) -> Row:
    problem.held(request["storage"])  # read here, once for all children
    if "rho" in CONFIGURATIONS[request["configuration"]]:
        request["rho"] = 1 / problem.norm()
    task = Task(None, lambda: problem.runs(request), request["limit"], request.get("memory"))
    ended = next(run_killable([task], quiet=True))
    return {**(ended.items[-1] if ended.items else {}), "status": FINISHED if ended.items else ended.how}


def main() -> int:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    die_with_parent()
    try:
        numerics: ModuleType = import_module("siconos.numerics")
    except ImportError as error:
        print(f"Siconos cannot be imported by {sys.executable}: {error}", file=sys.stderr)
        return 3
    if sys.argv[1:] == ["--check"]:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print(version("siconos"))
        except PackageNotFoundError:
            print("unknown version")
        return 0
    replies = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what the C library prints does not mix with the replies
    problem = Problem(sys.argv[1], numerics)
    print(json.dumps(problem.configurations()), file=replies)
    for line in sys.stdin:
        print(json.dumps(answer(problem, json.loads(line))), file=replies)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
