"""Masonry in space against closed forms: walls pushed out of their plane, drums, stones of other shapes, and what files do wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.errors import InputError
from fcsim.masonry import analyse, pushed, read_masonry, tilted, trial

G = 9.81
X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
Corner = tuple[float, ...]


def prism(outline: Sequence[tuple[float, float]], low: float, high: float) -> dict[str, Any]:
    """A polygon (x, y), counter-clockwise, from z = low to high."""
    n = len(outline)
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    return {
        "vertices": [(x, y, z) for z in (low, high) for x, y in outline],
        "faces": [list(range(n))[::-1], list(range(n, 2 * n)), *sides],
    }


def box(low: Corner, high: Corner) -> dict[str, Any]:
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1)


def floor(low: float = -20.0, high: float = 20.0) -> dict[str, Any]:
    return {"id": "floor", "support": True, **box((low, low, -1.0), (high, high, 0.0))}


def write(
    path: Path, shapes: Sequence[dict[str, Any]], mu: float = 0.7, *, scale: float = 1.0, ground: bool = True, turn: Rotation | None = None
) -> Path:
    """The file of free blocks on a floor; lengths times scale, masses kept; everything turned about z."""
    blocks = ([floor()] if ground else []) + [{"id": f"b{k}", "density": 2000.0} | shape for k, shape in enumerate(shapes)]
    turned = turn or Rotation.identity()
    for block in blocks:
        block["vertices"] = (scale * turned.apply(np.array(block["vertices"]))).tolist()
        if block.get("density"):
            block["density"] /= scale**3
    loads = [{"kind": "acceleration", "value": [0.0, 0.0, -G * scale]}]
    data = {"schema": "masonry-problem/1", "name": path.stem, "dimension": 3, "contact": {"mu": mu}, "loads": loads, "blocks": blocks}
    path.write_text(json.dumps(data))
    return path


def wall(length: int, courses: int, thickness: float, *, leaves: int = 1) -> list[dict[str, Any]]:
    """Running bond along x of blocks 0.4 x 0.2 m; leaves beside each other along y, 10 mm apart."""
    shapes = []
    for leaf in range(leaves):
        for course in range(courses):
            ends = [0.0, *(k + (0.5 if course % 2 else 1.0) for k in range(length - (course + 1) % 2)), float(length)]
            for a, b in pairwise(ends):
                y = leaf * (thickness + 0.01)
                shapes.append(box((0.4 * a, y, 0.2 * course), (0.4 * b, y + thickness, 0.2 * (course + 1))))
    return shapes


def regular(sides: int, radius: float) -> list[tuple[float, float]]:
    return [(radius * math.cos(2 * math.pi * k / sides), radius * math.sin(2 * math.pi * k / sides)) for k in range(sides)]


def limit(path: Path, direction: tuple[float, float, float]) -> float:
    found = analyse(tilted(read_masonry(path), direction))
    assert found.associative.outcome == "limit"
    return found.associative.multiplier


@pytest.mark.parametrize(("leaves", "thickness"), [(1, 0.2), (2, 0.1)])
def test_a_wall_out_of_its_plane_overturns_at_its_leaf_over_its_height(tmp_path: Path, leaves: int, thickness: float) -> None:
    """tan alpha = t / h of one leaf; a leaf that nothing ties to another falls alone."""
    path = write(tmp_path / "wall.json", wall(3, 5, thickness, leaves=leaves))
    for direction in (Y, (0.0, -1.0, 0.0)):
        assert limit(path, direction) == pytest.approx(thickness / 1.0, rel=1e-5)


@pytest.mark.each_value
@pytest.mark.parametrize("sides", [3, 8, 24])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_column_of_drums_overturns_about_its_edge(tmp_path: Path, sides: int, scale: float) -> None:
    """Towards the middle of a side: apothem over half the height, whatever the unit; friction does not matter."""
    drums = [prism(regular(sides, 0.5), 0.6 * k, 0.6 * (k + 1)) for k in range(5)]
    angle = math.pi / sides
    multiplier = limit(write(tmp_path / "column.json", drums, scale=scale), (math.cos(angle), math.sin(angle), 0.0))
    assert multiplier == pytest.approx(0.5 * math.cos(angle) / 1.5, rel=1e-5)


@pytest.mark.parametrize(("overhang", "stands"), [(0.49, True), (0.51, False)])
def test_a_stone_over_an_edge_falls_beyond_its_half(tmp_path: Path, overhang: float, stands: bool) -> None:
    shapes = [box((0.0, 0.0, 0.0), (1.0, 0.5, 0.3)), box((overhang, 0.0, 0.3), (1.0 + overhang, 0.5, 0.6))]
    problem = pushed(read_masonry(write(tmp_path / "corbel.json", shapes)), X)
    found = analyse(problem)
    assert (found.associative.outcome == "limit") == stands
    assert trial(problem, 0.0, duration=1.0).falls != stands
    if stands:  # about the edge: the arm of the weight over half the height
        assert found.associative.multiplier == pytest.approx(0.01 / 0.15, rel=1e-4)


def test_stones_that_are_not_convex_stand_on_what_touches(tmp_path: Path) -> None:
    """An L in plan about the edge x = 1; centroid of L (1 m^2 less 0.5 x 0.5 m at the corner x, y > 0.5): 5/12."""
    ell = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.5, 0.5), (0.5, 1.0), (0.0, 1.0)]
    path = write(tmp_path / "ell.json", [prism(ell, 0.0, 2.0)])
    assert limit(path, X) == pytest.approx(1 - 5 / 12, rel=1e-5)
    assert limit(path, (-1.0, 0.0, 0.0)) == pytest.approx(5 / 12, rel=1e-5)
    # towards the corner that is missing: about the line through (1, 0.5) and (0.5, 1), x + y = 1.5
    assert limit(path, (1.0, 1.0, 0.0)) == pytest.approx((1.5 - 10 / 12) / math.sqrt(2), rel=1e-5)


def test_a_bench_on_two_legs(tmp_path: Path) -> None:
    """A T upside up between two stones: each bears half; pushed along x all go by the legs or by friction, mu = 0.2."""
    legs = [box((0.0, 0.0, 0.0), (0.5, 0.5, 0.5)), box((1.5, 0.0, 0.0), (2.0, 0.5, 0.5))]
    beam = box((0.0, 0.0, 0.5), (2.0, 0.5, 0.7))
    assert limit(write(tmp_path / "bench.json", [*legs, beam], 0.2), X) == pytest.approx(0.2, rel=1e-5)


@pytest.mark.parametrize("mu", [0.0, 1e3])
def test_friction_none_and_huge(tmp_path: Path, mu: float) -> None:
    path = write(tmp_path / "stack.json", [box((0, 0, 0.5 * k), (0.4, 0.4, 0.5 * (k + 1))) for k in range(2)], mu)
    found = analyse(tilted(read_masonry(path), X))
    assert found.associative.multiplier == pytest.approx(0.4 if mu else 0.0, abs=1e-5)


@pytest.mark.parametrize("share", [-1e-6, 1e-6, 5e-5])
def test_joints_that_are_not_exact(tmp_path: Path, share: float) -> None:
    """Gaps and overlaps of a share of a block: the multiplier of exact joints, 0.4 / 1.5 of the stack."""
    shapes = [box((0, 0, (0.5 + 0.5 * share) * k), (0.4, 0.4, (0.5 + 0.5 * share) * k + 0.5)) for k in range(3)]
    assert limit(write(tmp_path / "gaps.json", shapes), X) == pytest.approx(0.4 / 1.5, rel=2e-4)


@pytest.mark.parametrize("share", [-0.2, -1e-3, 1e-3])
def test_joints_far_from_exact_are_named_or_fall(tmp_path: Path, share: float) -> None:
    """Slight overlaps count as joints (0.4 / 1.0), wide ones are refused by name; blocks that float are not said to stand."""
    shapes = [box((0, 0, (0.5 + 0.5 * share) * k), (0.4, 0.4, (0.5 + 0.5 * share) * k + 0.5)) for k in range(2)]
    path = write(tmp_path / "apart.json", shapes)
    if share < -0.1:
        with pytest.raises(InputError, match=r"b0.*b1|b1.*b0"):
            limit(path, X)
    elif share < 0:
        assert limit(path, X) == pytest.approx(0.4, rel=2e-3)
    else:
        assert analyse(tilted(read_masonry(path), X)).associative.outcome == "falls"


def test_duplicates_inward_faces_and_corners_on_edges_change_nothing(tmp_path: Path) -> None:
    stone = box((0, 0, 0), (0.4, 0.4, 1.0))
    inward = stone | {"faces": [face[::-1] for face in stone["faces"]]}
    doubled = {
        "vertices": [v for face in stone["faces"] for v in np.array(stone["vertices"])[face].tolist()],
        "faces": [[4 * k + i for i in range(4)] for k in range(6)],
    }
    on_edges = prism([(0, 0), (0.2, 0), (0.4, 0), (0.4, 0.1), (0.4, 0.3), (0.4, 0.4), (0, 0.4)], 0.0, 1.0)
    for name, shape in (("inward", inward), ("doubled", doubled), ("on edges", on_edges)):
        for k, direction in enumerate((X, Y)):
            assert limit(write(tmp_path / f"{name}{k}.json", [shape]), direction) == pytest.approx(0.4, rel=1e-5), name


def test_a_tee_with_corners_on_its_edges(tmp_path: Path) -> None:
    """A stem of 1 x 1 under a flange of 3 x 1, corners in the middle of edges: about the stem's foot, 0.5 over the centroid's height."""
    outline = [(-0.5, 0), (0, 0), (0.5, 0), (0.5, 0.5), (0.5, 1), (1.5, 1), (1.5, 2), (0.5, 2), (0, 2), (-1.5, 2), (-1.5, 1), (-0.5, 1)]
    tee = prism(outline, 0.0, 0.7)
    upright = tee | {"vertices": [(x, -z, y) for x, y, z in tee["vertices"]]}
    assert limit(write(tmp_path / "tee.json", [upright]), X) == pytest.approx(0.5 / ((1 * 0.5 + 3 * 1.5) / 4), rel=1e-5)


def test_what_touches_at_an_edge_or_a_corner_alone_falls(tmp_path: Path) -> None:
    """A cube on its edge, on its corner: equilibrium, but none that a push leaves."""
    cube = np.array(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))["vertices"])
    faces = box((0, 0, 0), (1, 1, 1))["faces"]
    for vector in ([math.pi / 4, 0.0, 0.0], (math.acos(1 / math.sqrt(3)) * np.array([1, -1, 0]) / math.sqrt(2)).tolist()):
        points = Rotation.from_rotvec(vector).apply(cube)
        points[:, 2] -= points[:, 2].min()
        found = analyse(tilted(read_masonry(write(tmp_path / "cube.json", [{"vertices": points.tolist(), "faces": faces}])), Y))
        assert found.associative.multiplier == pytest.approx(0.0, abs=1e-6)


def test_pieces_apart_fall_with_the_weaker(tmp_path: Path) -> None:
    shapes = [box((0, 0, 0), (0.5, 0.5, 1.0)), box((5, 0, 0), (5.2, 0.5, 1.0))]
    assert limit(write(tmp_path / "two.json", shapes), X) == pytest.approx(0.2, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"density": 0.0}, "density > 0"),
        ({"density": -1.0}, "density > 0"),
        ({"vertices": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1.2), (0, 1, 1)]}, "plane faces"),
        ({"faces": [[0, 1, 2, 3]]}, "closed surface"),
        ({"faces": [[0, 1, 2, 99]]}, "point numbers"),
        ({"id": "floor"}, "floor"),
    ],
)
def test_what_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_masonry(write(tmp_path / "bad.json", [box((0, 0, 0), (1, 1, 1)) | change]))


def test_a_stone_without_support_falls(tmp_path: Path) -> None:
    shapes = [box((0, 0, 0), (0.4, 0.4, 1.0)), box((3, 0, 2), (3.4, 0.4, 3.0))]
    assert analyse(tilted(read_masonry(write(tmp_path / "air.json", shapes)), X)).associative.outcome == "falls"
