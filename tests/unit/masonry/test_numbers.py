"""Numbers of any size in masonry problems: the answer scales as statics says, or they are refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fcsim.errors import InputError
from fcsim.masonry import Bracket, MasonryProblem, PointForce, analyse, pushed, read_masonry
from fcsim.masonry.atlas.shapes import one_block
from fcsim.masonry.case import masonry_case
from fcsim.masonry.collapse import Trial, pressed, tolerance_of
from fcsim.masonry.remarks import remarks
from fcsim.running.run import RunOptions, run_case


def box(low: tuple[float, float, float], size: tuple[float, float, float]) -> list[list[float]]:
    """A hexahedron's corners in VTK's order."""
    flat = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return [[low[0] + size[0] * p, low[1] + size[1] * q, low[2] + size[2] * r] for r in (0, 1) for p, q in flat]


def pushed_block(s: float = 1.0, force: float = 1.0, **other: Any) -> dict[str, Any]:
    """A block of (2, 1, 1) s m and 1000 kg/m^3 on a floor, mu 0.25, pushed by a force: it slides at mu m g, long before it tips."""
    return {
        "schema": "masonry-problem/1",
        "name": "block",
        "dimension": 2,
        "contact": {"mu": 0.25},
        "loads": [
            {"kind": "acceleration", "value": [0, 0, -9.81]},
            {"kind": "force", "block": "1", "value": [force, 0, 0], "scaled_by_multiplier": True},
        ],
        "blocks": [
            {"id": "0", "vertices": box((-s, 0, -s), (4 * s, s, s)), "support": True},
            {"id": "1", "vertices": box((0, 0, 0), (2 * s, s, s)), "density": 1000.0},
        ],
    } | other


def read(tmp_path: Path, data: dict[str, Any]) -> MasonryProblem:
    path = tmp_path / "block.json"
    path.write_text(json.dumps(data))
    return read_masonry(path)


@pytest.mark.each_value
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("s", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("force", [1e-9, 1.0, 1e9])
def test_the_limit_load_of_a_block_in_any_unit(tmp_path: Path, s: float, force: float, dimension: int) -> None:
    """mu m g / F (it was 20 times that, 0 or without a bound where the loads were unlike, since the programs' tolerances are absolute)."""
    found = analyse(read(tmp_path, pushed_block(s, force, dimension=dimension)))
    expected = 0.25 * 2000.0 * s**3 * 9.81 / force
    assert found.associative.outcome == found.coulomb.outcome == "limit"
    assert found.associative.multiplier == pytest.approx(expected, rel=1e-5)
    assert found.coulomb.multiplier == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("force", [1e300, 1e-300])
def test_loads_that_leave_floats_are_refused(tmp_path: Path, force: float) -> None:
    with pytest.raises(InputError, match="expected loads that can be added up"):
        analyse(read(tmp_path, pushed_block(force=force)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"contact": {"mu": 10**400}}, "mu: expected a finite number, got 1000"),
        ({"base_acceleration": {"kind": "sine", "value": [1, 0, 0], "duration": 1e6, "frequency": 1e6}}, "at most 10000 half waves"),
        ({"base_acceleration": {"kind": "half_sine", "value": [1, 0, 0], "duration": 1e-320}}, r"frequency \[Hz\] > 0"),
    ],
)
def test_numbers_that_nothing_holds(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, pushed_block(**change))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("support", [False, True])
def test_blocks_without_a_joint_fall_and_are_named(tmp_path: Path, support: bool, dimension: int) -> None:
    """A block above its floor, or without one: there was a ValueError of zip() in place of the remarks."""
    data = pushed_block(dimension=dimension)
    data["blocks"][1]["vertices"] = box((0, 0, 0.5), (2, 1, 1))
    data["blocks"] = data["blocks"][:] if support else data["blocks"][1:]
    found = analyse(read(tmp_path, data))
    assert found.associative.outcome == "falls" and found.associative.multiplier == 0
    expected = "joints wider than the tolerance are open" if support else "no block is a support"
    assert any(expected in said for said in remarks(found, None))


def test_blocks_named_by_numbers_may_be_a_pair(tmp_path: Path) -> None:
    assert read(tmp_path, pushed_block(contact={"mu": 0.5, "mu_between": [{"between": [0, 1], "mu": 0.3}]})).between == {("0", "1"): 0.3}


def test_a_support_that_is_faster_than_any(tmp_path: Path) -> None:
    read(tmp_path, pushed_block(support_motion=[{"block": "0", "velocity": [1e300, 0, 0]}]))
    with pytest.raises(InputError, match="to approach by less than 1000 facets in one step, got inf m"):
        run_case(masonry_case(tmp_path / "block.json"), {"steps": "1"}, tmp_path / "out", RunOptions(export_every=0, vtk_every=0))


def test_an_option_that_no_model_has_is_refused_before_a_run(tmp_path: Path) -> None:
    read(tmp_path, pushed_block())
    with pytest.raises(TypeError, match="denisty"):
        masonry_case(tmp_path / "block.json", 0.5, denisty=2000.0)  # type: ignore[call-arg]


def test_forces_beside_which_errors_count_as_motion_are_remarked_upon():
    """A force F on a block of mass m: a share eps of F moves it by eps F t^2 / 2 m, against first motion, 1e-6 of 1 m. Eight times the
    weight asks for a tolerance of 2e-9, ten thousand times for less than solvers reach."""
    problem = pushed(one_block(1.0, 0.4, 0.3), (1.0, 0.0, 0.0))
    stone = next(block for block in problem.blocks if not block.support)
    weight = 9.81 * (stone.density or 0.0) * stone.surface.moments()[0]

    def loaded(times: float) -> MasonryProblem:
        return replace(problem, loads=(*problem.loads, PointForce(stone.name, (0.0, 0.0, -times * weight))))

    seen = Bracket((2.69, 2.71), (2.69, 2.71), ())
    assert pressed(loaded(8)) == pytest.approx(8.0, rel=1e-3) and pressed(problem) == 0.0
    assert tolerance_of(problem, 1.0, 1.0) == 1e-7
    for times in (8.0, 80.0):
        eps = tolerance_of(loaded(times), 1.0, 1.0)
        assert eps * (1 + times) * weight / (weight / 9.81) / 2 == pytest.approx(1e-7, rel=1e-6)  # a tenth of first motion
    assert not remarks(analyse(problem), replace(seen, fall=(0.3, 0.301)))
    assert not remarks(analyse(loaded(8)), seen)
    (said,) = remarks(analyse(loaded(1e4)), replace(seen, fall=(3e3, 3.1e3)))
    assert "forces of 1e+04 times" in said


def test_steps_that_are_rough_are_remarked_upon():
    """Only where they moved and did not fall: there alone first motion hangs on them."""
    found = analyse(pushed(one_block(1.0, 0.4, 0.3), (1.0, 0.0, 0.0)))
    rough = Trial(0.3, 2e-6, 1e-5, 0.2, True, False, True)
    (said,) = remarks(found, Bracket((0.29, 0.3), (0.3, 0.301), (rough,)))
    assert "did not converge" in said
    assert not remarks(found, Bracket((0.29, 0.3), (0.3, 0.301), (replace(rough, rough=False), replace(rough, moves=False))))
