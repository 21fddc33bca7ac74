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


def contact_of(crate, floor, gap):
    """A contact of body `crate` on body `floor`, at a corner of the crate, its normal upwards."""
    point = pyvista.PolyData(np.array([[1.0, 1.0, gap]]))
    point.point_data.update({"slave": [crate], "master": [floor], "gap": [gap]})
    point.point_data["normal"] = np.array([[0.0, 0.0, 1.0]])
    return point


@pytest.mark.parametrize(("fallen", "left"), [(0.5, 0.0), (0.5, 0.25), (0.01, 0.0)])
def test_a_body_that_falls_on_another_is_not_drawn_inside_it(fallen, left):
    """From a gap g0 of `fallen + left` down to `left`: g0 - f fallen is a twentieth of the crate's 2 m below 0 at the factor f."""
    seen = Framed()
    bodies = boxes(FLOOR, ((2, 2, 2), (0, 0, 1 + fallen + left)), moved=(STILL, (0, 0, -fallen)))
    seen.see(bodies, rigid=True)
    seen.see_motion([bodies], contact_of(1, 0, left))
    assert seen.largest_factor == pytest.approx((fallen + left + 0.1) / fallen)


@pytest.mark.parametrize("contacts", [None, contact_of(1, 0, 0.0)])
def test_a_body_that_falls_and_has_no_contact_yet_is_not_drawn_inside_what_is_below(contacts):
    """Bodies 2 and 3 are 1 m and 3 m above the crate and fall 0.25 m: at the factor f their gaps are 1 - f / 4 and 3 - f / 4; of the
    stone's 0.5 m a twentieth is borne. What stands beside the crate, without a contact, keeps nothing from moving."""
    falls = (0, 0, -0.25)
    high = ((0.5, 0.5, 0.5), (0, 0, 3.25)), ((0.5, 0.5, 0.5), (0.9, 0, 5.25))
    bodies = boxes(FLOOR, CRATE, *high, ((1, 1, 2), (1.5, 0, 1)), moved=(STILL, STILL, falls, falls, STILL))
    seen = Framed()
    seen.see(bodies, rigid=True)
    seen.see_motion([bodies], contacts)
    assert seen.largest_factor == pytest.approx((1 + 0.025) / 0.25)
    beside = Framed()
    passes = boxes(FLOOR, CRATE, ((0.5, 0.5, 0.5), (3, 0, 0.25)), moved=(STILL, STILL, (0.1, 5, 0)))
    beside.see(passes, rigid=True)
    beside.see_motion([passes], contacts)
    assert beside.largest_factor > 1e6


def test_what_opens_slides_or_moves_with_its_ground_is_exaggerated_at_will():
    for crate, floor in (((0, 0, 0.1), STILL), ((0.1, 0.1, 0), STILL), ((0.1, 0.2, -3), (0.1, 0.2, -3))):
        seen = Framed()
        bodies = boxes(FLOOR, CRATE, moved=(floor, crate))
        seen.see(bodies, rigid=True)
        seen.see_motion([bodies], contact_of(1, 0, max(crate[2], 0)))
        assert seen.largest_factor > 1e6


def test_a_body_that_turns_is_not_drawn_larger_than_it_is():
    """A bar from the origin turns by 0.2 rad: with the factor f its end is at (1, 0) + f (cos - 1, sin), which may be 1.05 long."""
    angle = 0.2
    bar = boxes(((1, 0.01, 0.01), (0.5, 0, 0)), moved=(STILL,))
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    bar.point_data["displacement"] = bar.points @ turn.T - bar.points
    seen = Framed()
    seen.see(bar, rigid=True)
    seen.see_motion([bar], None)
    f = seen.largest_factor
    assert np.hypot(1 + f * (np.cos(angle) - 1), f * np.sin(angle)) == pytest.approx(1.05, rel=1e-6)
    moved = Framed()
    bar.point_data["displacement"] = np.tile([3.0, -2.0, 1.0], (bar.n_points, 1))
    moved.see(bar, rigid=True)
    moved.see_motion([bar], None)
    assert moved.largest_factor > 1e6


def test_what_bends_is_exaggerated_at_will():
    """A cushion pressed to nine tenths of its height keeps its contact, though its middle comes down."""
    cushion, floor = boxes(CRATE, moved=(STILL,)), boxes(FLOOR, moved=(STILL,))
    floor.cell_data["body"] = np.full(floor.n_cells, 1)
    cushion.point_data["displacement"] = np.column_stack([np.zeros((cushion.n_points, 2)), -0.1 * cushion.points[:, 2]])
    seen = Framed()
    seen.see(floor, rigid=True)
    seen.see(cushion, rigid=False)
    seen.see_motion([floor, cushion], contact_of(0, 1, 0.0))
    assert seen.largest_factor > 1e6
