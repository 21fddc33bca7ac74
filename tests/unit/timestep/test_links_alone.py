"""Two bodies that nothing but a joint holds: momentum, moment of momentum and energy of the closed system, for every kind of link."""

from typing import Any

import numpy as np
import pytest

import fcsim
from fcsim.linkage import Ball, Bonded, Hinge, Rod, Slider, SpringDamper, Tied
from fcsim.mesh import Body, Material, brick, rectangle, rigid_box, rigid_rectangle
from tests.analytic.test_linkage import moved

FLAT = rigid_rectangle("a", (1.0, 0.1), (0.5, 0.0), 2.0), rigid_rectangle("b", (1.0, 0.1), (1.5, 0.0), 1.0)
BOXES = rigid_box("a", (1.0, 0.2, 0.1), (0.5, 0.0, 0.0), 2.0), rigid_box("b", (1.0, 0.1, 0.2), (1.5, 0.0, 0.0), 1.0)
SOFT = Material(1e7, 0.3, 1000.0)
SHEETS = tuple(Body(n, rectangle(n, (1.0, 0.2), (4, 1), SOFT, origin=(x, 0.0))) for n, x in (("a", 0.0), ("b", 1.0)))
BARS = (
    Body("a", brick("a", (1.0, 0.4, 0.4), (2, 1, 1), SOFT)),
    Body("b", brick("b", (1.0, 0.4, 0.4), (2, 2, 2), SOFT, origin=(1.0, 0.0, 0.0))),
)
HALVES = BARS[0], Body("b", brick("b", (1.0, 0.4, 0.4), (2, 1, 1), SOFT, origin=(1.0, 0.0, 0.0)))
APART = (0.8, 0.1, 0.05), (1.3, 0.05, 0.1)
ALONG = (1.1, 0.0, 0.0), (1.9, 0.0, 0.0)

KEPT: dict[str, tuple[Any, Any]] = {
    "pin": (FLAT, Ball("j", "a", "b", (1.0, 0.0))),
    "ball": (BOXES, Ball("j", "a", "b", (1.0, 0.0, 0.0))),
    "hinge": (BOXES, Hinge("j", "a", "b", ((1.0, -0.1, 0.0), (1.0, 0.1, 0.05)))),
    "slider in the plane": (FLAT, Slider("j", "a", "b", ((1.1, 0.0), (1.9, 0.0)))),
    "slider that turns": (BOXES, Slider("j", "a", "b", ALONG)),
    "slider": (BOXES, Slider("j", "a", "b", ALONG, beside=(1.5, 0.1, 0.0))),
    "rod": (BOXES, Rod("j", "a", "b", APART)),
    "spring": (BOXES, SpringDamper("j", "a", "b", APART, 50.0)),
    "dashpot": (BOXES, SpringDamper("j", "a", "b", APART, 50.0, 2.0)),
    "pin of deformable bodies": (SHEETS, Ball("j", "a", "b", (1.0, 0.1))),
    "tie": (BARS, Tied("j", ("b", "x-"), ("a", "x+"))),
    "bond": (HALVES, Bonded("j", "a", "b")),
}
BY_ORDER: dict[str, tuple[Any, Any]] = {
    "hinge": (BARS, Hinge("j", "a", "b", ((1.0, 0.1, 0.2), (1.0, 0.3, 0.2)))),
    "rod": (SHEETS, Rod("j", "a", "b", ((0.8, 0.1), (1.2, 0.15)))),
    "spring": (SHEETS, SpringDamper("j", "a", "b", ((0.8, 0.1), (1.2, 0.15)), 1e4, 20.0)),
}


