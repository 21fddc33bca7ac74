"""Chains and pendulums in statics, which nothing but the tension of their links holds: exact shapes, and the geometric stiffness itself."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import root

from fcsim import (
    Ball,
    Body,
    Everything,
    Hinge,
    Linkage,
    Material,
    QuasiStatic,
    RigidBody,
    Rod,
    Simulation,
    Slider,
    SpringDamper,
    build_model,
    without_contact_of,
)
from fcsim.arrays import FloatArray
from fcsim.linkage.stiffness import FREE, link_stiffness
from fcsim.mesh import brick, rigid_box, rigid_rectangle


def bar(name: str, first: FloatArray, end: FloatArray, mass: float) -> RigidBody:
    """A slender rigid bar between two points, in the plane or in the plane y = 0 of space."""
    d, way = len(first), end - first
    l, turn = float(np.linalg.norm(way)), float(np.arctan2(way[-1], way[0]))
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]]) if d == 2 else np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    straight = rigid_rectangle(name, (l, 0.02 * l), (0, 0), mass) if d == 2 else rigid_box(name, (l, 0.02 * l, 0.02 * l), (0, 0, 0), mass)
    middle = 0.5 * (first + end)
    inertia = straight.inertia if d == 2 else R @ straight.inertia @ R.T
    return replace(straight, points=straight.points @ R.T + middle, inertia=inertia, centre=middle)


@pytest.mark.parametrize(("d", "n", "unit", "eta"), [(2, 20, 1.0, 1e-6), (2, 7, 1e3, 1e-9), (3, 20, 1.0, 1e-6), (3, 9, 1.0, 1e-9)])
def test_a_chain_hangs_from_two_points(d: int, n: int, unit: float, eta: float) -> None:
    """n rigid bars of the weight w on balls between two points, laid as a V: bar k hangs at tan a_k = (k + 1/2 - n / 2) w / H, the
    horizontal pull H such that they reach across (the catenary of n links)."""
    L, l, w = 1.4 * unit, 1.4 * unit / n, 9.81 / n
    turn = np.where(np.arange(n) < n // 2, -1, 1) * np.arccos(1 / 1.4)
    span = l * float(np.cos(turn).sum())
    places = np.zeros((n + 1, d))
    places[1:, 0], places[1:, -1] = np.cumsum(l * np.cos(turn)), np.cumsum(l * np.sin(turn))
    drop = float(places[-1, -1])
    bodies = [bar(f"b{k}", places[k], places[k + 1], 1.0 / n) for k in range(n)]
    model = build_model(bodies, gravity=lambda t: (0.0,) * (d - 1) + (-9.81,))
    names: list[Any] = [None, *(body.name for body in bodies), None]
    links = Linkage(model, [Ball(f"j{k}", names[k], names[k + 1], tuple(places[k])) for k in range(n + 1)])
    detector = without_contact_of(Everything(model, mu=0.0), model, list(pairwise(names[1:-1])))
    (last,) = Simulation(model, detector, QuasiStatic(1.0, eta=eta), 1, linkage=links, witness=None)
    assert last.substeps == 1

    def angles(z: FloatArray) -> FloatArray:
        return np.arctan((np.arange(n) + 0.5 - n / 2 + z[1]) * w / z[0])

    def missing(z: FloatArray) -> FloatArray:
        return np.array([np.cos(angles(z)).sum() - span / l, np.sin(angles(z)).sum() - drop / l])

    H, lift = (found := root(missing, [2.4, 0.0], tol=1e-13)).x
    assert found.success
    at = np.concatenate([[0.0], np.cumsum(l * np.sin(angles(found.x)))])
    moved = model.rigid_part(last.state.x)[:, :d] + np.array([body.centre for body in model.rigid])
    assert_allclose(moved[:, -1], 0.5 * (at[1:] + at[:-1]), atol=1e-8 * L)
    assert_allclose(last.link_force("j0")[0], H, rtol=1e-6)
    assert_allclose(last.link_force("j0")[-1], -w * (n / 2 - lift), rtol=1e-6)


def test_masses_on_rods_and_springs() -> None:
    """Weights on springs in a line between two points sag until the springs balance them, each node by its two; as on rods, laid askew."""
    n = 5
    for kind, sag in (("springs", 0.0), ("rods", 0.2)):
        places = np.array([[(k + 1) / (n + 1), 0.05 * sag * (-1) ** k, -sag * np.sin(np.pi * (k + 1) / (n + 1))] for k in range(n)])
        bodies = [rigid_box(f"m{k}", (0.01, 0.01, 0.01), tuple(places[k]), 1.0) for k in range(n)]
        model = build_model(bodies, gravity=lambda t: (0.0, 0.0, -9.81))
        ends = [(0.0, 0.0, 0.0), *map(tuple, places), (1.0, 0.0, 0.0)]
        names: list[Any] = [None, *(body.name for body in bodies), None]
        links: list[Any] = [
            Rod(f"r{k}", names[k], names[k + 1], (ends[k], ends[k + 1]))
            if kind == "rods"
            else SpringDamper(f"r{k}", names[k], names[k + 1], (ends[k], ends[k + 1]), stiffness=500.0)
            for k in range(n + 1)
        ]
        detector = Everything(model, mu=0.0)
        (last,) = Simulation(model, detector, QuasiStatic(1.0, eta=1e-6), 1, linkage=Linkage(model, links), witness=None)
        at = np.array([ends[0], *(places + model.rigid_part(last.state.x)[:, :3]), ends[-1]])
        way, before = np.diff(at, axis=0), np.linalg.norm(np.diff(np.array(ends), axis=0), axis=1)
        length = np.linalg.norm(way, axis=1)
        if kind == "springs":
            pull = 500.0 * (length - before)
        else:
            assert_allclose(length, before, rtol=1e-9)
            pull = np.array([np.linalg.norm(last.link_force(f"r{k}")) for k in range(n + 1)])
        assert_allclose(np.diff((pull / length)[:, None] * way, axis=0), np.tile([0.0, 0.0, 9.81], (n, 1)), atol=1e-5)


@pytest.mark.parametrize("angle", [0.5, 1.57, 2.9])
def test_a_pendulum_comes_down(angle: float) -> None:
    """From any angle, almost on its head too, a pendulum's statics hang: of its two equilibria the stable one."""
    end = 1.0 * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    model = build_model([bar("rod", np.zeros(3), end, 1.0)], gravity=lambda t: (0.0, 0.0, -9.81))
    hinge = Hinge("hinge", None, "rod", ends=((0.0, -0.1, 0.0), (0.0, 0.1, 0.0)))
    run = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=1e-9), 1, linkage=Linkage(model, [hinge]), witness=None)
    (last,) = run
    centre = 0.5 * end + model.rigid_part(last.state.x)[0, :3]
    assert_allclose(centre, [0.0, 0.0, -0.5], atol=1e-8)
    assert_allclose(last.link_force("hinge"), [0.0, 0.0, -9.81], atol=1e-6)


