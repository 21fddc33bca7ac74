"""The list's pairs are those of all pairs' distances, whatever was sought before, and the tree is asked only where it must be."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.contact_detection.surfaces import verlet_list
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.contact_detection.surfaces.verlet_list import VerletList


def all_near(points: np.ndarray, centres: np.ndarray, reach: np.ndarray) -> tuple[list[int], list[int]]:
    apart = np.linalg.norm(points[:, None] - centres, axis=2)
    i, j = np.nonzero(apart <= reach)
    return i.tolist(), j.tolist()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("shaking", "flight"), [(1e-4, 0.0), (1e-4, 10.0), (3e-3, 0.0), (0.3, 0.0)])
def test_pairs_are_those_of_all_distances_while_points_move(d: int, shaking: float, flight: float, monkeypatch: pytest.MonkeyPatch) -> None:
    sought = []

    def counted(*given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sought.append(given)
        return near_pairs(*given)

    monkeypatch.setattr(verlet_list, "near_pairs", counted)
    rng, found = np.random.default_rng(d), VerletList()
    points, centres, reach = rng.random((60, d)), rng.random((40, d)), rng.uniform(0.1, 0.3, 40)
    for _ in range(30):
        i, j = found(points, centres, reach)
        assert (i.tolist(), j.tolist()) == all_near(points, centres, reach)
        points = points + shaking * rng.uniform(-1, 1, points.shape) + flight
        centres = centres + shaking * rng.uniform(-1, 1, centres.shape) + flight
        reach = reach * rng.uniform(1 - 0.1 * shaking, 1 + 0.1 * shaking, len(reach))
    assert len(sought) == 1 if shaking == 1e-4 else len(sought) > 1  # 30 times 1e-4 is less than half the least skin, 0.005


def test_other_numbers_of_points_and_none_at_all() -> None:
    rng, found = np.random.default_rng(0), VerletList()
    for count in (5, 9, 0, 9):
        points, centres, reach = rng.random((count, 3)), rng.random((7, 3)), np.full(7, 0.6)
        i, j = found(points, centres, reach)
        assert (i.tolist(), j.tolist()) == all_near(points, centres, reach)
