"""A peg of n flat sides pressed into the hole that it fits: both sides hold it in each inner corner, and without friction nothing turns it.

The sides meet at 360 / n degrees. By symmetry the moment about the axis is none; what presses is beside it what `mortar` integrates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim import Body, Detector, Everything, Material, QuasiStatic, Simulation, Support, SurfacePair, Witness, build_model, contact_surface
from fcsim.mesh import Part

R = 0.1


def polygon(n: int, cells: int) -> np.ndarray:
    """Corners (n cells, 2) of the sides' cells of an n-gon in the unit circle."""
    corner = np.exp(2j * np.pi * np.arange(n + 1) / n)
    share = np.arange(cells) / cells
    point = (corner[:-1, None] * (1 - share) + corner[1:, None] * share).ravel()
    return np.stack([point.real, point.imag], axis=1)


def ring(name: str, n: int, cells: int, inner: float, outer: float) -> Body:
    points = (np.linspace(inner, outer, 3)[:, None, None] * polygon(n, cells)).reshape(-1, 2)
    here = np.arange(n * cells)
    after = np.roll(here, -1)
    quads = np.concatenate([np.stack([k + here, k + len(here) + here, k + len(here) + after, k + after], axis=1) for k in (0, len(here))])
    surfaces = {"in": np.stack([after, here], axis=1), "out": 2 * len(here) + np.stack([here, after], axis=1)}
    return Body(name, Part(name, points, quads, "quadrilateral", surfaces, Material(1e9, 0.3, 1000.0), elements="Q1-enhanced"))


def pressed(bodies: list[Body], rule: str, smooth: bool = True) -> tuple[float, float, int]:
    """Sum of the radial forces [N], moment on the peg over R [N], both a metre of the axis, and how many contacts."""
    model = build_model(bodies, supports=[Support("casing", ("x", "y"), "out"), Support("peg", ("x", "y"), "in")])
    pair = SurfacePair(contact_surface(model, [("peg", "out")]), contact_surface(model, [("casing", "in")]), 0.0, 1e-2, "mortar")
    detection: Any = Everything(model, 0.0, smooth=smooth) if rule == "Everything" else Detector([pair], model.n_nodes)
    (step,) = Simulation(model, detection, QuasiStatic(1.0), 1, witness=Witness(initial="allow"))
    contacts = step.contacts
    force = step.contact_force[:, :1] * contacts.frame[:, 0]
    on_peg = np.where(contacts.bodies[:, 0] == model.number["peg"], 1.0, -1.0)
    moment = float(on_peg @ (contacts.point[:, 0] * force[:, 1] - contacts.point[:, 1] * force[:, 0])) / R
    return float(np.abs(np.einsum("cd,cd->c", force, contacts.point) / R).sum()), moment, len(contacts)


@pytest.mark.parametrize("first", ["casing", "peg"])
@pytest.mark.parametrize(("cells", "smooth"), [(1, True), (2, True), (1, False)])
@pytest.mark.parametrize("n", [4, 7, 8, 10, 13, 15, 16])
def test_a_peg_is_held_by_all_its_sides(n: int, cells: int, smooth: bool, first: str) -> None:
    if n == 16 and cells == 1 and smooth:
        pytest.skip("sides of one cell that meet at 22.5 degrees are chords of a circle")
    bodies = [ring("casing", n, cells, R, 1.5 * R), ring("peg", n, cells, 0.5 * R, R + 2e-5)]
    bodies = bodies if first == "casing" else bodies[::-1]
    radial, moment, count = pressed(bodies, "Everything", smooth)
    assert count == (1 + cells) * n  # two in each corner, one at each node between
    assert abs(moment) < 1e-6 * radial
    if n > 7:  # fewer corners are as stiff as a cell is coarse
        assert radial == pytest.approx(pressed(bodies, "mortar")[0], rel=0.06)


@pytest.mark.parametrize("elevation", [0.0, -2e-3, 3.0e-2])
def test_what_is_bent_or_convex_is_one_face(elevation: float) -> None:
    """Of a plate of 4 cells on another one, bent by up to 3 degrees over the middle either way, each node has one contact."""
    x = np.linspace(0.0, 1.0, 5)
    height = elevation * (0.5 - np.abs(x - 0.5))

    def plate(name: str, low: np.ndarray, high: np.ndarray) -> Body:
        points = np.concatenate([np.stack([x, low], axis=1), np.stack([x, high], axis=1)])
        k = np.arange(4)
        quads, outline = np.stack([k, k + 1, k + 6, k + 5], axis=1), {"all": np.stack([k, k + 1], axis=1)}
        return Body(name, Part(name, points, quads, "quadrilateral", outline, Material(1e9, 0.3, 1000.0)))

    model = build_model([plate("lower", height - 0.2, height), plate("upper", height, height + 0.2)])
    for smooth in (True, False):
        assert len(Everything(model, 0.0, smooth=smooth)(model.reference)) == 5