def test_the_geometric_stiffness_by_differences() -> None:
    """B = -d(G l)/dx of all kinds of links between rigid, deformable bodies and the ground, its symmetric part, by central differences."""
    soft = Material(1e6, 0.3, 1000.0)
    bodies = [
        rigid_box("a", (1.0, 0.4, 0.4), (0.5, 0.0, 0.0), 1.0),
        rigid_box("b", (1.0, 0.4, 0.4), (1.6, 0.1, 0.5), 1.0),
        Body("c", brick("c", (1.0, 0.5, 0.5), (2, 1, 1), soft, origin=(2.5, 0.0, 0.0))),
    ]
    model = build_model(bodies)
    rng = np.random.default_rng(3)
    links = [
        Rod("rod", "a", "c", ((0.2, 0.1, 0.1), (2.7, 0.2, 0.3))),
        SpringDamper("spring", "b", None, ((1.4, 0.0, 0.4), (1.0, 2.0, 3.0)), stiffness=10.0),
        Ball("ball", "a", "b", (1.0, 0.1, 0.2)),
        Hinge("hinge", "b", "c", ends=((2.7, 0.3, 0.1), (3.1, 0.3, 0.4))),
        Slider("slider", "c", "a", ends=((2.6, 0.2, 0.1), (3.4, 0.2, 0.3))),
    ]
    linkage = Linkage(model, links)
    x = np.zeros(model.n_dofs)
    l = rng.normal(size=linkage.n_rows)

    def forces(x: FloatArray) -> FloatArray:
        return np.asarray(linkage.matrix(linkage.rows(x), x, balanced=False) @ l)

    step, D = 1e-6, np.empty((model.n_dofs, model.n_dofs))
    for k, e in enumerate(np.eye(model.n_dofs)):
        D[:, k] = -(forces(model.advance(x, step * e)) - forces(model.advance(x, -step * e))) / (2 * step)
    B = link_stiffness(linkage, linkage.rows(x), l, x)
    assert B is not None
    scale = float(np.abs(D).max())
    assert_allclose(B.toarray(), 0.5 * (D + D.T), atol=1e-7 * scale + 20 * FREE * scale)
    held = link_stiffness(linkage, linkage.rows(x), l, x, convex=True)
    assert held is not None
    assert np.linalg.eigvalsh(held.toarray())[0] > -1e-12 * scale
