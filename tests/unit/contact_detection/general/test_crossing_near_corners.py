"""Edges that cross near the end of an edge, almost parallel to it: contacts are as deep as the bodies overlap, by separating axes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything
from fcsim.mesh import Body, Material, RigidBody, brick, rigid_box

STONE = Material(1e9, 0.2, 2000.0)


def box(name: str, size: np.ndarray, corner: np.ndarray, axes: np.ndarray, at: np.ndarray) -> RigidBody:
    """A box with axes (3, 3) as columns, the point `corner` of its own axes (from its centre) placed at `at`."""
    made = rigid_box(name, size, (0, 0, 0), 1.0)
    points = (made.points - corner) @ axes.T + at
    return RigidBody(name, 1.0, axes @ made.inertia @ axes.T, at - axes @ corner, points, made.surfaces)


def overlap(a: RigidBody, b: RigidBody) -> float:
    """The least way [m] that parts two boxes: over the 15 axes that may part them, normals of faces and products of edges."""
    edges = [body.points[[1, 2, 4]] - body.points[0] for body in (a, b)]
    axes = np.concatenate([*edges, np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)])
    axes = axes[np.linalg.norm(axes, axis=1) > 1e-9]
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    on_a, on_b = a.points @ axes.T, b.points @ axes.T
    return float(np.minimum(on_a.max(axis=0) - on_b.min(axis=0), on_b.max(axis=0) - on_a.min(axis=0)).min())


def crossing(rng: np.random.Generator, deep: float) -> tuple[RigidBody, RigidBody]:
    """Two boxes, an edge of one along y, the other's turned by up to 6 degrees about the common normal, which crosses it by up to 3 mm
    below its end; both overlap by about `deep`."""
    along, angle = np.array([0.0, 1.0, 0.0]), rng.uniform(5e-3, 0.1) * rng.choice([-1, 1])
    turn = rng.uniform(0.15, 0.85) * np.pi / 2
    n = np.array([np.sin(turn), 0.0, np.cos(turn)])
    edge = np.cos(angle) * along + np.sin(angle) * (np.cross(n, along) + 0.02 * rng.normal() * n)
    edge /= np.linalg.norm(edge)
    up = n - edge * (edge @ n)
    up = Rotation.from_rotvec(rng.uniform(-0.5, 0.5) * edge).apply(up / np.linalg.norm(up))
    axes = np.stack([edge, (up + np.cross(up, edge)) / np.sqrt(2), (up - np.cross(up, edge)) / np.sqrt(2)], axis=1)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    axes[:, 1:] = axes[:, 1:] * np.sign(axes[:, 1:].T @ up)
    if np.linalg.det(axes) < 0:
        axes[:, [1, 2]] = axes[:, [2, 1]]
    one, other = rng.uniform(0.5, 1.5, 3), rng.uniform(0.6, 1.5, 3)
    place = -deep * n - rng.uniform(0, 3e-3) * along
    return box("a", one, one / 2, np.eye(3), np.zeros(3)), box("b", other, other * [rng.uniform(-0.3, 0.3), -0.5, -0.5], axes, place)


@pytest.mark.parametrize("deep", [1e-3, 2e-5])
def test_what_overlaps_by_a_hair_is_held_and_by_no_contact_far_deeper(deep: float) -> None:
    for seed in range(40):
        a, b = crossing(np.random.default_rng(seed), deep)
        found = Everything(model := build_model([a, b]), 0.5)(model.reference)
        assert 0 < overlap(a, b) <= 1.01 * deep
        assert -3.0 * deep < found.gap.min() < 0.0, seed


def test_an_edge_that_cuts_a_corners_tip_leaves_by_the_nearest_of_its_edges() -> None:
    """Two blocks of a facade in its fall, as they stood: by 2.4e-5 m the edge of one is across an edge of the other, beside whose end it
    was taken to cross the next edge there by 4.5 cm, which threw the blocks apart with 880 J."""
    size = np.array([0.4, 0.2, 0.2])
    places = [(0.9432984, 0.1011676, 0.2146055), (1.0730306, 0.0885841, 0.5994843)]
    turns = [(-0.0264124, 1.3929084, 0.0328483), (-0.0210676, 1.3487911, 0.0726140)]
    a, b = (
        box(f"{k}", size, np.zeros(3), Rotation.from_rotvec(turn).as_matrix(), np.array(place))
        for k, (place, turn) in enumerate(zip(places, turns, strict=True))
    )
    found = Everything(model := build_model([a, b]), 0.5)(model.reference)
    assert overlap(a, b) == pytest.approx(2.37e-5, rel=0.01)
    assert found.gap.min() == pytest.approx(-overlap(a, b), rel=1e-6)


@pytest.mark.parametrize("slope", [0.02, 0.1, 0.3, 1.0])
def test_an_edge_under_the_rim_of_a_face_that_bends_is_not_deep_in_it(slope: float) -> None:
    """A bar lies a hair under the rim of a block whose lower face is no plane: its end, a seventh of the block beside it, is behind the
    mean plane of that face, and not in the block, however steep the bar is."""
    warp = 0.01
    upper, bar = brick("upper", (1.0, 1.0, 1.0), (1, 1, 1), STONE), brick("bar", (1.0, 0.4, 0.2), (1, 1, 1), STONE)
    corner = np.isclose(upper.points, (1.0, 1.0, 0.0)).all(axis=1)
    bent = replace(upper, points=upper.points - warp * corner[:, None] * (0, 0, 1))
    x, y, z = bar.points.T
    turned = replace(bar, points=np.column_stack([x - 0.15, y + 0.1, z - 0.2 - slope * (x - 0.15) - 1e-8]))
    model = build_model([Body("upper", bent), Body("bar", turned)])
    found = Everything(model, 0.5)(model.reference)
    assert len(found) and np.abs(found.gap).min() < 1e-7
    assert found.gap.min() > -1e-6
