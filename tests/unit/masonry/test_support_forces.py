"""What supports may bear: by statics for a flat arch of two stones, a stone on the ground, a stone on a slope."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from fcsim.command_line.main import main
from fcsim.errors import EXIT_BAD_INPUT, EXIT_OK, InputError
from fcsim.masonry import MasonryProblem, SupportForces, limit_problem, read_masonry, support_forces
from fcsim.masonry.report import support_rows

G = 9.81
DENSITY = 2000.0


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> list[list[float]]:
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return [[(high if c else low)[k] for k, c in enumerate(corner)] for corner in corners]


def written(folder: Path, blocks: list[dict[str, Any]], mu: float, dimension: int) -> Path:
    data = {
        "schema": "masonry-problem/1",
        "name": "stones",
        "dimension": dimension,
        "contact": {"mu": mu},
        "loads": [
            {"kind": "acceleration", "value": [0, 0, -G]},
            {"kind": "acceleration", "value": [G, 0, 0], "scaled_by_multiplier": True},
        ],
        "blocks": blocks,
    }
    path = folder / "stones.json"
    path.write_text(json.dumps(data))
    return path


def flat_arch(folder: Path, a: float, h: float, depth: float, mu: float, dimension: int) -> MasonryProblem:
    """Two stones a x h side by side between two walls."""
    blocks = [
        {"id": "left wall", "vertices": box((-2 * a, 0, 0), (-a, depth, h)), "support": True},
        {"id": "right wall", "vertices": box((a, 0, 0), (2 * a, depth, h)), "support": True},
        {"id": "left", "vertices": box((-a, 0, 0), (0, depth, h)), "density": DENSITY},
        {"id": "right", "vertices": box((0, 0, 0), (a, depth, h)), "density": DENSITY},
    ]
    return read_masonry(written(folder, blocks, mu, dimension))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("size", [1e-3, 1.0, 50.0])
@pytest.mark.parametrize(("mu", "slips"), [(4.0, False), (0.6, True)])
def test_a_flat_arch_of_two_stones(tmp_path: Path, dimension: int, size: float, mu: float, slips: bool) -> None:
    """Each stone of weight w: hinges below at the walls and above in the middle ask H h >= w a / 2, the walls' friction mu H >= w. It can
    be wedged as hard as one likes; one wall may then push the stones up and the other down, the thrust leaning from one to the other."""
    a, h, depth = 0.4 * size, 0.5 * size, 0.3 * size
    w = DENSITY * G * a * h * depth
    left, right = support_forces(limit_problem(flat_arch(tmp_path, a, h, depth, mu, dimension)))
    assert (left.name, right.name) == ("left wall", "right wall")
    least = max(w * a / (2 * h), w / mu)
    assert (least == w / mu) is slips
    assert left.least[0] == pytest.approx(least, rel=1e-5) and right.largest[0] == pytest.approx(-least, rel=1e-5)
    assert left.largest[0] == math.inf and right.least[0] == -math.inf
    for wall in (left, right):
        assert (wall.least[-1], wall.largest[-1]) == (-math.inf, math.inf)


def test_a_stone_on_the_ground_is_determined(tmp_path: Path) -> None:
    blocks = [
        {"id": "ground", "vertices": box((-2, 0, -1), (2, 1, 0)), "support": True},
        {"id": "not touched", "vertices": box((5, 0, 0), (6, 1, 1)), "support": True},
        {"id": "stone", "vertices": box((0, 0, 0), (0.5, 1, 1)), "density": DENSITY},
    ]
    path = written(tmp_path, blocks, 0.7, 2)
    (ground,) = support_forces(limit_problem(read_masonry(path)), 0.3)  # of the weight, to +x
    w = DENSITY * G * 0.5
    assert np.allclose([ground.least, ground.largest], [-0.3 * w, w], rtol=1e-9)
    with pytest.raises(
        InputError, match=r"'stones': expected a structure that bears its loads at the multiplier 0\.51, got one that falls"
    ):
        support_forces(limit_problem(read_masonry(path)), 0.51)  # it tips at 0.5
    with pytest.raises(InputError, match="multiplier: expected a finite number, got nan"):
        support_forces(limit_problem(read_masonry(path)), math.nan)


def test_round_off_is_printed_as_nothing() -> None:
    found = [SupportForces("a", np.array([-3.64e-12, -math.inf]), np.array([1e-13, 5.0])), SupportForces("b", np.zeros(2), np.full(2, 2e4))]
    rows = support_rows(found, digits=6)
    assert rows == [("a", "x", "0", "0"), ("a", "z", "-inf", "0.005"), ("b", "x", "0", "20"), ("b", "z", "0", "20")]


def test_the_thrust_of_an_arch_that_others_computed(tmp_path: Path) -> None:
    """`arch_point_load`: thrust of its own weight 21.14 to 34.45 kN, by another program (references_masonry.md 1.2)."""
    path = Path(__file__).resolve().parents[4] / "shared" / "masonry" / "arch_point_load.json"
    if not path.is_file():
        pytest.skip("the shared masonry problems are not beside this repository")
    for support in support_forces(limit_problem(read_masonry(path))):
        thrust = sorted(abs(np.array([support.least[0], support.largest[0]])))
        assert np.allclose(thrust, [21.14e3, 34.45e3], rtol=3e-4)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flat_arch(tmp_path, 0.4, 0.5, 0.3, 0.6, 2)
    path = str(tmp_path / "stones.json")
    assert main(["limit", path, "--thrust", "--out", str(tmp_path / "out")]) == EXIT_OK
    said = capsys.readouterr().out
    assert "left wall" in said and "1.962" in said and "inf" in said  # w / mu
    assert (tmp_path / "out" / "supports.csv").read_text().splitlines()[1] == "left wall,x,1.962,inf"
    assert main(["limit", path, "--thrust", "--json"]) == EXIT_OK
    assert json.loads(capsys.readouterr().out)["supports [N]"]["left wall"]["least"][0] == pytest.approx(1962.0)
    assert main(["limit", path, "--thrust", "--friction"]) == EXIT_BAD_INPUT
    assert main(["limit", path, "--multiplier", "0.1"]) == EXIT_BAD_INPUT


@pytest.mark.parametrize(("size", "floor_mu", "wall_mu", "degrees"), [(1.0, 0.6, 0.3, 65), (1e-3, 0.9, 0.0, 55), (200.0, 0.5, 0.8, 70)])
def test_a_plank_that_leans_at_a_wall(tmp_path: Path, size: float, floor_mu: float, wall_mu: float, degrees: float) -> None:
    """A corner on the floor, one at the wall: four forces, three equations, in units of its weight and its length."""
    e = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    corners = np.array([[0, 0], 3 * e, 3 * e + 0.2 * np.array([-e[1], e[0]]), 0.2 * np.array([-e[1], e[0]])])
    low, right = corners[corners[:, 1].argmin()], corners[corners[:, 0].argmax()]
    corners, right, low = corners - [0, low[1]], right - [0, low[1]], low - [0, low[1]]

    def prism(name: str, points: Any, **more: Any) -> dict[str, Any]:
        vertices = [[size * x, y, size * z] for y in (0.0, 0.3 * size) for x, z in points]
        sides = [[k, k + 4, (k + 1) % 4 + 4, (k + 1) % 4] for k in range(4)]
        return {"id": name, "vertices": vertices, "faces": [[0, 1, 2, 3], [7, 6, 5, 4], *sides]} | more

    (x, z), centre = right, corners.mean(axis=0)
    blocks = [
        prism("floor", [(-9, -1), (9, -1), (9, 0), (-9, 0)], support=True),
        prism("wall", [(x, z / 2), (x + 1, z / 2), (x + 1, z + 2), (x, z + 2)], support=True),
        prism("plank", corners, density=DENSITY),
    ]
    path = written(tmp_path, blocks, floor_mu, 2)
    data = json.loads(path.read_text())
    data["contact"]["mu_between"] = [{"between": ["wall", "plank"], "mu": wall_mu}]
    path.write_text(json.dumps(data))

    foot, head = low - centre, right - centre  # unknowns: floor T, N, wall N (to the left), T (upwards)
    balance = [[1, 0, -1, 0], [0, 1, 0, 1], [-foot[1], foot[0], head[1], head[0]]]
    cones = [[1, -floor_mu, 0, 0], [-1, -floor_mu, 0, 0], [0, 0, -wall_mu, 1], [0, 0, -wall_mu, -1]]

    def extremes(of: Any) -> list[float]:
        ends = []
        for sign in (1.0, -1.0):
            bounds = [(None, None), (0, None), (0, None), (None, None)]
            answer = linprog(sign * np.array(of), A_eq=balance, b_eq=[0, 1, 0], A_ub=cones, b_ub=np.zeros(4), bounds=bounds)
            ends.append(sign * answer.fun)
        return ends

    weight = DENSITY * G * 3 * 0.2 * 0.3 * size**3
    found = {support.name: support for support in support_forces(limit_problem(read_masonry(path)))}
    for name, axis, of in (("floor", 0, [1, 0, 0, 0]), ("floor", 1, [0, 1, 0, 0]), ("wall", 0, [0, 0, -1, 0]), ("wall", 1, [0, 0, 0, 1])):
        ends = np.array([found[name].least[axis], found[name].largest[axis]]) / weight
        assert np.allclose(ends, extremes(of), rtol=1e-8, atol=1e-9), (name, axis)
