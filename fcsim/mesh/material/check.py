"""A law held against itself: energy, stress and tangent by finite differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.mesh.material.law import Circumstances, PointLaw, initial_variables

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
