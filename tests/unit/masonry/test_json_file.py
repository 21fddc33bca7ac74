"""Masonry problems as JSON: what is written is read again; what is wrong is named with file, block and key."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.masonry import Acceleration, PointForce, read_masonry, write_masonry


def box(x: float, z: float, size: tuple[float, float, float]) -> list[list[float]]:
    (a, b, c) = size
    flat = [(0, 0), (a, 0), (a, b), (0, b)]
    return [[x + p, q, z + r] for r in (0.0, c) for p, q in flat]


PROBLEM: dict[str, Any] = {
    "schema": "masonry-problem/1",
    "name": "two",
    "dimension": 2,
    "contact": {"mu": 0.5, "mu_between": [{"between": ["floor", "1"], "mu": 0.3}]},
    "loads": [
        {"kind": "acceleration", "value": [0, 0, -9.81], "scaled_by_multiplier": False},
        {"kind": "force", "block": 1, "value": [100, 0, 0], "point": [0, 0.5, 1], "scaled_by_multiplier": True},
    ],
    "expected": [{"quantity": "load multiplier", "value": 3, "tolerance": 0.01}, {"quantity": "more", "value": "words"}],
    "blocks": [
        {"id": "floor", "vertices": box(-1, -1, (3, 1, 1)), "support": True},
        {"id": 1, "vertices": box(0, 0, (1, 1, 2)), "density": 1000},
    ],
}


def write(tmp_path: Path, data: Any) -> Path:
    path = tmp_path / "problem.json"
    path.write_text(json.dumps(data))
    return path


def test_what_is_read_and_written_is_the_same(tmp_path: Path) -> None:
    problem = read_masonry(write(tmp_path, PROBLEM))
    assert problem.loads == (Acceleration((0, 0, -9.81)), PointForce("1", (100, 0, 0), (0, 0.5, 1), scaled=True))
    assert problem.between == {("floor", "1"): 0.3}
    assert [e.value for e in problem.expected] == [3.0, "words"]
    write_masonry(tmp_path / "again.json", problem)
    again = read_masonry(tmp_path / "again.json")
    assert (again.loads, again.between, again.expected) == (problem.loads, problem.between, problem.expected)
    for block, other in zip(problem.blocks, again.blocks, strict=True):
        assert block.surface.moments()[0] == pytest.approx(other.surface.moments()[0])
        assert (block.density, block.mass, block.support) == (other.density, other.mass, other.support)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "masonry-problem/2"}, "masonry-problem/1"),
        ({"dimension": 4}, "2 or 3"),
        ({"dimension": None}, "dimension"),
        ({"contact": {}}, "contact.*'mu'"),
        ({"contact": {"mu": -1}}, "mu: expected"),
        ({"contact": {"mu": "0.5"}}, "expected a number"),
        ({"contact": {"mu": 0.5, "mu_between": [{"between": ["floor", "x"], "mu": 1}]}}, "name of a block, got 'x'"),
        ({"blocks": []}, "at least one"),
        ({"blocks": {"a": 1}}, "a list"),
        ({"loads": [{"kind": "wind", "value": [0, 0, 1]}]}, '"acceleration" or "force", got .wind'),
        ({"loads": [{"kind": "acceleration", "value": [0, 1]}]}, "three numbers"),
        ({"loads": [{"kind": "acceleration", "value": [0, 1, 0]}]}, "component along y"),
        ({"loads": [{"kind": "force", "block": "x", "value": [0, 0, 1]}]}, "name of a block"),
        ({"base_acceleration": "record.csv"}, "base_acceleration"),
        ({"support_motion": [{"block": 1, "velocity": [0, 0, 1]}]}, "support, got the free block"),
        ({"support_motion": [{"block": "floor", "velocity": [x, 0, 1]} for x in (0, 1)]}, "one velocity a support, got 2 of 'floor'"),
        ({"contact": {"mu": 0.5, "mu_between": [{"between": ["floor", 1], "mu": x} for x in (0.1, 0.2)]}}, "one number.*0.1 and 0.2"),
        ({"contact": {"mu": 0.5, "mu_between": [{"between": [1, 1], "mu": 0.1}]}}, "names of two blocks, got .'1', '1'"),
        ({"loads": [{"kind": "acceleration", "value": [1, 0, 0], "block": 1}]}, "all free blocks: expected kind, value.*got 'block': 1"),
        ({"loads": [{"kind": "acceleration", "value": [1, 0, 0], "moment": [0, 1, 0]}]}, "got 'moment': .0, 1, 0"),
        (
            {"base_acceleration": {"kind": "half_sine", "value": [1, 0, 0], "duration": 1, "frequency": 3}},
            "'half_sine'.*got 'frequency': 3",
        ),
        ({"base_acceleration": {"kind": "sine", "value": [1, 0, 0], "direction": [0, 0, 1], "duration": 1, "frequency": 3}}, "'direction'"),
        ({"base_acceleration": {"value": [1, 0, 0], "direction": [1, 0, 0], "times": [0, 1], "values": [0, 1]}}, "got 'value': .1, 0, 0"),
        ({"contact": {"mu": 0.5, "cohesion": 1e5}}, "contact: expected dry joints.*'cohesion': 100000"),
        ({"contact": {"mu": 0.5, "mu_between": [{"between": ["floor", 1], "mu": 0.1, "ft_tension": 1.0}]}}, "mu_between: expected dry"),
        ({"contact": {"mu": 0.5, "law": "Coulomb, no tension, cohesion 1e5 Pa"}}, "contact: expected dry joints.*'law': 'Coulomb"),
        ({"contact": {"mu": 0.5, "law": {"kind": "Coulomb", "cohesion": 100000.0}}}, "contact: expected dry joints.*'law': .'kind"),
        ({"contact": {"mu": 0.5, "mu_betwen": [1]}}, "'mu_between', got 'mu_betwen'"),
        ({"loads": [{"kind": "acceleration", "value": [1, 0, 0], "scaled_by_multipler": True}]}, "'scaled_by_multiplier', got"),
        ({"initial_pose": [{"block": 1, "translaton": [0, 0, 1]}]}, "'translation', got 'translaton'"),
        ({"initial_pose": [{"block": 1}]}, "'1': expected a translation or a rotation"),
        ({"units": {"length": "mm"}}, "units, length: expected m, .* got 'mm'"),
        ({"suport_motion": [{"block": "floor", "velocity": [0, 0, 1]}]}, "'support_motion', got 'suport_motion'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read_masonry(write(tmp_path, {**PROBLEM, **change}))
    assert "problem" in str(error.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": box(0, 0, (1, 1, 2))[:7]}, "'1'.*8 vertices of a hexahedron, got 7"),
        ({"vertices": [[0, 0]] * 8}, "three coordinates"),
        ({"density": None}, "'1'.*density > 0"),
        ({"density": -1}, "'1'.*density > 0"),
        ({"faces": [[0, 1, 2, 3]]}, "'1'.*closed"),
        ({"faces": [[0, 1, 2, 99]]}, "'1'.*point numbers"),
        ({"id": "floor"}, "more than once"),
        ({"support": True}, "all of them supports"),
        ({"fixed": True}, "'1': expected the key 'support', got 'fixed'"),
        ({"mu": 0.3}, "'1': expected the key 'mu_between of contact', got 'mu'"),
        ({"Mass": 7.0}, "'1': expected the key 'mass', got 'Mass'"),
        ({"mass": 2100.0}, "'1': expected a mass or a density, or both that agree, got 2100 kg and 1000 kg/m.3, .* 2 m.3 have 2000 kg"),
    ],
)
def test_wrong_blocks_are_named(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    data = copy.deepcopy(PROBLEM)
    data["contact"].pop("mu_between")
    data["loads"].pop()
    data["blocks"][1] |= change
    with pytest.raises(InputError, match=message):
        read_masonry(write(tmp_path, data))


def test_a_mass_counts_before_a_density(tmp_path: Path) -> None:
    data = copy.deepcopy(PROBLEM)
    data["blocks"][1] |= {"density": 0, "mass": 7.0}
    assert read_masonry(write(tmp_path, data)).blocks[1].mass == 7.0
    data["blocks"][1] |= {"density": 1000, "mass": 2010.0}  # the same, rounded: 1 x 1 x 2 m
    block = read_masonry(write(tmp_path, data)).blocks[1]
    assert (block.mass, block.density) == (2010.0, None)
    with pytest.raises(InputError, match=r"block '1': .* both that agree, got 30 kg"):
        replace(block, density=1000.0, mass=30.0)


def test_hexahedra_in_vtks_order_are_solids(tmp_path: Path) -> None:
    problem = read_masonry(write(tmp_path, PROBLEM))
    volumes = [block.surface.moments()[0] for block in problem.blocks]
    assert np.allclose(volumes, [3.0, 2.0])


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.json"):
        read_masonry(tmp_path / "nowhere.json")


SAID = [
    "Coulomb without tension but cohesion 1e5 Pa",
    "non-associated Coulomb with cohesion 1e5 Pa",
    "no tension and cohesion 0,1 MPa",
    "Coulomb without dilatancy and with tensile strength 2e5",
    "cohesion 1e5 Pa (no tension)",
]
DENIED = [
    "tension-free Coulomb",
    "coulomb_no_tension",
    "cohesion: none",
    {"cohesion": None, "tension": False},
    "no tension mu 0.6",
    "no tension (1966)",
]


@pytest.mark.parametrize("law", [*SAID, *DENIED])
def test_what_a_law_says_in_words_is_refused_only_where_it_is_there(law: object, tmp_path: Path) -> None:
    """A "no" of another name hid a cohesion, which was left aside; "tension-free" was refused."""
    path = write(tmp_path, PROBLEM | {"contact": {"mu": 0.5, "law": law}})
    if law not in SAID:
        assert read_masonry(path).mu == 0.5
        return
    with pytest.raises(InputError, match="contact: expected dry joints"):
        read_masonry(path)


def test_ends_of_a_plane_block_may_be_of_triangles(tmp_path: Path) -> None:
    """The prism that they bound counts, not the first triangle: mass and centroid by hand."""
    from fcsim.masonry.bodies import rigid_blocks

    data = copy.deepcopy(PROBLEM)
    for block in data["blocks"]:
        quads = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
        block["faces"] = [[q[0], *pair] for q in quads for pair in ((q[1], q[2]), (q[2], q[3]))]
    first = read_masonry(write(tmp_path, data))
    write_masonry(tmp_path / "again.json", first)
    for problem in (first, read_masonry(tmp_path / "again.json")):
        _, block = rigid_blocks(problem)
        assert block.mass == pytest.approx(2000.0)
        np.testing.assert_allclose(block.centre, (0.5, 1.0), atol=1e-12)


def test_what_says_nothing_of_the_structure_is_left_aside(tmp_path: Path) -> None:
    units = {"length": "m", "mass": "kg", "time": "s", "force": "N", "angle": "degree"}
    law = {"law": "Coulomb, no tension, cohesionless; dilatancy 0.0", "cohesion": 0.0, "mu": 0.5}
    blocks = [block | {"fixed": block["id"] == "floor", "colour": "grey"} for block in PROBLEM["blocks"]]
    data = PROBLEM | {"units": units, "geometry_rule": {"thickness": 1}, "contact": law, "blocks": blocks, "remarks": ["none"]}
    assert len(read_masonry(write(tmp_path, data)).blocks) == 2
