"""A block of rubber pressed into a channel that narrows (B8 of the reference list): corners over kinks, friction, large strain."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import fsolve

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.material import neo_hooke
from fcsim.mesh.part import Body
from tests.analytic.references.loading import contact_force, loaded, pair
from tests.analytic.references.meshes import block, spaced

MU, E, NU, WALL, NU_WALL = 0.1, 1000.0, 0.47, 21000.0, 0.3
LENGTH, HEIGHT, NARROW, OUTER = 450.0, 200.0, 149.0, 449.0
"""[mm], [MPa]: the block, half as high as it is; inner and outer wall of the channel, which is 199 wide for 800, then 200 of taper."""


def channel(p: np.ndarray) -> np.ndarray:
    wall = np.interp(p[:, 0], [0, 800, 1000, 1900], [199.0, 199.0, NARROW, NARROW])
    return np.stack([p[:, 0], wall + (OUTER - wall) * p[:, 1]], axis=1)


def pressed_in(cells: tuple[int, int], steps: int, elements: str, nu: float = NU, far: float = 1100.0, **rule: Any) -> np.ndarray:
    """(steps, 3): how far [mm] the block's rear has gone, the channel's resistance and its pressure [N/mm]; the first step takes the
    overlap of 1 mm back."""
    h = LENGTH / cells[0]
    x = [spaced(a, b, round((b - a) / h)) for a, b in ((0, 800), (800, 1000), (1000, 1900))]
    walls = block("channel", [np.unique(np.concatenate(x)), spaced(0, 1, 6, 1.3)], neo_hooke(WALL, NU_WALL, 1e-9), at=channel)
    rubber = block("block", [spaced(0, LENGTH, cells[0]), spaced(0, HEIGHT, cells[1])], neo_hooke(E, nu, 1e-9), elements)
    model = build_model(
        [Body("channel", walls), Body("block", rubber)],
        supports=[
            Support("channel", ("x", "y"), "y+"),
            Support("block", ("y",), "y-"),
            Support("block", ("x",), "x-", velocity=lambda t: far if t * steps > 1.5 else 0.0),
        ],
    )
    found = loaded(model, [pair(model, ("block", "y+"), ("channel", "y-"), MU, alert=20.0, **rule)], steps)
    force = np.array([-contact_force(model, step, "block").sum(axis=0) for step in found])
    return np.column_stack([far * np.arange(steps) / steps, force])


def slab(wall: float) -> float:
    """The pressure [N/mm] on the block within the narrow channel, from slices that are each uniform: neo-Hooke in plane strain between
    walls that give way by their thickness times the pressure over `wall`, pushed from behind against friction, free in front."""
    mu, lame = 0.5 * E / (1 + NU), E * NU / ((1 + NU) * (1 - 2 * NU))

    def slice_of(axial: float, guess: np.ndarray) -> tuple[np.ndarray, float]:
        """The stretches along and across and the pressure, per length of the undeformed block, under a nominal stress along."""

        def stress(l: np.ndarray) -> np.ndarray:
            return (mu * (l * l - 1) + lame * np.log(l[0] * l[1])) / l

        def equations(l: np.ndarray) -> list[float]:
            along, across = stress(l)
            return [along - axial, l[1] * HEIGHT - NARROW + across / l[0] * (OUTER - NARROW) / wall]

        stretches = fsolve(equations, guess, xtol=1e-12)
        return stretches, -float(stress(stretches)[1])

    n, axial, pressure, guess = 200, 0.0, 0.0, np.array([1.25, 0.76])
    for _ in range(n):
        guess, before = slice_of(axial, guess)
        _, half = slice_of(axial - 0.5 * MU * before / HEIGHT * LENGTH / n, guess)
        pressure += half * LENGTH / n
        axial -= MU * half / HEIGHT * LENGTH / n
    return pressure


def test_B8_press_fit() -> None:
    """Kratos' validation, K. A. Fischer and P. Wriggers 2006: 3.66e4 N/mm at the peak, 2.50e4 within the narrow part, read off a figure. In
    the straight parts all of the surface slides, on walls that give way by 1e-3 and 1e-2 of their thickness; within, the pressure lies
    between those of slabs with walls that give way each for itself and of slabs with rigid ones."""
    u, resistance, pressure = pressed_in((9, 4), 25, "Q1").T
    wide, narrow = u < 340, u > 1050
    assert_allclose(resistance[wide], MU * pressure[wide], rtol=1e-3)
    assert_allclose(resistance[narrow], MU * pressure[narrow], rtol=1e-2)
    assert slab(WALL / (1 - NU_WALL**2)) < pressure[-1] < slab(1e6 * WALL)
    assert_allclose(resistance.max(), 3.66e4, rtol=0.11)
    assert_allclose(resistance[-1], 2.50e4, rtol=0.07)


@pytest.mark.slow
def test_B8_refined() -> None:
    """Finer cells, cells of second order, and nodes on smoothed normals: 3.3 to 3.4e4 at the peak; the published 3.66e4 is not
    reached by refinement. Both published numbers belong to nu = 0.49."""
    ways: list[tuple[tuple[int, int], str, dict[str, Any]]] = [
        ((18, 8), "Q1", {}),
        ((9, 4), "Q1", {"rule": "nodes", "normals": "smooth"}),
        ((6, 3), "Q2", {"rule": "nodes", "normals": "smooth"}),
    ]
    for cells, elements, rule in ways:
        _, resistance, pressure = pressed_in(cells, 50, elements, **rule).T
        assert_allclose(resistance.max(), 3.36e4, rtol=0.025)
        assert_allclose(pressure[-1], 2.365e5, rtol=0.01)
    _, resistance, _ = pressed_in((9, 4), 50, "Q1-bbar", nu=0.49).T
    assert_allclose([resistance.max(), resistance[-1]], [3.66e4, 2.50e4], rtol=0.03)
