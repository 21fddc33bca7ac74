"""Rings that fit each other, of cells of first order raised to second, whose middle nodes are put on the circles, and of cells that are
given with middle nodes on the chords: a run says so.

Between a hub and a casing that give nothing a ring of the radii a, b is pressed into one of b, c by the interference i: u = A (r - a^2 / r)
within, B (r - c^2 / r) without, of plane strain, so that p = i / (s_i + s_o) with

    s = b |1 - k| / (2 G (1 / (1 - 2 nu) + k)),  k = (a / b)^2, (c / b)^2                                  (G. Lame, 1852)
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim import (
    Body,
    Detector,
    Everything,
    Material,
    QuasiStatic,
    Simulation,
    Support,
    SurfacePair,
    build_model,
    contact_surface,
)
from fcsim.mesh import Part
from fcsim.mesh.order.second_order import raised

E, NU, A, B, C, INTERFERENCE = 1e9, 0.3, 0.05, 0.1, 0.15, 2e-5


def lame() -> float:
    """The force between the rings [N] a metre of their axis."""
    give = [B * abs(1 - k) / (E / (1 + NU) * (1 / (1 - 2 * NU) + k)) for k in ((A / B) ** 2, (C / B) ** 2)]
    return 2 * np.pi * B * INTERFERENCE / sum(give)


def ring(name: str, inner: float, outer: float, around: int, first: float, elements: str, on_chords: bool) -> Part:
    """4 cells thick, its first corner at the angle `first` [rad]; on_chords: given with middle nodes in the middle of straight edges."""
    angle, radius = first + 2 * np.pi * np.arange(around) / around, np.linspace(inner, outer, 5)
    points = (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).reshape(-1, 2)
    here, after = np.arange(around), np.roll(np.arange(around), -1)
    cells = np.concatenate([np.stack([k + here, k + around + here, k + around + after, k + after], axis=1) for k in np.arange(4) * around])
    surfaces = {"in": np.stack([after, here], axis=1), "out": 4 * around + np.stack([here, after], axis=1)}
    material = Material(E=E, nu=NU, density=1000.0)
    if not on_chords:
        return Part(name, points, cells, "quadrilateral", surfaces, material, elements=elements)
    mesh = raised(points, cells, "quadrilateral", surfaces, name)
    return Part(name, mesh.points, mesh.cells, mesh.cell_type, mesh.surfaces, material)


def pressed(
    rule: Any, elements: str, on_chords: bool = False, casing: str | None = None, interference: float = INTERFERENCE
) -> tuple[float, tuple[str, ...]]:
    """The force between the rings over Lame's, and what is said of their middle nodes; casing: its elements, if others."""
    bodies = [
        Body("casing", ring("casing", B, C, 28, 0.03, casing or elements, on_chords and casing is None)),
        Body("hub", ring("hub", A, B + interference, 32, 0.0, elements, on_chords)),
    ]
    model = build_model(bodies, supports=[Support("casing", ("x", "y"), "out"), Support("hub", ("x", "y"), "in")])
    slave, master = contact_surface(model, [("hub", "out")]), contact_surface(model, [("casing", "in")])
    detection = Everything(model, 0.0) if rule == "Everything" else Detector([SurfacePair(slave, master, 0.0, 1e-3, rule)], model.n_nodes)
    (step,) = Simulation(model, detection, QuasiStatic(1.0), 1)
    return step.contact_force[:, 0].sum() / lame(), tuple(said for said in step.remarks if "middle nodes" in said)


@pytest.mark.parametrize("rule", ["Everything", "mortar", "segments"])
def test_middle_nodes_given_on_chords_are_named(rule: Any) -> None:
    force, said = pressed(rule, "Q2", on_chords=True)
    assert force > 2.0  # 8 to 18 times as much, without a word
    assert len(said) == 1
    assert "'casing' and 'hub' fit each other" in said[0]


@pytest.mark.parametrize(
    ("rule", "elements"), [("Everything", "Q2"), ("mortar", "Q2"), ("mortar-faces", "Q2"), ("segments", "Q2"), ("mortar", "Q1-enhanced")]
)
def test_raised_cells_and_what_is_said_to_help_bear_lames_pressure(rule: Any, elements: str) -> None:
    force, said = pressed(rule, elements)
    assert force == pytest.approx(1.0, abs=0.02)
    assert said == ()


@pytest.mark.parametrize(("interference", "named"), [(INTERFERENCE, 1), (-INTERFERENCE, 0)])
def test_what_bears_nothing_where_curves_overlap_is_named(interference: float, named: int) -> None:
    """A hub whose middle nodes lie within its circle, in a casing whose facets are chords of theirs; with play nothing is to bear."""
    force, said = pressed("mortar", "Q2", on_chords=True, casing="Q1-enhanced", interference=interference)
    assert force == 0.0
    assert len(said) == named
