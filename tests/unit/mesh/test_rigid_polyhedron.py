"""Mass properties of polyhedra against closed forms."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fcsim import InputError
from fcsim.mesh import rigid_polyhedron


@pytest.mark.parametrize("unit", [1e-3, 1.0])
def test_a_box(unit: float) -> None:
    """m = rho a b c; inertia m/12 diag(b^2 + c^2, a^2 + c^2, a^2 + b^2)."""
    a, b, c = np.array([1.0, 2.0, 0.5]) * unit
    corners = np.array(list(itertools.product((0, a), (0, b), (0, c)))) + 3 * unit
    box = rigid_polyhedron("box", corners, 2000.0)
    mass = 2000 * a * b * c
    assert box.mass == pytest.approx(mass)
    assert box.centre == pytest.approx(np.array([a, b, c]) / 2 + 3 * unit)
    assert box.inertia == pytest.approx(mass / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b]), abs=1e-12 * mass * unit**2)


def test_a_regular_tetrahedron() -> None:
    """Volume l^3 / (6 sqrt 2), inertia m l^2 / 20 about any axis."""
    corners = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], dtype=float)
    length = np.sqrt(8)
    body = rigid_polyhedron("t", [*corners, (0, 0, 0)], 3.0)
    assert len(body.points) == 4  # the point within is left out
    assert body.mass == pytest.approx(3 * length**3 / (6 * np.sqrt(2)))
    assert body.inertia == pytest.approx(body.mass * length**2 / 20 * np.eye(3))


def test_what_spans_no_volume_is_refused() -> None:
    flat = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    with pytest.raises(InputError, match="span a volume"):
        rigid_polyhedron("flat", flat, 1.0)
    with pytest.raises(InputError, match="density"):
        rigid_polyhedron("light", [*flat, (0, 0, 1)], 0.0)
    with pytest.raises(InputError, match="shape"):
        rigid_polyhedron("plane", [(0, 0), (1, 0), (0, 1)], 1.0)
