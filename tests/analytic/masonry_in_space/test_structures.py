"""Structures in space that no other test holds, against a linear program of their own (`equilibrium.py`), and what is said of bad ones."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.masonry import analyse, bracket, pushed, read_masonry, tilted, trial
from fcsim.masonry.collapse import Bracket
from fcsim.masonry.limit_analysis.limit import associative_limit
from fcsim.masonry.limit_analysis.limit_problem import limit_problem
from fcsim.masonry.remarks import remarks
from tests.analytic.masonry_in_space.equilibrium import bounds
from tests.analytic.masonry_in_space.stones import (
    HEXAHEDRON,
    Solid,
    Structure,
    Vector,
    box,
    corner,
    dome,
    floor,
    flying_buttress,
    hooked,
    joggled,
    pyramid,
    stone,
    twisted,
    vault,
    wall,
    write,
)

X, Y, XY = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (math.sqrt(0.5), math.sqrt(0.5), 0.0)
STRUCTURES: dict[str, Callable[[], Structure]] = {
    "leaf": lambda: wall(3, 4, 0.15),
    "corbelled": lambda: wall(3, 5, 0.2, step=0.03),
    "L": lambda: corner(4),
    "T": lambda: corner(4, tee=True),
    "pyramid": lambda: pyramid(3),
    "dome": lambda: dome(5, 8, 0.15),
    "lunes": lambda: dome(7, 8, 0.2, lunes=True),
    "vault": lambda: vault(9, 3),
    "vault without a crown stone": lambda: vault(9, 3, missing=True),
    "flat vault without it": lambda: vault(9, 3, missing=True, half=1.0),
    "buttress": flying_buttress,
    "twisted": lambda: twisted(6),
    "hooked": hooked,
}
QUICK = [("lunes", X), ("lunes", Y), ("buttress", X), ("buttress", Y), ("twisted", X), ("hooked", X), ("hooked", XY)]
LONGER = [
    *((name, way) for name in STRUCTURES for way in (X, Y) if (name, way) not in QUICK),
    *((name, way) for name in ("L", "pyramid", "dome") for way in (XY,)),
    *((name, (0.0, -1.0, 0.0)) for name in ("corbelled", "L", "T")),
    ("L", (-1.0, 0.0, 0.0)),
]


def between(found: float, reference: tuple[float, float] | None, near: float = 1e-5) -> bool:
    assert reference is not None
    return reference[0] * (1 - near) <= found <= reference[1] * (1 + near)


@pytest.mark.parametrize(("name", "way"), [*QUICK, *(pytest.param(*one, marks=pytest.mark.slow) for one in LONGER)])
def test_limits_are_those_of_an_independent_program(tmp_path: Path, name: str, way: Vector) -> None:
    """Associative: between cones within and around Coulomb's; Coulomb: found, and not above it."""
    structure = STRUCTURES[name]()
    found = analyse(tilted(read_masonry(write(tmp_path / "structure.json", structure)), way))
    assert found.associative.outcome == "limit"
    assert between(found.associative.multiplier, bounds(structure, way)), found.associative
    assert found.coulomb.outcome == "limit", "no state of incipient collapse under Coulomb's law was found"
    assert 0 < found.lowest.multiplier <= found.coulomb.multiplier <= found.associative.multiplier * (1 + 1e-6)


@pytest.mark.parametrize("way", [X, (-1.0, 0.0, 0.0)])
def test_what_the_reference_calls_unbounded_is(tmp_path: Path, way: Vector) -> None:
    """A tongue in a notch wedges without friction; a buttress leans on its wall however hard it is pushed there."""
    structure = joggled() if way == X else flying_buttress()
    assert bounds(structure, way) == (math.inf, math.inf)
    assert analyse(tilted(read_masonry(write(tmp_path / "wedged.json", structure)), way)).associative.outcome == "unbounded"


def test_a_tongue_in_a_notch_slides_along_it_at_no_friction_alone(tmp_path: Path) -> None:
    """mu = 0: none along the notch. The T's shoulders are corners in one line; its face was once refused for a triangle without area."""
    found = analyse(tilted(read_masonry(write(tmp_path / "joggled.json", joggled())), Y))
    assert found.associative.multiplier == pytest.approx(0.0, abs=1e-7)
    assert 0 <= found.coulomb.multiplier <= 1e-7


