"""Two blocks on meshes that match under a uniform pressure: by "faces" of second order it is not even, and a run says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim import Body, Detector, Material, QuasiStatic, Simulation, Support, SurfacePair, Traction, build_model, contact_surface
from fcsim.mesh import brick, rectangle

E, NU, P = 1e9, 0.3, 1e6


def pressed(d: int, elements: str, rule: Any, below: str | None = None) -> tuple[float, int]:
    """The largest error of a displacement over that of the strain P / E, and how many remarks there are on uneven faces.

    below: the elements of the lower block, which has fewer cells then, and the same nodes.
    """
    stone, axes = Material(E, NU, 1000.0), "xyz"[:d]

    def block(name: str, elements: str, finer: int) -> Any:
        simplex = elements.startswith("P")
        if d == 2:
            shape = "triangle" if simplex else "quadrilateral"
            return rectangle(name, (1.0, 0.5), (3 * finer, 2), stone, shape, plane="stress", elements=elements)
        return brick(name, (1.0, 1.0, 0.5), (2 * finer, 2 * finer, 1), stone, "tetrahedron" if simplex else "hexahedron", elements=elements)

    up, rise, down = axes[-1], np.zeros(d), np.zeros(d)
    rise[-1], down[-1] = 0.5, -P
    supports = [Support("lower", (up,), up + "-")]
    supports += [Support(name, (axis,), axis + "-") for name in ("lower", "upper") for axis in axes[:-1]]
    bodies = [
        Body("lower", block("lower", below or elements, 1)),
        Body("upper", block("upper", elements, 2 if below else 1), translation=rise),
    ]
    model = build_model(bodies, supports=supports, loads=[Traction("upper", up + "+", tuple(down))])
    pair = SurfacePair(contact_surface(model, [("upper", up + "-")]), contact_surface(model, [("lower", up + "+")]), 0.3, 1e-2, rule)
    (step,) = Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, eta=30.0), 1)
    strain = np.full(d, NU * P / E)
    strain[-1] = -P / E
    error = model.node_displacement(step.state.x) - model.reference * strain
    return float(np.abs(error).max() / (P / E)), sum("no even pressure" in said for said in step.remarks)


@pytest.mark.parametrize(("d", "elements"), [(2, "Q2"), (2, "P2"), (3, "Q2")])
def test_centres_of_pieces_are_named(d: int, elements: str) -> None:
    error, said = pressed(d, elements, "faces")
    assert error > 0.04
    assert said == 1


@pytest.mark.parametrize(("d", "elements", "below"), [(2, "Q1", "Q2"), (2, "P1", "P2"), (3, "Q1", "Q2")])
def test_so_are_those_on_a_master_of_second_order(d: int, elements: str, below: str) -> None:
    """9, 5 and 30 % off, without a word."""
    error, said = pressed(d, elements, "faces", below)
    assert error > 0.04
    assert said == 1
    error, said = pressed(d, elements, "mortar", below)
    assert error < 1e-3
    assert said == 0


@pytest.mark.parametrize(
    ("d", "elements", "rule"), [(2, "Q2", "gauss"), (2, "P2", "mortar"), (3, "Q2", "gauss"), (3, "P2", "faces"), (2, "Q1", "faces")]
)
def test_what_is_said_to_help_does(d: int, elements: str, rule: str) -> None:
    error, said = pressed(d, elements, rule)
    assert error < 1e-3
    assert said == 0
