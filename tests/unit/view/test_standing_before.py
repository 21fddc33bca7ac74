"""Pictures look past what stands before the scene: the front walls of a box, not its floor, its back or a low rim."""

import numpy as np
import pytest

from fcsim.running.folder import Instant
from fcsim.view.scene import Survey, looked_past, toward_eye
from fcsim.view.standing_before import standing_before

pyvista = pytest.importorskip("pyvista")
TOWARD = np.array([0.27, -1.0, 0.25])  # from the front, the right and above


def scene(*bodies: tuple[tuple[float, ...], float]):
    """Boxes (bounds, displacement along z) as one data set of surfaces with body numbers."""
    parts = []
    for number, (bounds, moved) in enumerate(bodies):
        box = pyvista.Box(bounds)
        box["displacement"] = np.tile([0.0, 0.0, moved], (box.n_points, 1))
        box.cell_data["body"] = np.full(box.n_cells, number)
        parts.append(box)
    return pyvista.merge(parts, merge_points=False)


FALLEN = ((0, 1, 0, 1, 1, 2), -1.0)
FLOOR, LEFT, BACK = ((-1, 2, -1, 2, -0.2, 0), 0.0), ((-0.2, 0, 0, 1, 0, 3), 0.0), ((0, 1, 1, 1.2, 0, 3), 0.0)
RIGHT, FRONT, RIM = ((1, 1.2, 0, 1, 0, 3), 0.0), ((0, 1, -0.2, 0, 0, 3), 0.0), ((0, 1, -0.2, 0, 0, 0.2), 0.0)


def test_the_walls_towards_the_camera_are_left_out() -> None:
    found = standing_before(scene(FALLEN, FLOOR, LEFT, BACK, RIGHT, FRONT), None, TOWARD)
    assert found.tolist() == [4, 5]


def test_what_is_low_below_or_behind_stays() -> None:
    assert not len(standing_before(scene(FALLEN, FLOOR, LEFT, BACK, RIM), None, TOWARD))


def test_where_nothing_moves_everything_stays() -> None:
    assert not len(standing_before(scene(FLOOR, FRONT, BACK), None, TOWARD))


@pytest.mark.parametrize("planar", [False, True])
def test_a_survey_tells_which_bodies_its_pictures_look_past(monkeypatch, planar):
    box = scene(FALLEN, FLOOR, LEFT, BACK, RIGHT, FRONT)
    monkeypatch.setattr("fcsim.view.scene.read", lambda path: box)
    last = Instant(0.0, None, None, box)
    seen = Survey(1.0, None, 0.0, np.array([-1.0, -1.0, 0.0]), np.array([2.0, 2.0, 3.0]), planar, last)
    assert looked_past(seen, toward_eye(seen)).tolist() == ([] if planar else [4, 5])
