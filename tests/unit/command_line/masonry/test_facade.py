"""An engineer's facade: from a file of blocks to its collapse angle, crack map and film by one command."""

from __future__ import annotations

import csv
import json
import math
import os
from itertools import pairwise
from pathlib import Path

import pytest

from fcsim.command_line.main import main
from fcsim.errors import EXIT_OK

BUDGET = 120.0
"""[s] of the processor."""
PLAIN, EVEN, ODD, LINTEL = (0, 0.3, 0.9, 1.5, 2.1, 2.4), (0, 0.6, 0.9, 1.5, 1.8, 2.4), (0, 0.3, 0.9, 1.5, 2.1, 2.4), (0, 0.6, 1.8, 2.4)
COURSES = (*((PLAIN, EVEN, ODD, LINTEL) * 2), PLAIN, (0, 0.8, 1.6, 2.4))
"""Joints [m] of ten courses 0.3 m high: two storeys with a window (0.9 to 1.5 m in the courses above `PLAIN`) and its lintel."""


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> list[list[float]]:
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return [[(high if c else low)[k] for k, c in enumerate(corner)] for corner in corners]


def write_facade(path: Path, dimension: int) -> int:
    """Write the facade as a masonry problem; returns the number of its free blocks."""
    out = 0.0 if dimension == 2 else 1.0
    blocks: list[dict[str, object]] = [{"id": "floor", "vertices": box((-1, -out, -0.3), (3.4, 0.3 + out, 0)), "support": True}]
    for row, joints in enumerate(COURSES):
        window = row % 4 in (1, 2) and row < 8
        for k, (a, b) in enumerate(pairwise(joints)):
            if not (window and a == 0.9):
                blocks.append({"id": f"c{row}b{k}", "vertices": box((a, 0, 0.3 * row), (b, 0.3, 0.3 * (row + 1))), "density": 2200})
    load = {"kind": "acceleration", "value": [0, 0, -9.81]}
    content = {"schema": "masonry-problem/1", "name": "facade", "dimension": dimension, "contact": {"mu": 0.6}, "loads": [load]}
    path.write_text(json.dumps({**content, "blocks": blocks}))
    return len(blocks) - 1


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_facade_of_forty_blocks_from_file_to_film(dimension: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In the plane and in space the same wall, so the same answer: its thickness does not matter to blocks that move in its plane."""
    from PIL import Image

    assert write_facade(tmp_path / "facade.json", dimension) == 40
    out, begin = tmp_path / "out", sum(os.times()[:4])
    assert main(["tilt", str(tmp_path / "facade.json"), "--out", str(out), "--film"]) == EXIT_OK
    assert sum(os.times()[:4]) - begin < BUDGET
    printed = capsys.readouterr().out
    assert "40 blocks, 1 support" in printed and "collapse: finished" in printed
    analysis = json.loads((out / "analysis.json").read_text())
    limits = analysis["limit_analysis"]
    stands, falls = analysis["simulation"]["fall"]
    # no state of equilibrium above the associative limit; the table of an empty wall of that size, 2.4 m wide and 3 m high, falls at 0.8
    assert limits["coulomb"]["multiplier"] <= limits["associative"]["multiplier"] < 0.8
    assert stands < falls <= 1.006 * limits["associative"]["multiplier"] and falls - stands <= 0.005 * falls
    assert f"{math.degrees(math.atan(falls)):.3f}" in printed
    widths = [float(row["opening [mm]"]) for row in csv.DictReader((out / "openings.csv").open())]
    assert 5.0 < max(widths) < 60.0  # blocks have moved by 1 % of 3 m
    names = ["mechanism.png", "run/film.gif", "run/pictures/bodies.png", "run/steps.csv", *(["cracks.png"] if dimension == 2 else [])]
    for name in names:
        assert (out / name).stat().st_size > 500
    with Image.open(out / "run/film.gif") as film:
        assert film.n_frames >= 60
    rows = list(csv.DictReader((out / "run/steps.csv").open()))
    begun = next(row for row in rows if float(row["displacement"]) > 1e-3)
    # the table goes on turning, so that a millimetre is reached above the angle of first motion
    assert math.degrees(math.atan(stands)) < float(begun["tilt"]) < math.degrees(math.atan(falls)) + 3.0
    assert float(rows[-1]["displacement"]) > 0.5
