"""What pictures show: all that moves whole, and of a wide floor what is near."""

import numpy as np
import pytest

from fcsim.view.framed import Framed

pyvista = pytest.importorskip("pyvista")


def boxes(*sizes_and_places, moved=()):
    """Rigid bodies as a run writes them: one surface of all, the body's number on its facets; moved: displacement of each."""
    parts = []
    for number, (size, place) in enumerate(sizes_and_places):
        part = pyvista.Box(np.ravel([(c - s / 2, c + s / 2) for s, c in zip(size, place, strict=True)]).tolist())
        part.cell_data["body"] = np.full(part.n_cells, number)
        part.point_data["displacement"] = np.tile(moved[number], (part.n_points, 1)).astype(float)
        parts.append(part)
    return parts[0].append_polydata(*parts[1:])


FLOOR, CRATE, STONE = ((40, 40, 1), (5, 0, -0.5)), ((2, 2, 2), (0, 0, 1)), ((0.5, 0.5, 0.5), (4, 0, 0.25))
STILL = (0, 0, 0)


def test_a_wide_floor_is_cut_off_around_what_moves():
    seen = Framed()
    seen.see(boxes(FLOOR, CRATE, STONE, moved=(STILL, STILL, STILL)), rigid=True)
    seen.see(boxes(FLOOR, CRATE, STONE, moved=(STILL, (0, 3, 0), STILL)), rigid=True)
    low, high = seen.box(2.0)
    # the crate flies from y = -1 to y = 1 + 2 * 3: 0.8 around it; the stone stands still but is small: it is shown
    np.testing.assert_allclose(low, [-1.8, -1.8, -1])
    np.testing.assert_allclose(high, [4.25, 7.8, 2])
    assert seen.size == 40 and not seen.planar


def test_where_nothing_moves_all_is_shown():
    seen = Framed()
    seen.see(boxes(FLOOR, CRATE, moved=(STILL, STILL)), rigid=True)
    low, high = seen.box(1.0)
    np.testing.assert_allclose([low, high], [[-15, -20, -1], [25, 20, 2]])


def test_deformable_blocks_are_shown_whole_though_nothing_moved_yet():
    seen = Framed()
    seen.see(boxes(FLOOR, moved=(STILL,)), rigid=True)
    seen.see(boxes(CRATE, moved=(STILL,)), rigid=False)
    low, high = seen.box(1.0)
    np.testing.assert_allclose([low, high], [[-1.2, -1.2, -1], [1.2, 1.2, 2]])


def test_what_is_shown_as_it_is_has_its_own_box():
    """A crate that is thrown and lands turned: the corners of x + u, not those of x and of u."""
    seen = Framed()
    crate = boxes(CRATE, moved=(STILL,))
    seen.see(crate, rigid=True)
    crate.point_data["displacement"] = np.column_stack([-2 * crate.points[:, 0], np.zeros(crate.n_points), np.full(crate.n_points, 5.0)])
    seen.see(crate, rigid=True)
    np.testing.assert_allclose(seen.box(1.0), [[-1, -1, 0], [1, 1, 7]])
    np.testing.assert_allclose(seen.box(2.0), [[-5, -1, 0], [5, 1, 12]])
