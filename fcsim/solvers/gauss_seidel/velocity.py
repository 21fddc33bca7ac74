"""NSGSV, nonsmooth Gauss-Seidel on velocities: r = M u + p with M = W^-1, p = -M q; contact after contact, the others' velocities fixed.

Contact a alone is r_a = M_aa u_a + p_a + sum_{b != a} M_ab u_b, a one-contact problem of the usual form with the compliance M_aa^-1,
solved by the one-contact solvers of NSGS. It needs W^-1, which is dense over contacts that are coupled at all: for small and middle
problems of full rank. Source: Acary, Brémond, Huber 2018; Siconos' NSGSV.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear._block_rows_kernels import product
from fcsim.linear.block_rows import block_rows, embed_blocks, embed_vector
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import LocalProblem, diagonal_blocks
from fcsim.problem.reduction import BlockFactor
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.sweeps import SweepOptions, contact_order, iterate
from fcsim.solvers.scaling import RHO_RULES


@dataclass(frozen=True, kw_only=True)
class VelocityOptions(SweepOptions):
    """largest_inverse: contact unknowns m beyond which a problem is refused, since W^-1 takes 8 m^2 bytes (6000: 288 MB)."""

    largest_inverse: int = 6000

    def __post_init__(self) -> None:
        super().__post_init__()
        self.integers_from(largest_inverse=0)


def nsgsv(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: VelocityOptions) -> Iterate:
    """Gauss-Seidel on velocities from u = W r + q; ends with SINGULAR where W, or a block M_aa, has no inverse."""
    d, nc, m = problem.dimension, problem.nc, problem.m
    if m > options.largest_inverse:
        raise InputError(f"NSGSV: expected at most largest_inverse = {options.largest_inverse} contact unknowns, the problem has {m}")
    try:
        M = BlockFactor(problem.W).delassus(sp.eye_array(m), d)  # I^T W^-1 I by connected components of W
        compliance = np.linalg.inv(diagonal_blocks(M, d))
    except (SingularMatrix, np.linalg.LinAlgError) as singular:
        return Iterate(r, Status.SINGULAR, str(singular))
    if not np.all(np.isfinite(M.data if sp.issparse(M) else M)):
        return Iterate(r, Status.SINGULAR, "W has no finite inverse")
    solver = ONE_CONTACT[options.one_contact]
    rho = np.ascontiguousarray(RHO_RULES[solver.rho](compliance)[:, :2])
    W_rows, M_rows = block_rows(problem.W, d), block_rows(M, d)
    inverse, order = embed_blocks(compliance), contact_order(nc, options)
    q, reaction = embed_vector(problem.q, d), embed_vector(r, d)
    p = product(*M_rows, np.zeros((nc, 3)), -q)
    velocity = product(*W_rows, q, reaction)

    def sweep(tolerance: float, tau: float, count: int) -> tuple[float, int]:
        change, _, _ = solver.sweep_velocities(
            *(*M_rows, inverse, p, problem.mu, rho, order(), velocity, reaction),
            *(tolerance, options.local_iterations, options.relaxation),
        )
        return float(np.sqrt(change)) / monitor.scale, 1  # ||u|| itself goes to zero where all contacts stick

    def point() -> tuple[FloatArray, FloatArray]:
        return reaction[:, :d].flatten(), product(*W_rows, q, reaction)[:, :d].flatten()

    return iterate(sweep, point, nc, monitor, options)
