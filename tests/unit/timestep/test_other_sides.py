"""A shaft of 16 flat sides in a hole with the same: sides of one cell are chords of a circle, of two cells they are flat. A run says so
where one is read so and the other otherwise, 0.1 (1 - cos(pi / 16)) m apart: the shaft bore some 60 times too much, or nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim import Body, Detector, Everything, Material, QuasiStatic, Simulation, Support, SurfacePair, Witness, build_model, contact_surface
from fcsim.mesh import Part

R = 0.1


def ring(name: str, n: int, cells: int, inner: float, outer: float, elements: str) -> Body:
    corner, share = np.exp(2j * np.pi * np.arange(n + 1) / n), np.arange(cells) / cells
    point = (corner[:-1, None] * (1 - share) + corner[1:, None] * share).ravel()
    points = (np.array([inner, outer])[:, None, None] * np.stack([point.real, point.imag], axis=1)).reshape(-1, 2)
    here = np.arange(n * cells)
    after = np.roll(here, -1)
    quads = np.stack([here, len(here) + here, len(here) + after, after], axis=1)
    surfaces = {"in": np.stack([after, here], axis=1), "out": len(here) + np.stack([here, after], axis=1)}
    return Body(name, Part(name, points, quads, "quadrilateral", surfaces, Material(1e9, 0.3, 1000.0), elements=elements))


def said(rule: str, n: int, cells: tuple[int, int], elements: str, interference: float = 2e-5) -> list[str]:
    """Of the cells of a side of the shaft and of the casing."""
    bodies = [ring("casing", n, cells[1], R, 1.5 * R, elements), ring("shaft", n, cells[0], 0.5 * R, R + interference, elements)]
    model = build_model(bodies, supports=[Support("casing", ("x", "y"), "out"), Support("shaft", ("x", "y"), "in")])
    pair = SurfacePair(contact_surface(model, [("shaft", "out")]), contact_surface(model, [("casing", "in")]), 0.0, 1e-2, "mortar")
    detection: Any = Everything(model, 0.0) if rule == "Everything" else Detector([pair], model.n_nodes)
    (step,) = Simulation(model, detection, QuasiStatic(1.0), 1, witness=Witness(initial="allow"))
    return [remark for remark in step.remarks if "have the same sides" in remark]


@pytest.mark.parametrize("elements", ["Q1", "Q2"])
@pytest.mark.parametrize("rule", ["mortar", "Everything"])
def test_sides_of_one_cell_beside_sides_of_two(rule: str, elements: str) -> None:
    (text,) = said(rule, 16, (1, 2), elements)
    assert "read as chords of a curve on 'shaft', 0.0019 m high over them, and as flat on 'casing'" in text
    (text,) = said(rule, 16, (2, 1), elements)
    assert "read as chords of a curve on 'casing', 0.0019 m high over them, and as flat on 'shaft'" in text


@pytest.mark.parametrize("elements", ["Q1", "Q2"])
@pytest.mark.parametrize(("n", "cells"), [(16, (1, 1)), (16, (2, 2)), (10, (1, 2)), (28, (1, 1))])
def test_what_is_read_alike_is_not_named(n: int, cells: tuple[int, int], elements: str) -> None:
    assert not said("mortar", n, cells, elements)


def test_circles_of_other_facets_are_not_named() -> None:
    """24 and 48 facets of circles: corners of the finer ones lie over the chords' middles, by the height of the curve."""
    bodies = [ring("casing", 48, 1, R, 1.5 * R, "Q2"), ring("shaft", 24, 1, 0.5 * R, R + 2e-5, "Q2")]
    model = build_model(bodies, supports=[Support("casing", ("x", "y"), "out"), Support("shaft", ("x", "y"), "in")])
    (step,) = Simulation(model, Everything(model, 0.0), QuasiStatic(1.0), 1, witness=Witness(initial="allow"))
    assert not any("have the same sides" in remark for remark in step.remarks)
