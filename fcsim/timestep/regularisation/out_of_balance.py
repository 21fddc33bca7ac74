"""What is said of statics that the mass regularisation holds up: eta / h^2 M dx is no force of the problem."""

from __future__ import annotations

import itertools

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.timestep.energy import pushing
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.step import Step

ON_THE_WAY, AT_THE_END = 0.2, 0.02
"""Share of the forces that a body bears from which on it is named, while loads grow and in the last step of a run."""

SEEN = 1e-4
"""Of the forces that a body bears: from which share on it is asked, too, what share of their work the mass takes, which says how much less
the body gives way. Clamps press by many times the load that bends what they hold, and do no work."""

NONE = 1e-6
"""Of the largest forces that a body of the model bears: bodies with less are asked relative to that."""


def out_of_balance(step: Step, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark, by its kind, on the body of which eta / h^2 M dx carries the largest share of the forces that it bears, or takes that
    of their work; steps: of the run."""
    scheme, last = step.scheme, step.number == steps
    kind = "out of balance at the end" if last else "out of balance"
    if not isinstance(scheme, QuasiStatic) or not scheme.eta or kind in said:
        return {}
    least = AT_THE_END if last else ON_THE_WAY
    shares, of_work = _shares(step, scheme)
    of_work = np.where(shares > SEEN, of_work, 0.0)
    means = "smaller steps of the loads" if not last else "more steps in which loads stand"
    mass = f"the mass that regularises statics, eta = {scheme.eta:g} at h = {scheme.h:g}"
    if shares.max() >= least and shares.max() >= of_work.max():
        name = step.model.bodies[int(np.argmax(shares))].name
        said_of = f"{shares.max():.2g} of the forces on body {name!r} are carried by {mass}: it is not in equilibrium"
    elif of_work.max() >= least:
        name = step.model.bodies[int(np.argmax(of_work))].name
        said_of = f"{of_work.max():.2g} of the work on body {name!r} is taken by {mass}: it gives way by about as much too little"
    else:
        return {}
    return {kind: f"{when}: {said_of}. What helps: {means}, or a smaller eta"}


def _shares(step: Step, scheme: QuasiStatic) -> tuple[FloatArray, FloatArray]:
    """(nb,) What eta / h^2 M dx carries on a body's free dofs over what the body bears: half the sum of the sizes of all forces on it,
    that of the mass too, since action and reaction balance; of forces or of moments over the body's size, the larger. The mass carries the
    sum of its sizes where others balance it, half of that where it balances itself.

    And (nb,) the work dx . (eta / h^2 M dx) over that of the forces, sums of sizes too: of (K + R) dx = f the share by which dx . f is too
    small. Rigid bodies do not give way: 0.
    """
    model, x = step.model, step.state.x
    begin = model.dof_offset[:-1]
    weights = np.stack([np.ones(model.n_dofs), np.zeros(model.n_dofs)])  # of forces, of moments
    for first, end, body in zip(begin.tolist(), model.dof_offset[1:].tolist(), model.bodies, strict=True):
        if first >= model.n_elastic:
            size = max(float(np.ptp(body.points, axis=0).max(initial=0.0)), 1e-300)
            weights[:, first + model.dimension : end] = [[0.0], [1 / size]]
    dx = scheme.h * step.state.v
    inertia = scheme.eta / scheme.h**2 * model.apply_mass(dx, model.rigid_mass(step.previous.x))
    inertia -= model.driven_share(inertia)
    contact = step.H @ step.reaction
    acting = [model.load(step.state.t, x) + pushing(model, x, When.at(step.state.t)), contact.copy(), step.support_impulse]
    rigid = model.n_elastic  # the forces of contacts and links on it cancel each other in a body's dofs where it is squeezed: a strut
    contact[rigid:] = np.abs(step.H)[rigid:] @ np.abs(step.reaction)
    if step.linked is not None and step.result.multiplier is not None:
        linked = step.linked.G @ step.result.multiplier
        linked[rigid:] = np.abs(step.linked.G)[rigid:] @ np.abs(step.result.multiplier)
        acting.append(linked)
    works = [np.add.reduceat(np.abs(dx * force), begin) for force in (inertia, *acting)]
    work = _relative(works[0], np.maximum.reduce(works))
    work[begin >= model.n_elastic] = 0.0
    sizes = [np.add.reduceat(weights * np.abs(force), begin, axis=1) for force in (inertia, acting[0], contact, *acting[2:])]
    own, soft = sizes[0].max(axis=0), len(model.deformable)
    own[:soft] = np.minimum(own[:soft], 0.5 * (own[:soft] + _resultant(model, x, inertia)))
    return _relative(own, 0.5 * np.sum(sizes, axis=0).max(axis=0)), work


def _resultant(model: Model, x: FloatArray, force: FloatArray) -> FloatArray:
    """(n_deformable,) The sizes of what a force (n_dofs,) on a body sums to and of its moment about the body's middle, over a third of its
    length: of eta / h^2 M dx of a rigid motion the sum of its sizes."""
    d, first = model.dimension, model.node_offset[: len(model.deformable)]
    if not len(first):
        return np.zeros(0)
    f, places = force[: model.n_elastic].reshape(-1, d), x[: model.n_elastic].reshape(-1, d)
    places = model.reference[: len(places)] + places
    low, high = np.minimum.reduceat(places, first), np.maximum.reduceat(places, first)
    arms = places - np.repeat(0.5 * (low + high), np.diff([*first, len(places)]), axis=0)
    size = np.abs(np.add.reduceat(f, first)).sum(axis=1)
    for i, j in itertools.combinations(range(d), 2):
        moment = np.add.reduceat(arms[:, i] * f[:, j] - arms[:, j] * f[:, i], first)
        size += 3 * np.abs(moment) / (high - low)[:, [i, j]].max(axis=1)
    return size


def _relative(own: FloatArray, size: FloatArray) -> FloatArray:
    """(nb,) own (nb,) over size (nb,)."""
    size = np.maximum(size, NONE * float(size.max(initial=0.0)))
    return np.divide(own, size, out=np.zeros_like(size), where=size > 0)
