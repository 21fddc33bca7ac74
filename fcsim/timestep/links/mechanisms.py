"""Statics of bodies that links leave a motion of their own: a mechanism, which nothing but contact and eta holds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.linkage import Linkage
from fcsim.timestep.limits import KinematicsLeft
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

MOST = 2e6
"""Entries of the rigid motions of all bodies from which on it is not asked: their singular values are computed."""
FREE = 1e-7
"""Of the largest singular value: motions of bodies that supports and links do not hold."""
SEEN = 1e-3
"""Of such a motion: what linked bodies do beside each other."""


def mechanisms(model: Model, linkage: Linkage | None, scheme: Scheme, state: State) -> Iterator[str]:
    """A remark of statics on the first deformable body that moves beside what it is linked to without a strain, by supports and links.

    Of all bodies the motions v_b(x) = t_b + w_b x (x - c) with G^T v = 0 and v = 0 where supports drive: those in which the (t, w) of two
    linked bodies, or of one and the ground, differ. Rigid bodies and such of finite strain hang there by the stiffness of what pulls them
    (`stiffness`), the others have none: the mass of eta alone stands against the motion.
    """
    if scheme.timing.moving or linkage is None or not linkage.n_rows or linkage.cables:
        return
    d, count = model.dimension, len(model.bodies)
    if model.n_dofs * count * (3 * d - 3) > MOST:
        return
    positions = model.positions(state.x)
    centre, size = positions.mean(axis=0), float(np.ptp(positions, axis=0).max())
    each = 3 * d - 3
    free = _free(model, linkage, state.x, _motions(model, state.x, positions, centre, size)).reshape(-1, count, each)
    if not len(free):
        return
    soft = {number for group in model.groups if not group.finite for number in group.members.tolist()}
    for link in linkage.links:
        bodies = [model.number[end] for end in _ends(link) if end is not None]
        if not bodies:  # a control holds points of many
            continue
        apart = free[:, bodies[-1]] - free[:, bodies[0]] if len(bodies) == 2 else free[:, bodies[-1]]
        loose = [number for number in reversed(bodies) if number in soft]
        if not loose or float(np.abs(apart).max(initial=0.0)) < SEEN:
            continue
        _, sizes, axes = np.linalg.svd(apart, full_matrices=False)
        several = int(np.sum(sizes > SEEN))
        names = [model.bodies[number].name for number in (loose[0], *(b for b in bodies if b != loose[0]))]
        yield (
            f"statics: links and supports leave body {names[0]!r} free beside {repr(names[1]) if len(names) > 1 else 'the ground'}, to "
            f"{_named(axes[0], centre, size, d)}{f' (one of {several} such motions)' if several > 1 else ''}: a mechanism without "
            "stiffness, which contact or the mass of eta alone holds. What helps: another link or support, dynamics, which follow the "
            "motion, rigid bodies, which hang where their links pull them, or, of bodies that hang there already, a law of finite strain "
            "such as saint_venant_kirchhoff, in which their stress holds them"
        )
        return


def free_motions(model: Model, linkage: Linkage, state: State) -> FloatArray:
    """Velocities (n_dofs, k) of the motions without a strain that supports and links leave the bodies, turns by 1 / the model's size."""
    positions = model.positions(state.x)
    E = _motions(model, state.x, positions, positions.mean(axis=0), float(np.ptp(positions, axis=0).max()))
    return E @ _free(model, linkage, state.x, E).T


def unstable(model: Model, linkage: Linkage, state: State, force: FloatArray) -> bool:
    """Whether the equilibrium of deformable bodies is one from which they would fall, along a motion that links leave.

    force (n_dofs,) [N]: F of their stress, so that loads and links hold them by F. Turning on by w, v = w x (x - p), points have the
    acceleration w x v and the energy of what loads them the second derivative -F . (w x v): it is negative of some such motion.
    """
    positions, d = model.positions(state.x), model.dimension
    centre, size = positions.mean(axis=0), float(np.ptp(positions, axis=0).max())
    E = _motions(model, state.x, positions, centre, size)
    free = _free(model, linkage, state.x, E)
    K, motions = np.zeros((len(free), len(free))), E @ free.T
    for number in range(len(model.deformable)):
        dofs = slice(*model.dof_offset[number : number + 2])
        spin = np.einsum("kt,tij->kij", free.reshape(len(free), len(model.bodies), -1)[:, number, d:], _turns(d)) / size
        K -= np.einsum("ni,kij,njl->kl", force[dofs].reshape(-1, d), spin, motions[dofs].reshape(-1, d, len(free)))
    sizes = np.linalg.eigvalsh(0.5 * (K + K.T))
    return bool(len(sizes) and sizes[0] < -FREE * np.abs(force).sum() / size)


