"""Bodies that meet themselves: what is contact, and what only looks like it since the body is thin, bent or coarse."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.contact_detection import Everything, contact_matrix
from fcsim.mesh.blocks import brick, rectangle, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part
from tests.unit.contact_detection.general.strips import arc, bent, fork, hollow, strip

STONE = Material(1e9, 0.2, 2000.0)


def alone(part: Part, **options) -> tuple[Model, Everything]:
    model = build_model([Body("body", part)])
    return model, Everything(model, 0.5, **options)


def l_shape(cell: str) -> Part:
    """A rectangle of 4 x 4 without its upper right quarter."""
    whole = rectangle("L", (1, 1), (4, 4), STONE, cell)
    keep = ~np.all(whole.points[whole.cells].mean(axis=1) > 0.5, axis=1)
    used, cells = np.unique(whole.cells[keep], return_inverse=True)
    return Part("L", whole.points[used], cells.reshape(-1, whole.cells.shape[1]), cell, {}, STONE)


def plate(cells: int) -> Part:
    """Thinner than its facets and than the alert distance, bent like a gutter: its concave side sees itself."""
    return strip("gutter", *arc(1.0, -2.5, -0.6, cells), 0.004, 1, STONE, width=0.4)


BODIES = {
    "brick": (brick("brick", (0.2, 0.1, 0.1), (4, 2, 2), STONE), False),
    "tetrahedra": (brick("brick", (0.2, 0.1, 0.1), (4, 2, 2), STONE, cell="tetrahedron"), False),
    "thin plate": (brick("plate", (1.0, 1.0, 0.005), (6, 6, 1), STONE), False),
    "voussoir": (strip("voussoir", *arc(2.0, 1.2, 1.9, 12), 0.5, 4, STONE), False),
    "L": (l_shape("quadrilateral"), True),
    "L of triangles": (l_shape("triangle"), True),
    "gutter": (plate(24), True),
    "coarse gutter": (plate(6), True),
    "thin ring": (strip("ring", *(a[:-1] for a in arc(1.0, 0, 2 * np.pi, 60)), 0.005, 2, STONE, closed=True), True),
    "tube": (strip("tube", *(a[:-1] for a in arc(1.0, 0, 2 * np.pi, 24)), 0.3, 2, STONE, closed=True, width=0.5), True),
    "U": (fork(STONE, 1.0, 0.1, 0.3, 20, 2), True),
    "thin U": (fork(STONE, 1.0, 0.002, 0.3, 20, 1), True),
    "hollow": (hollow(STONE, 1.0, 0.05, 0.2, 0.1), True),
}


@pytest.mark.parametrize("name", BODIES)
def test_nothing_touches_itself_that_does_not(name: str) -> None:
    """Slightly strained bodies of all kinds, with an alert distance beyond the thin ones' thickness; convex ones are not asked."""
    part, folds = BODIES[name]
    model, everything = alone(part, alert=0.02)
    assert len(everything.folding) == folds
    assert len(everything(model.reference)) == 0
    for seed in range(6):
        x = bent(model.reference, 0.03, seed)
        assert len(everything(x)) == 0
        assert len(everything(x, bent(model.reference, 0.03, seed + 1) - model.reference)) == 0


@pytest.mark.parametrize("gap", [5e-3, 1e-6, -1e-6, -5e-3, -0.02])
@pytest.mark.parametrize("solid", [False, True])
def test_the_gap_between_two_legs(gap: float, solid: bool) -> None:
    """The legs of a U moved towards each other as they are: each node of either has the gap there is between them."""
    if solid:
        line = np.concatenate(
            [np.linspace([1, 0.3], [0, 0.3], 21), arc(0.3, np.pi / 2, 3 * np.pi / 2, 12)[0][1:-1], np.linspace([0, -0.3], [1, -0.3], 21)]
        )
        across = np.concatenate([[[0, -1.0]] * 21, arc(0.3, np.pi / 2, 3 * np.pi / 2, 12)[1][1:-1], [[0, 1.0]] * 21])
        part, inner = strip("U", line, across, 0.1, 2, STONE, width=0.1), 0.5
    else:
        part, inner = fork(STONE, 1.0, 0.1, 0.3, 20, 2), 0.3
    model, everything = alone(part, alert=0.01)
    x = model.reference.copy()
    legs = x[:, 0] > 0.5
    x[legs, 1] -= np.sign(x[legs, 1]) * 0.5 * (inner - gap)
    found = everything(x)
    facing = found.point[:, 0] > 0.55
    assert_allclose(found.gap[facing], gap, atol=1e-12)
    assert_allclose(np.abs(found.frame[facing, 0, 1]), 1, atol=1e-9)
    assert np.all(found.bodies == 0)
    places = np.unique(np.round(found.point[facing, 0], 6))
    assert_allclose(places[-9:], np.linspace(0.6, 1, 9), atol=1e-6)
    H = contact_matrix(found, model.n_nodes)
    assert_allclose(H.T @ np.tile(np.arange(1.0, model.dimension + 1), model.n_nodes), 0, atol=1e-12)
    again = everything(x + np.arange(3.0, 3.0 + model.dimension))
    assert np.array_equal(again.identity, found.identity)


def test_a_crack_that_is_closed_at_the_start() -> None:
    """Two sheets of nodes at one place: contacts of gap 0, but at the tip; opened, none."""
    part = fork(STONE, 1.0, 0.2, 0.0, 10, 2)
    model, everything = alone(part, alert=1e-3)
    found = everything(model.reference)
    assert_allclose(found.gap, 0, atol=1e-15)
    assert_allclose(np.unique(np.round(found.point[:, 0], 9)), np.linspace(0.1, 1, 10), atol=1e-9)
    x = model.reference.copy()
    upper = np.unique(part.cells[part.points[part.cells].mean(axis=1)[:, 1] > 0])
    x[upper, 1] += 0.01 * np.maximum(x[upper, 0], 0) ** 2
    assert len(everything(x).take(everything(x).gap <= 0)) == 0


def test_it_can_be_excluded_and_others_stay() -> None:
    part = fork(STONE, 1.0, 0.1, 0.0, 10, 2)
    floor = rigid_box("floor", (1, 1, 1), (0, 0, 0), 1.0)
    model = build_model([Body("body", part)])
    assert len(Everything(model, 0.5)(model.reference)) == 10
    assert len(Everything(model, 0.5, exclude=[("body", "body")])(model.reference)) == 0
    assert len(Everything(build_model([floor]), 0.5).folding) == 0


@pytest.mark.parametrize("angle", [0.1, 0.8])
def test_turning_as_a_whole_is_no_way_towards_itself(angle: float) -> None:
    """A step's displacement that turns the body and moves it far: no looks along the way, no contact."""
    model, everything = alone(fork(STONE, 1.0, 0.1, 0.3, 20, 2))
    arm = model.reference - model.reference.mean(axis=0)
    way = angle * np.column_stack([-arm[:, 1], arm[:, 0]]) + [5.0, -3.0]
    assert everything._fast(model.reference, way, np.zeros(0, dtype=np.int64))[1] == 0


def test_legs_that_would_pass_each_other_in_a_step_are_seen() -> None:
    model, everything = alone(fork(STONE, 1.0, 0.1, 0.3, 20, 2), alert=1e-3)
    way = np.zeros_like(model.reference)
    legs = model.reference[:, 0] > 0
    way[legs, 1] = -np.sign(model.reference[legs, 1]) * 0.6 * model.reference[legs, 0]
    found = everything(model.reference, way)
    tips = found.take(found.point[:, 0] > 0.9)
    assert len(tips) and np.all(tips.gap > 0.2)
