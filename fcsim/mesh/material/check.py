"""A law held against itself: energy, stress and tangent by finite differences; what is wrong from the first strain on is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.mesh.material.law import Circumstances, PointLaw, Response, initial_variables

TRIED = 1e-6
"""Of the strains that are tried: below what yields, cracks or locks."""

WRONG = 0.3
"""Share of the stiffness by which the middle one of the tried tangents may differ from differences of the stress: a tangent need not be
exact, and at kinks is none."""

_UNSEEN = 1e-4
"""Share of the stress that may depend on how a body is turned."""

STEP = 1e-6
"""Of the differences: central, so that their error is about 1e-12 of the third derivative and 1e-10 of round-off."""


@dataclass(frozen=True)
class Deviations:
    """Largest differences relative to the largest stress and tangent: stress against the derivative of stored energy (of laws that
    dissipate
    nothing in the step; nan for others and for those that report no energy), tangent against that of stress, tangent against its
    transpose."""

    stress: float
    tangent: float
    symmetry: float


def check_law(law: PointLaw, strains: ArrayLike | None = None, before: ArrayLike | None = None, dt: float = 1e-3) -> Deviations:
    """Compare a law's energy, stress and tangent at strains (n, 3, 3) (default: eight random ones, within 20 % or 0.2 %) by finite
    differences."""
    finite = law.strain == "finite"
    if strains is None:
        noise = np.random.default_rng(1).uniform(-1, 1, (8, 3, 3))
        strains = np.eye(3) + 0.2 * noise if finite else 1e-3 * (noise + noise.transpose(0, 2, 1))
    points = np.asarray(strains, dtype=float)
    if points.ndim != 3 or points.shape[1:] != (3, 3):
        raise InputError(f"check_law, strains: expected shape (n, 3, 3), got {points.shape}")
    variables = np.tile(initial_variables(law), (len(points), 1)) if before is None else np.asarray(before, dtype=float)
    at = Circumstances(np.zeros((len(points), 3)), dt, dt)
    answer = law.respond(points, variables, at, True)
    assert answer.tangent is not None
    step = STEP * (1.0 if finite else max(float(np.abs(points).max()), 1e-12))
    by_energy, by_stress = np.empty((2, len(points), 3, 3)), np.empty((len(points), 3, 3, 3, 3))
    for k in range(3):
        for l in range(3):
            ends = [law.respond(points + s * step * _direction(k, l, finite), variables, at, False) for s in (1, -1)]
            by_stress[..., k, l] = (ends[0].stress - ends[1].stress) / (2 * step)
            by_energy[0][:, k, l] = (ends[0].energy - ends[1].energy) / (2 * step)
            by_energy[1][:, k, l] = (ends[0].dissipated - ends[1].dissipated) / (2 * step)
    lossless = not np.any(answer.dissipated) and not np.any(by_energy[1]) and np.any(answer.energy)
    size, stiffness = np.abs(answer.stress).max(), np.abs(answer.tangent).max()
    return Deviations(
        float(np.abs(by_energy[0] - answer.stress).max() / (size or 1.0)) if lossless else float("nan"),
        float(np.abs(by_stress - answer.tangent).max() / stiffness),
        float(np.abs(answer.tangent - answer.tangent.transpose(0, 3, 4, 1, 2)).max() / stiffness),
    )


def _direction(k: int, l: int, finite: bool) -> FloatArray:
    unit = np.zeros((3, 3))
    unit[k, l] = 1.0
    return unit if finite else 0.5 * (unit + unit.T)


def refuse_wrong(law: PointLaw, what: str) -> None:
    """InputError for stress or tangent that is not finite at no strain, stress that is not symmetric (it would make angular momentum) or,
    of finite strain, not the same in a turned body, a tangent that is not the derivative of the stress, or of an unstable material,
    dissipation below zero and a stored energy that is not the work of the stress."""
    rest = np.eye(3)[None] if law.strain == "finite" else np.zeros((1, 3, 3))
    stress, tangent = _asked(law, rest, what)
    if not (np.all(np.isfinite(stress)) and np.all(np.isfinite(tangent))):
        raise InputError(f"{what}: expected finite stress and tangent at no strain, got {_first_bad(stress, tangent)}")
    noise = np.random.default_rng(3).uniform(-1, 1, (9, 3, 3))
    noise = TRIED * (noise + noise.transpose(0, 2, 1))
    stress, tangent = _asked(law, rest + noise, what)
    size = np.abs(tangent).max() * TRIED
    kirchhoff = stress @ (rest + noise).transpose(0, 2, 1) if law.strain == "finite" else stress
    skew = float(np.abs(kirchhoff - kirchhoff.transpose(0, 2, 1)).max())
    if skew > _UNSEEN * size:
        name = "P F^T" if law.strain == "finite" else "sigma"
        raise InputError(f"{what}: expected a symmetric stress {name}, got one whose halves differ by {skew / size:.2g} of it")
    _refuse_unstable(tangent, noise, what)
    _refuse_energies(law, rest, noise, what)
    differences = np.stack([_slope(law, rest + noise, k, l, what) for k in range(3) for l in range(3)], axis=-1).reshape(tangent.shape)
    slope = float(np.abs(differences).max())
    if not slope > 0:
        raise InputError(f"{what}: expected a stress that resists strain, got none at strains of {TRIED:g}")
    off = np.median(np.abs(differences - tangent).max(axis=(1, 2, 3, 4)) / slope)
    if not off <= WRONG:
        raise InputError(
            f"{what}: expected the tangent to be the derivative of the stress, [i, j, k, l] = d stress_ij / d strain_kl, got one that "
            f"differs from differences of the stress by {off:.2g} of the stiffness; check_law compares them at any strain"
        )
    if law.strain == "finite":
        turned = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()
        seen = float(np.abs(_asked(law, turned @ (rest + noise), what)[0] - turned @ stress).max())
        if not seen <= _UNSEEN * size + 1e-9 * np.abs(tangent).max():
            raise InputError(
                f"{what}: expected a stress that turns with the body, P(Q F) = Q P(F) (an energy of F^T F), got one that sees a rotation "
                f"by {seen / np.abs(tangent).max():.2g} of the stiffness"
            )


def _refuse_unstable(tangent: FloatArray, noise: FloatArray, what: str) -> None:
    """Most of the tried strains meet less than no resistance; kinks and materials without tension may have none."""
    work = np.einsum("nij,nijkl,nkl->n", noise, tangent, noise)
    if np.median(work) < -_UNSEEN * np.abs(tangent).max() * TRIED**2:
        raise InputError(f"{what}: expected a stress that resists strain from the beginning, got one that pushes on: is its sign wrong?")


def _refuse_energies(law: PointLaw, rest: FloatArray, noise: FloatArray, what: str) -> None:
    """The energy stored and dissipated at the tried strains, where a law says any, against the work of the stress on the way there."""
    answers = [_response(law, rest + share * noise, what) for share in (0.0, 0.5, 1.0)]
    stored, lost = answers[2].energy - answers[0].energy, answers[2].dissipated
    size = float(np.abs(answers[2].stress).max()) * TRIED
    if lost.min() < -_UNSEEN * size:
        raise InputError(f"{what}: expected dissipated energy >= 0, got {lost.min():.3g} J/m^3 at strains of {TRIED:g}")
    if not np.any(answers[2].energy):
        return
    mean = (answers[0].stress + 4 * answers[1].stress + answers[2].stress) / 6
    work = np.einsum("nij,nij->n", mean, noise)
    off = float(np.median(np.abs(stored + lost - work)) / max(float(np.abs(work).max()), 1e-300))
    # below the digits of a large constant in the energy nothing can be told
    if off > WRONG and np.abs(work).max() > 1e-12 * np.abs(answers[2].energy).max():
        raise InputError(
            f"{what}: expected an energy whose change is the work of the stress, what is dissipated apart, got one that differs by "
            f"{off:.2g} of it at strains of {TRIED:g}"
        )


def _asked(law: PointLaw, strain: FloatArray, what: str) -> tuple[FloatArray, FloatArray]:
    answer = _response(law, strain, what)
    assert answer.tangent is not None
    return answer.stress, answer.tangent


def _response(law: PointLaw, strain: FloatArray, what: str) -> Response:
    before = np.tile(initial_variables(law), (len(strain), 1))
    try:
        with np.errstate(all="ignore"):
            return law.respond(strain, before, Circumstances(np.zeros((len(strain), 3)), 0.0, 0.0), True)
    except InputError:
        raise
    except Exception as error:  # whatever a user's law raises
        raise InputError(f"{what}: expected an answer to {len(strain)} points, it raised {type(error).__name__}: {error}") from error


def _slope(law: PointLaw, strain: FloatArray, k: int, l: int, what: str) -> FloatArray:
    unit = np.zeros((3, 3))
    unit[k, l] = 1.0
    step = 0.01 * TRIED * (unit if law.strain == "finite" else 0.5 * (unit + unit.T))
    slope: FloatArray = (_asked(law, strain + step, what)[0] - _asked(law, strain - step, what)[0]) / (0.02 * TRIED)
    return slope


def _first_bad(stress: FloatArray, tangent: FloatArray) -> str:
    name, values = ("stress", stress) if not np.all(np.isfinite(stress)) else ("tangent", tangent)
    place = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0][1:])
    return f"{name}[{', '.join(map(str, place))}] = {values[(0, *place)]}"