def thrown(model: fcsim.Model) -> np.ndarray:
    """Deformable bodies turn as one; each rigid one flies and turns on its own, which the joint ends in the first step."""
    v, d = np.zeros(model.n_dofs), model.dimension
    turning = np.array([[0.5, -1.0, 3.0], [-0.3, 2.0, -4.0]])
    if model.n_elastic:
        arm = np.pad(model.reference - model.reference.mean(axis=0), ((0, 0), (0, 3 - d)))
        axis = turning[0] if d == 3 else np.array([0.0, 0.0, 3.0])
        v[: model.n_elastic] = (np.array([1.0, -0.5, 0.3])[:d] + np.cross(axis, arm)[:, :d]).ravel()
        return v
    rigid = model.rigid_part(v)
    rigid[:, :d] = np.array([[1.0, -0.5, 0.3], [0.2, 0.7, -0.4]])[:, :d]
    rigid[:, d:] = turning if d == 3 else turning[:, 2:]
    return v


def momenta(model: fcsim.Model, state: fcsim.State) -> np.ndarray:
    """Momentum [N s] and moment of momentum about the origin [N m s], (6,), added up body by body."""
    d = model.dimension
    P = model.apply_mass(state.v, model.rigid_mass(state.x))
    places = model.positions(state.x)[: model.n_elastic // d]
    p, spin = P[: model.n_elastic].reshape(-1, d), np.zeros((0, 2 * d - 3))
    if not model.n_elastic:
        rigid = model.rigid_part(P)
        places = np.array([body.centre for body in model.bodies]) + model.rigid_part(state.x)[:, :d]
        p, spin = rigid[:, :d], rigid[:, d:]
    wide = [np.pad(a, ((0, 0), (0, 3 - d))) for a in (places, p)]
    own = spin.sum(axis=0) if spin.shape[1] == 3 else np.array([0.0, 0.0, spin.sum()])
    return np.concatenate([wide[1].sum(axis=0), np.cross(wide[0], wide[1]).sum(axis=0) + own])


def flight(bodies: Any, link: Any, h: float, time: float) -> tuple[np.ndarray, list[fcsim.Step]]:
    """Momenta (steps + 1, 6) over those at the beginning, the first row theirs, and the steps."""
    steps = moved(bodies, [link], fcsim.Theta(h), round(time / h), 0.0, initial=thrown)
    model = steps[0].model
    found = np.array([momenta(model, steps[0].previous), *(momenta(model, step.state) for step in steps)])
    size = np.repeat([np.linalg.norm(found[0, :3]), np.linalg.norm(found[0, 3:])], 3)
    return found / size, steps


@pytest.mark.parametrize("name", KEPT)
def test_momentum_moment_of_momentum_and_energy_are_kept(name: str) -> None:
    """To 1e-8, the moment from the end of the first step on, which makes the velocities of rigid bodies agree; the balance of energy
    closes, a dashpot takes energy, no other link gives any but for the swing of the scheme's order."""
    found, steps = flight(*KEPT[name], h=4e-3, time=0.12)
    assert np.abs(found - found[0])[:, :3].max() < 1e-12
    assert np.abs(found - found[1])[1:].max() < 1e-8
    energies = [step.energy for step in steps]
    begun = energies[0].at_beginning
    assert max(abs(e.residual) for e in energies) < 1e-11 * begun
    held = np.array([e.kinetic + e.elastic + e.links for e in energies])
    assert np.all(held < (1 + 1e-5) * begun)
    if name == "dashpot":
        assert np.all(np.diff(held) < 0) and held[-1] < 0.995 * begun
    else:
        assert np.ptp(held[1:]) < 1e-3 * begun


@pytest.mark.parametrize("name", BY_ORDER)
def test_between_deformable_bodies_the_moment_is_kept_to_second_order(name: str) -> None:
    """Forces act along directions of where the links are closed, x + h v / 2; the moment is counted at the mean of both ends, h^2 apart."""
    off = []
    for h in (4e-3, 2e-3):
        found, steps = flight(*BY_ORDER[name], h=h, time=0.06)
        assert np.abs(found - found[0])[:, :3].max() < 1e-12
        begun = steps[0].energy.at_beginning
        assert max(abs(step.energy.residual) for step in steps) < 1e-11 * begun
        assert max(step.energy.kinetic + step.energy.elastic + step.energy.links for step in steps) < (1 + 2e-5) * begun
        off.append(np.abs(found - found[0]).max())
    assert off[0] < 1e-5 and off[0] / off[1] > 2.5  # the bodies vibrate: 4 in the limit
