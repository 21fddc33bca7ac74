"""A force and a moment that turn with nodes: what they amount to however the nodes move, and their derivative by differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.forms.turning_force import TurningForce

CASES = [(d, flat) for d in (2, 3) for flat in (False, True)]


def spread(d: int, flat: bool) -> tuple[TurningForce, np.ndarray, np.ndarray]:
    """Seven nodes, on a plane (2D: a line) or not, a rotation, and where the nodes stand rotated, shifted and deformed."""
    rng = np.random.default_rng(3)
    X, share = rng.normal(size=(7, d)), rng.random(7)
    if flat:
        X[:, -1] = 0.3
    R = Rotation.from_rotvec([0.0, 0.0, 1.0] if d == 2 else [0.4, -1.1, 0.7]).as_matrix()[:d, :d]
    x = X @ R.T + 0.1 * rng.normal(size=X.shape) + 5.0
    return TurningForce(share / share.sum(), X, rng.normal(size=d), rng.normal(size=2 * d - 3)), R, x


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    d = arm.shape[1]
    whole = np.cross(*(np.pad(a, ((0, 0), (0, 3 - d))) for a in (arm, force))).sum(axis=0)
    return whole if d == 3 else whole[2:]


@pytest.mark.parametrize(("d", "flat"), CASES)
def test_resultant_and_moment(d: int, flat: bool) -> None:
    turning, R, x = spread(d, flat)
    rigid = turning.place @ R.T + 2.0
    force = turning.forces(rigid)
    assert_allclose(force.sum(axis=0), R @ turning.force, atol=1e-13)
    expected = R @ turning.moment if d == 3 else turning.moment
    assert_allclose(moment(rigid - turning.share @ rigid, force), expected, atol=1e-13)
    bent = turning.forces(x)  # of nodes that deform both keep their sizes
    assert_allclose(np.linalg.norm(bent.sum(axis=0)), np.linalg.norm(turning.force))
    assert_allclose(np.linalg.norm(moment(x - turning.share @ x, bent)), np.linalg.norm(turning.moment))


@pytest.mark.parametrize(("d", "flat"), CASES)
def test_derivative_by_differences(d: int, flat: bool) -> None:
    turning, _, x = spread(d, flat)
    tangents, step = turning.tangents(x), 1e-6
    for b in range(len(x)):
        for k in range(d):
            change = np.zeros_like(x)
            change[b, k] = step
            slope = (turning.forces(x + change) - turning.forces(x - change)) / (2 * step)
            assert_allclose(tangents[:, b, :, k], slope, atol=1e-8)
