"""Bodies whose supports leave them a rigid motion, and the mass regularisation that statics with eta > 0 give them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

from fcsim.assembly.model import Model
from fcsim.assembly.shares.group_factor import FAINT


def floating(model: Model) -> Iterator[int]:
    """Numbers of the bodies that supports leave a rigid motion: their stiffness alone is singular."""
    d = model.dimension
    driven = np.zeros(model.n_dofs, dtype=bool)
    driven[model.driven_dofs] = True
    for number, body in enumerate(model.bodies):
        own = driven[model.dof_offset[number] : model.dof_offset[number + 1]]
        if number >= len(model.deformable):
            if not own.all():
                yield number
            continue
        x = body.points
        centred = x - x.mean(axis=0)
        modes = [np.tile(np.eye(d)[k], (len(x), 1)) for k in range(d)]
        planes = [(0, 1)] if d == 2 else [(0, 1), (1, 2), (0, 2)]
        for i, j in planes:
            mode = np.zeros_like(x)
            mode[:, i], mode[:, j] = -centred[:, j], centred[:, i]
            modes.append(mode / (np.abs(centred).max() or 1.0))
        begin, end = (int(k) for k in model.dof_offset[number : number + 2])
        axes = None if model.held.axes is None else model.held.axes.blocks(begin, end, d)
        along = modes if axes is None else [np.einsum("aij,aj->ai", axes, mode) for mode in modes]
        held = np.array([mode.ravel()[own] for mode in along])
        if not own.any() or np.linalg.matrix_rank(held, tol=1e-8) < len(modes):
            yield number


def proposed_eta(model: Model, number: int, h: float) -> float | None:
    """The eta with which eta / h^2 M is `FAINT` of the stiffness of a deformable body, by the sums of both diagonals; None for a rigid
    body, one without mass, or one that ranks have together."""
    for group in model.groups:
        if number in group.members and isinstance(group.K, sp.csr_array) and isinstance(group.M, sp.csr_array):
            mass, stiffness = float(group.M.diagonal().sum()), float(group.K.diagonal().sum())
            return FAINT * h**2 * stiffness / mass if mass > 0 and stiffness > 0 else None
    return None


def stretching_quotient(model: Model, number: int) -> float | None:
    """[1/s^2] The least u . K u / u . M u of stretches u = x_i e_i - x_j e_j of a deformable body about its middle, which keep its volume:
    4 G / (rho (<x_i^2> + <x_j^2>)), whatever the cells; None of one that ranks have together or without mass.

    Dead loads that press with p take p / (rho (<x_i^2> + <x_j^2>)) of eta / h^2 from turns of the body, p / (4 G) of the quotient.
    """
    for group in model.groups:
        if number in group.members and isinstance(group.K, sp.csr_array) and isinstance(group.M, sp.csr_array):
            x = model.bodies[number].points
            x, quotients = x - x.mean(axis=0), []
            for i, j in itertools.combinations(range(model.dimension), 2):
                mode = np.zeros_like(x)
                mode[:, i], mode[:, j] = x[:, i], -x[:, j]
                u = mode.ravel()
                stiffness, mass = float(u @ (group.K @ u)), float(u @ (group.M @ u))
                quotients += [stiffness / mass] if mass > 0 and stiffness > 0 else []
            return min(quotients, default=None)
    return None


def nodal_stiffness(model: Model, number: int) -> float | None:
    """[N/m] The mean of the diagonal of a deformable body's stiffness; None of one that ranks have together."""
    for group in model.groups:
        if number in group.members and isinstance(group.K, sp.csr_array):
            return float(group.K.diagonal().mean())
    return None
