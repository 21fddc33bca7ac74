"""The masonry wall: 3 courses of 28 x 4 x 4 elements in running bond between two platens.

The numbers of contacts are counted by hand below: every joint node, face or Gauss point of the slave side meets one master block.
"""

from time import thread_time
from typing import NamedTuple

import numpy as np
import pytest

from fcsim.contact_detection import ContactSurface, Detector, SurfacePair, contact_matrix
from fcsim.contact_detection.surfaces.surface import CandidateRule

ELEMENT = 0.025  # m
# element coordinates (0 or 1) of a face's corners, counter-clockwise seen from outside
FACES = {
    "x-": [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)],
    "x+": [(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)],
    "z-": [(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)],
    "z+": [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}


def block_facets(n: tuple[int, int, int], side: str) -> np.ndarray:
    """Facets of one side of a structured block of n elements, nodes numbered x slowest, z fastest."""
    axis = "xyz".index(side[0])
    cells = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), axis=-1)
    cells = cells.take(0 if side[1] == "-" else n[axis] - 1, axis=axis).reshape(-1, 1, 3)
    return np.ravel_multi_index(np.moveaxis(cells + np.array(FACES[side]), -1, 0), tuple(k + 1 for k in n))


class Wall(NamedTuple):
    positions: np.ndarray
    body_of_node: np.ndarray
    pairs: list[SurfacePair]


def wall(rule: CandidateRule, courses: int = 3, full_blocks: int = 3) -> Wall:
    points, owner = [], []
    sides: dict[tuple[str, int], list[tuple[np.ndarray, int]]] = {}
    first, body = 0, 0
    for course in range(courses):
        lengths = [8] * full_blocks + [4] if course % 2 else [4] + [8] * full_blocks
        x0 = 0
        for length in lengths:
            n = (length, 4, 4)
            grid = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), axis=-1).reshape(-1, 3)
            points.append((grid + np.array([x0, 0, 4 * course])) * ELEMENT)
            owner.append(np.full(len(grid), body))
            for side in FACES:
                sides.setdefault((side, course), []).append((block_facets(n, side) + first, body))
            first, body, x0 = first + len(grid), body + 1, x0 + length

    def surface(side: str, *levels: int) -> ContactSurface:
        parts = [part for level in levels for part in sides[side, level]]
        return ContactSurface(np.concatenate([f for f, _ in parts]), np.concatenate([np.full(len(f), number) for f, number in parts]))

    total, thickness, height = (8 * full_blocks + 4) * ELEMENT, 4 * ELEMENT, 4 * courses * ELEMENT
    x, y = np.array([-0.1, 1.1]) * total, np.array([-0.5, 1.5]) * thickness
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
    platens = []
    for z, order in ((0.0, (0, 1, 2, 3)), (height, (0, 3, 2, 1))):
        points.append(np.column_stack([corners, np.full(4, z)]))
        owner.append(np.full(4, body))
        platens.append(ContactSurface(first + np.array([order]), np.array([body])))
        first, body = first + 4, body + 1
    pairs = [
        SurfacePair(surface("z-", *range(1, courses)), surface("z+", *range(courses - 1)), 0.53, 1e-3, rule, "beds"),
        SurfacePair(surface("x-", *range(courses)), surface("x+", *range(courses)), 0.53, 1e-3, rule, "heads"),
        SurfacePair(surface("z-", 0), platens[0], 0.83, 1e-3, "nodes", "bottom platen"),
        SurfacePair(surface("z+", courses - 1), platens[1], 0.83, 1e-3, "nodes", "top platen"),
    ]
    return Wall(np.concatenate(points), np.concatenate(owner), pairs)


# Beds: 2 of 28 x 4 faces; heads: 3 joints in each of 3 courses, 4 x 4 faces; each outer face of the wall has 3 x 9 x 5 + 5 x 5 = 160 nodes
COUNTS = {
    "faces": 2 * 28 * 4 + 9 * 16 + 2 * 160,
    "nodes": 2 * 160 + 9 * 25 + 2 * 160,
    "gauss": 4 * (2 * 28 * 4 + 9 * 16) + 2 * 160,
}


@pytest.mark.parametrize(("rule", "count"), COUNTS.items())
def test_count_of_contacts(rule: CandidateRule, count: int) -> None:
    model = wall(rule)
    contacts = Detector(model.pairs, len(model.positions))(model.positions)
    assert len(contacts) == count
    assert count == {"faces": 688, "nodes": 865, "gauss": 1792}[rule]
    assert np.abs(contacts.gap).max() < 1e-15
    assert (np.diff(contacts.identity) > 0).all()
    assert (model.body_of_node[contacts.nodes[:, 0]] == contacts.bodies[:, 0]).all()
    master = contacts.nodes[:, -4:]
    assert (model.body_of_node[master] == contacts.bodies[:, 1:]).all()
    assert np.count_nonzero(contacts.mu == 0.83) == 320