def test_a_tongue_with_play_bears_on_two_levels(tmp_path: Path) -> None:
    """10 mm of play: no flank touches, the stem's foot and the shoulders do, at two heights."""
    structure = joggled(mu=0.4, clearance=0.01)
    found = associative_limit(limit_problem(tilted(read_masonry(write(tmp_path / "play.json", structure)), X)))
    assert between(found.multiplier, bounds(structure, X))


def test_a_lune_stands_as_thick_as_heyman_says(tmp_path: Path) -> None:
    """Least t/R of a dome of lunes: 0.042 (J. Heyman, Int. J. Solids Struct. 3, 1967)."""

    def stands(thickness: float) -> bool:
        path = write(tmp_path / "lunes.json", dome(12, 24, thickness, lunes=True, mu=1.0))
        return associative_limit(limit_problem(read_masonry(path))).outcome != "falls"

    assert stands(0.044)
    assert not stands(0.040)


@pytest.mark.parametrize("change", ["mm", "turned", "slip"])
def test_units_place_and_hairline_gaps_change_nothing(tmp_path: Path, change: str) -> None:
    structure = flying_buttress()
    turn = Rotation.from_euler("z", 37, degrees=True)
    others = {"mm": {"scale": 1e3}, "turned": {"turn": turn}, "slip": {"slip": 2e-7}}
    path = write(tmp_path / "structure.json", structure, **others[change])
    way = tuple(turn.apply(Y).tolist()) if change == "turned" else Y
    found = associative_limit(limit_problem(tilted(read_masonry(path), way)))
    assert between(found.multiplier, bounds(structure, Y), 1e-4 if change == "slip" else 1e-5)


SIMULATED = [
    ("twisted", X),
    *(
        pytest.param(*one, marks=pytest.mark.slow)
        for one in [
            ("leaf", X),
            ("leaf", Y),
            ("corbelled", X),
            ("corbelled", (0.0, -1.0, 0.0)),
            ("lunes", X),
            ("lunes", Y),
            ("buttress", X),
            ("buttress", Y),
            ("twisted", Y),
            ("pyramid", X),
            ("pyramid", XY),
            ("L", X),
            ("L", Y),
            ("L", (-1.0, 0.0, 0.0)),
            ("L", XY),
            ("vault", X),
        ]
    ),
]


@pytest.mark.parametrize(("name", "way"), SIMULATED)
def test_simulated_loads_lie_between_coulomb_and_associative(tmp_path: Path, name: str, way: Vector) -> None:
    problem = tilted(read_masonry(write(tmp_path / "structure.json", STRUCTURES[name]())), way)
    found = analyse(problem)
    low, high = found.lowest.multiplier, found.associative.multiplier
    seen = bracket(problem, 0.98 * low, 1.02 * high, resolution=0.02)
    assert seen.fall[1] >= 0.99 * low
    assert seen.motion[0] <= seen.fall[0] <= 1.01 * high
    assert remarks(found, seen) == ()


def said(tmp_path: Path, structure: Structure, seen: Bracket | None = None) -> tuple[str, ...]:
    problem = pushed(read_masonry(write(tmp_path / "structure.json", structure)), X)
    return remarks(analyse(problem), seen)


def cubes(*low: Sequence[float]) -> list[Solid]:
    return [box(one, np.asarray(one) + 0.5) for one in low]


def test_stones_that_nothing_holds_are_named(tmp_path: Path) -> None:
    below, above, wide = cubes((0, 0, 0), (0, 0, 0.5), (0, 0, 0.502))
    free = [stone(below), stone(above)]
    assert said(tmp_path, Structure((floor(), *free), 0.6)) == ()
    (one,) = said(tmp_path, Structure((floor(), stone(below), stone(wide)), 0.6))
    assert "'b2'" in one
    assert "'b1'" not in one
    (none,) = said(tmp_path, Structure(tuple(free), 0.6))
    assert "no block is a support" in none


