"""Openings of joints against what turning and moving bodies do to them; no contact is asked."""

from pathlib import Path

import numpy as np
import pytest

from fcsim.running.folder import Instant
from fcsim.view.joints import configuration, find_joints
from fcsim.view.joints.draw import opened, widest

pyvista = pytest.importorskip("pyvista")


def write(path: Path, bodies: list) -> Path:
    """Rigid bodies as a run writes them: (surface, displacement of each point (n, 3))."""
    parts = []
    for number, (surface, moved) in enumerate(bodies):
        part = surface.copy()
        part.cell_data["body"] = np.full(part.n_cells, number)
        part.point_data["displacement"] = np.broadcast_to(moved, (part.n_points, 3)).astype(float)
        parts.append(part)
    parts[0].append_polydata(*parts[1:]).save(path)
    return path


def instant(path: Path, t: float = 1.0) -> Instant:
    return Instant(t, None, None, path)


def box(low: tuple[float, ...], high: tuple[float, ...], planar: bool) -> object:
    (a, b, c), (d, e, f) = low, high
    if not planar:
        return pyvista.Box((a, d, b, e, c, f))
    return pyvista.PolyData(np.array([(a, b, 0), (d, b, 0), (d, e, 0), (a, e, 0)], dtype=float), faces=[4, 0, 1, 2, 3])


def hinged(surface, pivot, angle, axes):
    """Displacement of points that turn about an axis through the pivot, in the plane of two axes."""
    first, second = axes
    arm = np.asarray(surface.points) - pivot
    moved = np.zeros_like(arm)
    moved[:, first] = np.cos(angle) * arm[:, first] - np.sin(angle) * arm[:, second] - arm[:, first]
    moved[:, second] = np.sin(angle) * arm[:, first] + np.cos(angle) * arm[:, second] - arm[:, second]
    return moved


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("angle", [1e-4, 0.3, 1.5])
def test_a_hinge_opens_by_the_sine_of_its_angle(tmp_path: Path, planar: bool, size: float, angle: float) -> None:
    """A point at s from the hinge parts by s sin(angle) along the other body's normal, whichever body that is."""
    up, top = (1, (size, 2 * size, 0.0)) if planar else (2, (size, size, 2 * size))
    lower, upper = box((0, 0, 0), (size, size, size), planar), box((0, size * planar, size), top, planar)
    pivot = np.zeros(3)
    pivot[up] = size
    first = instant(write(tmp_path / "0.vtp", [(lower, 0.0), (upper, 0.0)]), 0.0)
    last = instant(write(tmp_path / "1.vtp", [(lower, 0.0), (upper, hinged(upper, pivot, angle, (0, up)))]))
    joints = find_joints(first, planar)
    corners = joints.corners(configuration(first))
    spans = corners[:, 1:] - corners[:, :1]
    measure = np.linalg.norm(spans[:, 0], axis=1) if planar else np.linalg.norm(np.cross(spans[:, 0], spans[:, 1]), axis=1) / 2
    assert measure.sum() == pytest.approx(size if planar else size**2)  # the facets are the joint, none twice
    along = corners.mean(axis=1)[:, 0]
    np.testing.assert_allclose(joints.opening(configuration(last)), along * np.sin(angle), atol=1e-6 * size)
    assert opened(joints, last, size).max() > 0.8 * size * np.sin(angle)
    assert {tuple(sorted(pair)) for pair in joints.bodies.tolist()} == {(0, 1)}


def test_blocks_that_slide_open_nothing_and_those_that_leave_all(tmp_path: Path) -> None:
    lower, upper = box((0, 0, 0), (1, 1, 1), False), box((0.5, 0, 1), (1.5, 1, 2), False)
    first = instant(write(tmp_path / "0.vtp", [(lower, 0.0), (upper, 0.0)]))
    slid = instant(write(tmp_path / "1.vtp", [(lower, 0.0), (upper, (0.3, 0.0, 0.0))]))
    left = instant(write(tmp_path / "2.vtp", [(lower, 0.0), (upper, (0.0, 0.0, 7.0))]))
    joints = find_joints(first, False)
    assert not opened(joints, slid, 2.0).any()
    np.testing.assert_allclose(joints.opening(configuration(left)), 7.0, rtol=1e-6)
    assert joints.corners(configuration(first)).mean(axis=1)[:, 0].min() > 0.5 - 0.125  # where they overlap, to half a facet


def test_what_does_not_lie_face_to_face_is_no_joint(tmp_path: Path) -> None:
    floor, above = box((-5, -5, -1), (5, 5, 0), False), box((0, 0, 0.01), (1, 1, 1), False)
    ball = pyvista.Sphere(radius=0.5, center=(3, 3, 0.5), theta_resolution=24, phi_resolution=24)
    edge = box((-2, -2, 0), (-1, -1, 1), False).rotate_x(45, point=(-1.5, -1.5, 0))
    joints = find_joints(instant(write(tmp_path / "0.vtp", [(floor, 0.0), (above, 0.0), (ball, 0.0), (edge, 0.0)])), False)
    assert not len(joints) and not opened(joints, instant(tmp_path / "0.vtp"), 1.0).any()
    alone = find_joints(instant(write(tmp_path / "1.vtp", [(floor, 0.0)])), False)
    assert not len(alone)


def test_the_widest_joints_are_named_once_each(tmp_path: Path) -> None:
    """A pile of four: openings 0.3, 0.1, 0.001."""
    pile = [box((0, 0, k), (1, 1, k + 1), False) for k in range(4)]
    first = instant(write(tmp_path / "0.vtp", [(body, 0.0) for body in pile]))
    moved = np.cumsum([0.0, 0.3, 0.1, 0.001])
    last = instant(write(tmp_path / "1.vtp", [(body, (0, 0, lift)) for body, lift in zip(pile, moved, strict=True)]))
    joints = find_joints(first, False)
    opening = opened(joints, last, 4.0)
    chosen = widest(joints, opening, 3)
    np.testing.assert_allclose(opening[chosen], [0.3, 0.1], rtol=1e-5)


def test_fine_meshes_that_do_not_match(tmp_path: Path) -> None:
    """9600 triangles on 6000, of a joint of 1 m^2: all of it, and none twice."""
    lower = pyvista.Plane(center=(0.5, 0.5, 0), i_size=1, j_size=1, i_resolution=60, j_resolution=50).triangulate()
    upper = pyvista.Plane(center=(0.5, 0.5, 0), direction=(0, 0, -1), i_size=1, j_size=1, i_resolution=60, j_resolution=80).triangulate()
    joints = find_joints(instant(write(tmp_path / "0.vtp", [(lower, 0.0), (upper, 0.0)])), False)
    spans = np.diff(joints.corners(configuration(instant(tmp_path / "0.vtp"))), axis=1)
    assert np.linalg.norm(np.cross(spans[:, 0], spans[:, 1]), axis=1).sum() / 2 == pytest.approx(1.0, rel=1e-5)
    assert set(joints.bodies[:, 0]) == {1}  # the finer one


@pytest.mark.slow
def test_two_thousand_bodies_are_a_matter_of_seconds(tmp_path: Path) -> None:
    import time

    bodies = [(box((x, 0, z), (x + 1, 1, z + 1), False), 0.0) for x in range(50) for z in range(40)]
    first = instant(write(tmp_path / "0.vtp", bodies))
    begin = time.thread_time()
    joints = find_joints(first, False)
    assert time.thread_time() - begin < 30
    assert len({tuple(sorted(pair)) for pair in joints.bodies.tolist()}) == 49 * 40 + 50 * 39