def test_frames_follow_the_joints() -> None:
    model = wall("faces")
    contacts = Detector(model.pairs, len(model.positions))(model.positions)
    bed, head, top = contacts.frame[0], contacts.frame[224], contacts.frame[-1]
    np.testing.assert_allclose(bed, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(head, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(top, [[0, 0, -1], [1, 0, 0], [0, -1, 0]], atol=1e-15)


def test_head_joints_connect_neighbours_of_a_course() -> None:
    model = wall("faces")
    contacts = Detector(model.pairs[1:2], len(model.positions))(model.positions)
    assert (contacts.bodies[:, 0] == contacts.bodies[:, 1] + 1).all()
    assert (contacts.bodies[:, 0] // 4 == contacts.bodies[:, 1] // 4).all()


@pytest.mark.parametrize("rule", ["faces", "nodes", "gauss"])
def test_contacts_stay_under_small_deformation(rule: CandidateRule) -> None:
    """Blocks strained by about 1e-4, each a little differently: the same contacts, and gaps of the size of the displacement."""
    model = wall(rule)
    generator = np.random.default_rng(3)
    strain = 1e-4 * generator.uniform(-1, 1, (14, 3, 3))
    move = np.einsum("nij,nj->ni", strain[model.body_of_node], model.positions - model.positions.mean(axis=0))
    move += 1e-6 * generator.uniform(-1, 1, move.shape)
    detector = Detector(model.pairs, len(model.positions))
    before, after = detector(model.positions), detector(model.positions + move)
    assert len(after) == len(before)
    assert np.abs(after.gap).max() < 2 * np.abs(move).max()
    if rule != "nodes":  # a node over a joint may choose the other block
        np.testing.assert_array_equal(after.identity, before.identity)


@pytest.mark.parametrize("rule", ["faces", "nodes", "gauss"])
def test_rigid_translation_and_resultants(rule: CandidateRule) -> None:
    model = wall(rule)
    generator = np.random.default_rng(5)
    x = model.positions + 1e-6 * generator.uniform(-1, 1, model.positions.shape)
    contacts = Detector(model.pairs, len(x))(x)
    H = contact_matrix(contacts, len(x))
    velocity = np.tile([0.3, -1.2, 0.7], len(x))
    assert np.abs(H.T @ velocity).max() < 1e-14
    force = (H @ generator.uniform(-1, 1, H.shape[1])).reshape(-1, 3)
    assert np.abs(force.sum(axis=0)).max() < 1e-12
    # forces act at the candidate and at the foot: the moment is left of the gap only (and of feet moved onto an edge)
    arm = np.abs(np.cross(x, force).sum(axis=0)).max()
    assert arm < 3e-6 * len(contacts)


def test_a_lifted_block_loses_its_contacts_beyond_the_alert_distance() -> None:
    model = wall("faces")
    x = model.positions.copy()
    lifted = model.body_of_node >= 12  # the platens
    x[lifted, 2] += [*4 * [0.0], *4 * [2e-3]]
    contacts = Detector(model.pairs, len(x))(x)
    assert len(contacts) == COUNTS["faces"] - 160
    x[lifted, 2] -= [*4 * [0.0], *4 * [1.5e-3]]
    contacts = Detector(model.pairs, len(x))(x)
    np.testing.assert_allclose(contacts.gap[-160:], 0.5e-3, rtol=1e-10)


def test_work_grows_with_contacts() -> None:
    """Pairs that the broad phase leaves, platens among small facets included: a few for each contact, however large the wall."""
    for courses, full_blocks in ((3, 3), (10, 12)):
        model = wall("faces", courses, full_blocks)
        detector = Detector(model.pairs, len(model.positions))
        pairs = sum(len(method.search(method.configuration(model.positions))[0]) for method in detector.methods)
        assert pairs < 4 * len(detector(model.positions))


def test_detection_and_contact_matrix_are_fast() -> None:
    """Under 10 ms for the 688 contacts of the processor's time; the best of many runs, as others may use its caches at the same time."""
    model = wall("faces")
    detector = Detector(model.pairs, len(model.positions))
    times = []
    for _ in range(30):
        start = thread_time()
        contact_matrix(detector(model.positions), len(model.positions))
        times.append(thread_time() - start)
    assert min(times) < 10e-3


def test_the_mortar_rule_of_facets_has_the_contacts_of_facet_centres() -> None:
    """Every slave facet stands on one block: the bodies, gaps and normals of "faces", also where slivers overlap the next block."""
    generator = np.random.default_rng(9)
    rules: tuple[CandidateRule, CandidateRule] = ("faces", "mortar-faces")
    for move in (0.0, 1e-6):
        x = wall("faces").positions + move * generator.uniform(-1, 1, wall("faces").positions.shape)
        centres, mortar = (Detector(wall(rule).pairs, len(x))(x) for rule in rules)
        assert len(mortar) == COUNTS["faces"]
        np.testing.assert_array_equal(mortar.bodies, centres.bodies)
        np.testing.assert_allclose(mortar.gap, centres.gap, atol=max(2 * move, 1e-15))
        np.testing.assert_allclose(mortar.frame[:, 0], centres.frame[:, 0], atol=max(4 * move / ELEMENT, 1e-14))
        H = contact_matrix(mortar, len(x))
        assert np.abs(H.T @ np.tile([0.3, -1.2, 0.7], len(x))).max() < 1e-14
