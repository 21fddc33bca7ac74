"""A sharp edge across the cells of a face is held at few places and sinks in between them: a run says so where it bears too little."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim import Body, Everything, Limits, Material, QuasiStatic, Simulation, Support, build_model
from fcsim.arrays import BoolArray, FloatArray
from fcsim.mesh import brick


def everywhere(x: FloatArray) -> BoolArray:
    return np.isfinite(x[0])


def pressed(degrees: float, cells: int, unit: float = 1.0) -> tuple[float, tuple[str, ...]]:
    """Force of a bar, of so many cells, on whose edge a block is pressed by 1 mm, at an angle to its cells; and what is said."""
    block = brick("block", (0.2 * unit, 0.1 * unit, 0.1 * unit), (4, 2, 2), Material(1e7 / unit, 0.3, 1000.0 / unit**3))
    bar = brick("bar", (0.04 * unit, 0.16 * unit, 0.04 * unit), (1, cells, 1), Material(1e8 / unit, 0.3, 1000.0 / unit**3))
    turned = Rotation.from_euler("ZY", [degrees, 45.0], degrees=True).as_matrix()
    middle = turned @ (0.5 * unit * np.array([0.04, 0.16, 0.04]))
    place = unit * np.array([0.1, 0.05, 0.1 + 0.02 * np.sqrt(2.0)]) - middle
    held = [Support("block", ("x", "y", "z"), "z-"), Support("bar", ("x", "y"), at=everywhere)]
    driven = Support("bar", ("z",), at=everywhere, displacement=lambda t: -1e-3 * unit * t)
    model = build_model([Body("block", block), Body("bar", bar, rotation=turned, translation=place)], supports=[*held, driven])
    unlimited = Limits(strain=np.inf, rotation=np.inf)
    (step,) = Simulation(model, Everything(model, 0.0), QuasiStatic(1.0), 1, limits=unlimited)
    return float(step.contact_force_on("bar")[2]), tuple(said for said in step.remarks if "a sharp edge" in said)


@pytest.mark.parametrize("unit", [1.0, 1e3], ids=["m", "mm"])
def test_an_edge_across_the_cells_that_bears_too_little_is_named(unit: float) -> None:
    (force, said), (all_along, nothing) = pressed(37.0, 1, unit), pressed(37.0, 24, unit)
    assert force < 0.95 * all_along
    assert len(said) == 1 and "'bar'" in said[0] and "'block'" in said[0]
    assert not nothing


def test_one_along_the_cells_is_not() -> None:
    """Nor is it softer than one with vertices all along."""
    (force, said), (all_along, _) = pressed(0.0, 1), pressed(0.0, 24)
    assert not said
    assert abs(force - all_along) < 0.01 * all_along
