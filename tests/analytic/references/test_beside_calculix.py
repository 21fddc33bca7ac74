"""Large bending on the same mesh by another program: CalculiX 2.20 (`ccx`), C3D10, NLGEOM, the nodal forces of fcsim."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Support, Traction
from fcsim.mesh import brick
from fcsim.mesh.material import FinitePlastic, Hyperelastic, LinearHardening, mooney_rivlin, saint_venant_kirchhoff
from tests.analytic.references.loading import alone, displacement

E, NU = 1000.0, 0.3
MU, BULK = E / (2 * (1 + NU)), E / (3 * (1 - 2 * NU))


def neo_hooke_of_abaqus(F: Any, p: Any) -> Any:
    """C10 (I1bar - 3) + (J - 1)^2 / D1, which CalculiX has, too."""
    import ufl

    J = ufl.det(F)
    return p["mu"] / 2 * (J ** (-2 / 3) * ufl.inner(F, F) - 3) + p["K"] / 2 * (J - 1) ** 2


LAWS: dict[str, Callable[[], Any]] = {
    "ELASTIC": lambda: saint_venant_kirchhoff(E, NU, 1.0),
    "NEO HOOKE": lambda: Hyperelastic(neo_hooke_of_abaqus, 1.0, {"mu": MU, "K": BULK}),
    "MOONEY-RIVLIN": lambda: mooney_rivlin(MU / 3, MU / 6, BULK, 1.0),
    "PLASTIC": lambda: FinitePlastic(E, NU, 1.0, LinearHardening(5.0, 100.0)),
}


@pytest.mark.parametrize(
    ("law", "cells", "force", "steps", "largest", "off"),
    [
        ("ELASTIC", (8, 1, 1), 4.0, 5, 7.348113, 4e-3),
        ("NEO HOOKE", (8, 1, 1), 4.0, 5, 7.367648, 4e-3),
        ("MOONEY-RIVLIN", (8, 1, 1), 4.0, 5, 7.37847, 4e-3),
        ("PLASTIC", (8, 1, 1), 0.12, 10, 0.4684201, 3e-2),
        pytest.param("ELASTIC", (16, 2, 2), 4.0, 5, 7.423216, 5e-4, marks=pytest.mark.slow),
        pytest.param("PLASTIC", (16, 2, 2), 0.12, 10, 0.499965, 1e-2, marks=pytest.mark.slow),
    ],
)
def test_cantilever(law: str, cells: tuple[int, int, int], force: float, steps: int, largest: float, off: float) -> None:
    """A bar 10 x 1 x 1, each brick cut into six tetrahedra of second order, bent by a dead traction across its end to 7.4 (plastic: 0.5)
    at most. The rules of quadrature differ, and so do the answers of a coarse mesh; with half the cells' size the difference is a tenth (a
    third of plastic ones)."""
    part = brick("body", (10.0, 1.0, 1.0), cells, LAWS[law](), elements="P2", cell="tetrahedron")
    load = Traction("body", "x+", (0.0, 0.0, force), factor=lambda t: t)
    model, done = alone(part, [Support("body", ("x", "y", "z"), "x-")], [load], steps)
    assert_allclose(np.abs(displacement(model, done[-1], "body")).max(), largest, rtol=off)
