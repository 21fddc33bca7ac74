"""The parameters rho of the nonsmooth equations from the contacts' own blocks W_aa (names as in Siconos)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.newton._formulation_kernels import adapted_rho, split_compliances


def spectral_norm(W: FloatArray) -> FloatArray:
    """rho = 1 / ||W_aa||_2 (nc, d)."""
    norm = np.linalg.norm(W, ord=2, axis=(1, 2))
    return np.repeat(_inverse(norm)[:, None], W.shape[1], axis=1)


def split_spectral_norm(W: FloatArray) -> FloatArray:
    """rho_N = 1 / W_NN, rho_T = 1 / lambda_max(W_TT) (nc, d)."""
    largest = split_compliances(np.ascontiguousarray(W))
    if np.all(largest > 0):
        return 1 / largest
    return np.stack([_inverse(column) for column in largest.T], axis=1)


def split_spectral_norm_condition(W: FloatArray) -> FloatArray:
    """rho_N = 1 / W_NN, rho_T = lambda_min / lambda_max^2 of W_TT with lambda_min / lambda_max no less than 1e-3 (nc, d)."""
    eigenvalues = np.linalg.eigvalsh(W[:, 1:, 1:])
    inverse = _inverse(eigenvalues[:, -1])
    rho = np.empty(W.shape[:2])
    rho[:, 0] = _inverse(W[:, 0, 0])
    rho[:, 1:] = (np.maximum(eigenvalues[:, 0] * inverse, 1e-3) * inverse)[:, None]
    return rho


def constant(W: FloatArray) -> FloatArray:
    """rho = 1 (nc, d), multiplied by the option rho_factor."""
    return np.ones(W.shape[:2])


def _inverse(values: FloatArray) -> FloatArray:
    """1 / values, where a contact without compliance of its own (both bodies held) takes the mean of the others."""
    positive = values > 0
    if positive.all():
        return 1 / values
    mean = values[positive].mean() if positive.any() else 1.0
    return 1 / np.where(positive, values, mean)


def contact_compliance(problem: LocalProblem) -> FloatArray:
    """tr(W_aa) / d (nc,), one number a contact; where it is not positive (both bodies held), the mean of the others."""
    return problem.delassus.compliance


RHO_RULES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "constant": constant,
    "spectral norm": spectral_norm,
    "split spectral norm": split_spectral_norm,
    "split spectral norm with condition number": split_spectral_norm_condition,
    "adaptive": split_spectral_norm,  # where it starts, see adapt_rho
}


def adaptive_range(first: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The least and the largest rho that the rule "adaptive" takes where it began with `first`."""
    return 0.01 * first, 100 * first


def adapt_rho(rho: FloatArray, first: FloatArray, du: FloatArray, dr: FloatArray, split: bool = True) -> FloatArray:
    """The rule "adaptive": keep 0.3 <= rho ||du|| / ||dr|| <= 0.9 over each contact's last step du, dr (nc, d), N and T apart if `split`.

    Khobotov's rule with the constants of He and Liao (J. Optim. Theory Appl. 112, 2002), as in the projection methods: rho is multiplied
    by 2/3 above and by 3/2 below, within a factor of 100 of where it began. It sees the compliance through the other contacts too.
    """
    adapted: FloatArray = adapted_rho(rho, *adaptive_range(first), du, dr, split)
    return adapted