def _free(model: Model, linkage: Linkage, x: FloatArray, E: FloatArray) -> FloatArray:
    """The combinations (k, .) of the motions E (n_dofs, .) that supports and links leave in the configuration x (n_dofs,)."""
    holding = linkage.matrix(linkage.rows(x), x, balanced=False).tocsc()[:, np.flatnonzero(linkage.stiffness > 0)]
    held = np.array([model.driven_share(column) for column in E.T]).T
    _, values, motions = np.linalg.svd(np.concatenate([holding.T @ E, held[np.any(held, axis=1)], np.zeros((E.shape[1],) * 2)]))
    return np.asarray(motions[values < FREE * max(float(values[0]), 1e-300)])


def left(error: KinematicsLeft, model: Model, linkage: Linkage | None, scheme: Scheme, state: State) -> KinematicsLeft:
    """The error with the mechanism that there was at a state, if any: what turns without a stiffness has no better kinematics."""
    return KinematicsLeft("; ".join((str(error), *mechanisms(model, linkage, scheme, state))))


def _ends(link: object) -> list[str | None]:
    """The names of a link's bodies, None: the ground; none of a control."""
    first, second = getattr(link, "first", None), getattr(link, "second", None)
    return [end[0] if isinstance(end, tuple) else end for end in (first, second)]


def _motions(model: Model, x: FloatArray, positions: FloatArray, centre: FloatArray, size: float) -> FloatArray:
    """E (n_dofs, k nb): velocities of rigid motions of each body about one centre (d,) [m], turns by 1 / size."""
    d, first = model.dimension, len(model.deformable)
    each, turns = 3 * d - 3, _turns(d)
    E = np.zeros((model.n_dofs, each * len(model.bodies)))
    places = [(p - centre) / size for p in np.split(positions, model.node_offset[1:-1])]
    rigid = model.rigid_part(x)[:, :d]
    for number, body in enumerate(model.bodies):
        begin, end = (int(k) for k in model.dof_offset[number : number + 2])
        arm = places[number] if number < first else ((body.centre + rigid[number - first] - centre) / size)[None]  # type: ignore[union-attr]
        own = np.zeros((len(arm), d, each))
        own[:, :, :d] = np.eye(d)
        own[:, :, d:] = np.einsum("tij,aj->ait", turns, arm)
        block = own.reshape(-1, each)
        E[begin : begin + len(block), each * number : each * (number + 1)] = block
        if number >= first:
            E[begin + d : end, each * number + d : each * (number + 1)] = np.eye(each - d) / size
    return E


def _turns(d: int) -> FloatArray:
    """(3 or 1, d, d): w x for w along each axis."""
    if d == 2:
        return np.array([[[0.0, -1.0], [1.0, 0.0]]])
    spin = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        spin[i, k, j], spin[i, j, k] = 1.0, -1.0
    return spin


def _named(motion: FloatArray, centre: FloatArray, size: float, d: int) -> str:
    """A motion (k,) about the centre in words: a turn about a point or a line, or a shift."""

    def shown(vector: FloatArray) -> str:
        return "(" + ", ".join(f"{0.0 if abs(value) < 1e-9 else value:.4g}" for value in vector) + ")"

    shift, turn = motion[:d], motion[d:]
    amount = float(np.linalg.norm(turn))
    if amount < SEEN * float(np.linalg.norm(shift)):
        return f"shift along {shown(shift / np.linalg.norm(shift))}"
    if d == 2:
        about = np.array([-shift[1], shift[0]]) / turn[0]
        return f"turn about {shown(centre + size * about)} m"
    axis = turn / amount
    axis = axis * np.sign(axis[np.abs(axis).argmax()])
    about = centre + size * np.cross(turn, shift) / amount**2
    return f"turn about the line through {shown(about)} m along {shown(axis)}"