def test_a_stone_on_its_edge_is_named(tmp_path: Path) -> None:
    """Pushed along its edge it bears mu in equilibrium, as a state that the slightest push aside ends."""
    points = Rotation.from_euler("x", 45, degrees=True).apply(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)).corners)
    points[:, 2] -= points[:, 2].min()
    (one,) = said(tmp_path, Structure((floor(), stone(Solid(points, box((0, 0, 0), (1, 1, 1)).faces))), 0.6))
    assert "'b1'" in one
    assert "line" in one


def test_weight_that_does_not_act_down_is_said(tmp_path: Path) -> None:
    path = write(tmp_path / "y_up.json", Structure((floor(), stone(cubes((0, 0, 0))[0])), 0.6))
    data = json.loads(path.read_text())
    for load, words in (([0.0, -9.81, 0.0], "z is up"), ([0.0, 0.0, 0.0], "no load stays")):
        data["loads"][0]["value"] = load
        path.write_text(json.dumps(data))
        assert any(words in remark for remark in remarks(analyse(pushed(read_masonry(path), X)), None))


def test_without_weight_a_push_moves_the_stone_and_is_told(tmp_path: Path) -> None:
    """No load at multiplier 0: nothing is supplied, and infinite times nothing is not a bound of the energy created."""
    path = write(tmp_path / "adrift.json", Structure((floor(), stone(cubes((0, 0, 0))[0])), 0.6))
    path.write_text(json.dumps(json.loads(path.read_text()) | {"loads": []}))
    problem = pushed(read_masonry(path), X)
    assert not trial(problem, 0.0, duration=0.1, steps=10).moves
    assert trial(problem, 0.5, duration=0.1, steps=10).falls


def test_rest_beyond_the_associative_limit_is_said(tmp_path: Path) -> None:
    """The L-shaped stones begin to turn at 0.0258, then wedge on each other's flanks and stand up to more than twice that."""
    problem = tilted(read_masonry(write(tmp_path / "hooked.json", hooked())), Y)
    (one,) = remarks(analyse(problem), Bracket((0.0257, 0.0259), (0.0586, 0.0593), ()))
    assert "0.0259" in one
    assert "first motion" in one


def test_joints_that_close_first_are_said(tmp_path: Path) -> None:
    below, above = cubes((0, 0, 0), (0, 0, 0.500005))
    structure = Structure((floor(), stone(below), stone(above)), 0.6)
    (one,) = said(tmp_path, structure, Bracket((0.0, 0.0), (0.498, 0.502), ()))
    assert "5e-06 m" in one


@pytest.mark.parametrize("mu", [1e6, 1e9])
def test_friction_without_end_is_that_of_hinges(tmp_path: Path, mu: float) -> None:
    """About the edge, 0.4 / 1.0, under both laws: nothing slides."""
    stack = [stone(Solid(box((0, 0, z), (0.4, 0.4, z + 0.5)).corners, box((0, 0, 0), (1, 1, 1)).faces)) for z in (0.0, 0.5)]
    found = analyse(tilted(read_masonry(write(tmp_path / "stack.json", Structure((floor(), *stack), mu))), X))
    assert found.coulomb.outcome == "limit"
    for load in (found.associative, found.coulomb):
        assert load.multiplier == pytest.approx(0.4, rel=1e-5)


def test_hexahedra_need_no_faces() -> None:
    """The order of the corners in VTK is that of HEXAHEDRON: faces all outwards."""
    solid = box((0, 0, 0), (1, 2, 3))
    middle = solid.corners.mean(axis=0)
    for face in HEXAHEDRON:
        p = solid.corners[list(face)]
        assert np.cross(p[1] - p[0], p[2] - p[1]) @ (p.mean(axis=0) - middle) > 0


@pytest.mark.slow
def test_what_no_load_moves_and_any_load_does_is_bracketed_in_a_few_trials(tmp_path: Path) -> None:
    """mu = 0: at rest by itself, moving under every push; halving such a bracket by shares of itself would never end."""
    problem = pushed(read_masonry(write(tmp_path / "ice.json", Structure((floor(), stone(cubes((0, 0, 0))[0])), 0.0))), X)
    seen = bracket(problem, 0.0, 0.0, resolution=0.5)
    assert seen.motion[0] == 0
    assert seen.fall[1] < 1e-4
    assert len(seen.trials) < 20
