"""What a detection leaves out to be quick changes nothing: the same contacts, number by number, with all of it done."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.general.overlap import wedges
from fcsim.contact_detection.skin.shape import shape_of
from fcsim.contact_detection.sweep import with_swept
from fcsim.mesh import rigid_box
from fcsim.mesh.part import RigidBody
from tests.unit.contact_detection.general.rocks import body, rock
from tests.unit.contact_detection.general.test_wedges import corner_on_corner, model_of


def same(found: Contacts, expected: Contacts) -> bool:
    return all(np.array_equal(getattr(found, field.name), getattr(expected, field.name)) for field in fields(Contacts))


def stone(rng: np.random.Generator, name: str, at: np.ndarray) -> RigidBody:
    points, triangles = rock(rng, 14, 2.0)
    return body(name, points + at, triangles)


def test_the_sieve_of_corners_leaves_none_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Prisms that overlap at their corners, and heaps of rocks that lie in each other: with and without the sieve."""
    rng = np.random.default_rng(3)
    heaps = [[stone(rng, f"rock{k}", 0.7 * rng.normal(size=3)) for k in range(5)] for _ in range(6)]
    models = [model_of(*corner_on_corner(np.random.default_rng(seed)), 3) for seed in range(8)] + [build_model(heap) for heap in heaps]
    with_sieve, passed = [], []

    def counted(rows: np.ndarray, *others: object) -> np.ndarray:
        may = sieve(rows, *others)
        passed.append((may.sum(), len(may)))
        return may

    sieve = wedges.may_pass
    monkeypatch.setattr(wedges, "may_pass", counted)
    for model in models:
        with_sieve.append(Everything(model, 0.5)(model.reference))
    left, looked_at = np.sum(passed, axis=0)
    assert 0 < left < 0.5 * looked_at
    monkeypatch.setattr(wedges, "may_pass", lambda rows, *others: np.ones(len(rows), dtype=bool))
    for model, found in zip(models, with_sieve, strict=True):
        assert same(found, Everything(model, 0.5)(model.reference))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_found_at_the_beginning_is_not_looked_for_again(seed: int) -> None:
    """Boxes in a row, of which some move by less than their alert distance and some by more: as with a look at all of them at the
    beginning of their way."""
    rng = np.random.default_rng(seed)
    places = [0.0, 1.005, 2.03, 3.035, 4.2, 5.205]
    boxes = [rigid_box(f"box{k}", (1, 1, 1), (x, *(0.1 * rng.normal(size=2))), 1.0) for k, x in enumerate(places)]
    model = build_model(boxes)
    x, everything = model.reference, Everything(model, 0.5)
    motion = np.array([0.0, 0.004, -0.1, -0.096, -0.3, -0.304])[:, None] * [1.0, 0.1, 0.0]
    way = np.repeat(motion, np.diff(model.node_offset), axis=0)
    found = everything(x, way)
    fast, count, alert, own = everything._fast(x, way, np.empty(0, dtype=np.int64))
    assert 0 < np.count_nonzero(fast.alert > own) < len(own)
    times = np.arange(count + 1) / count
    now = everything(x)
    assert same(found, with_swept(now, lambda t: everything._at(x + t * way, fast)[0], x, way, times, alert))
    assert len(found) > len(now)


def test_shapes() -> None:
    """Of triangles, quadrilaterals and segments: normals by cross products, angles by the law of cosines, boxes by NumPy."""
    rng = np.random.default_rng(2)
    solids = build_model([stone(rng, "rock", np.zeros(3)), rigid_box("box", (1, 2, 3), (5, 0, 0), 1.0)])
    plane = model_of(*corner_on_corner(rng), 2)
    for model in (solids, plane):
        skin = Everything(model, 0.5).skin
        shape = shape_of(skin, model.reference)
        mean = np.zeros((len(skin.node), 3))
        for f, (corners, sides) in enumerate(zip(skin.facets, skin.sides, strict=True)):
            x = shape.point[corners[:sides]]
            if sides == 2:
                normal, size = np.array([x[1, 1] - x[0, 1], x[0, 0] - x[1, 0], 0.0]), np.linalg.norm(x[1] - x[0])
                angles = np.ones(2)
            else:
                normal = sum(np.cross(x[k] - x[0], x[k + 1] - x[0]) for k in range(1, sides - 1))
                size = np.sqrt(0.5 * np.linalg.norm(normal))
                before, after = np.roll(x, 1, axis=0), np.roll(x, -1, axis=0)
                a, b, c = (np.linalg.norm(p - q, axis=1) for p, q in ((x, before), (x, after), (before, after)))
                angles = np.arccos((a**2 + b**2 - c**2) / (2 * a * b))
            normal = normal / np.linalg.norm(normal)
            mean[corners[:sides]] += angles[:, None] * normal
            assert_allclose(shape.normal[f], normal, atol=1e-12)
            assert_allclose(shape.size[f], size, rtol=1e-12)
            assert_allclose(shape.centre[f], x.mean(axis=0), atol=1e-12)
            assert np.array_equal(shape.low[f], x.min(axis=0)) and np.array_equal(shape.high[f], x.max(axis=0))
        assert_allclose(shape.mean, mean / np.linalg.norm(mean, axis=1)[:, None], atol=1e-7)
        ends = shape.point[skin.edges]
        assert np.array_equal(shape.edge_low, ends.min(axis=1)) and np.array_equal(shape.edge_high, ends.max(axis=1))
