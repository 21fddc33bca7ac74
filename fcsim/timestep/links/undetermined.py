"""Forces of links that equilibrium leaves open: more links than hold the bodies, as the fourth leg of a table."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.linkage import Ball, Hinge, Linkage, Rod, Slider
from fcsim.linkage.stiffness import link_stiffness
from fcsim.timestep.links.mechanisms import FREE, MOST, SEEN, free_motions
from fcsim.timestep.state import State

NAMED = 4
"""Links that are named at most."""
ROWS = 1000
"""Rows of links from which on it is not asked: their eigenvalues are computed."""


def undetermined_forces(model: Model, linkage: Linkage, state: State) -> Iterator[str]:
    """A remark on balls, hinges, sliders and rods whose forces G l may be changed by some l with G l = 0 on what supports leave free.

    Left out are l of a place that the bodies leave: rods in one line, which any lateral load brings out of it. There the second-order work
    m^T B(l) m of the motions m that the links leave, G^T m = 0, is not zero, B(l) the geometric stiffness; where a link is one too many
    it is, since its row follows from the others' all along the motion (S. Pellegrino, C. R. Calladine, Int. J. Solids Struct. 22, 1986).
    """
    of_joints = [k for k, link in enumerate(linkage.links) if isinstance(link, Ball | Hinge | Slider | Rod)]
    own = np.flatnonzero(np.isin(linkage.of_row, of_joints))
    d = model.dimension
    if not 0 < len(own) <= ROWS or model.n_dofs * max(len(model.bodies) * (3 * d - 3), len(own)) > MOST:
        return
    rows = linkage.rows(state.x)
    G = linkage.matrix(rows, state.x, balanced=False).tocsc()[:, own]
    size = float(np.ptp(model.positions(state.x), axis=0).max())
    free = np.array([column - model.driven_share(column) for column in G.T.toarray()])
    for column in free:
        model.rigid_part(column)[:, d:] /= size
    values, vectors = np.linalg.eigh(free @ free.T)
    idle = np.zeros((linkage.n_rows, int(np.sum(values < FREE**2 * max(float(values[-1]), 1e-300)))))
    idle[own] = vectors[:, : idle.shape[1]]
    if not idle.shape[1]:
        return
    motions = free_motions(model, linkage, state)
    lifted = []
    for l in idle.T:
        B = link_stiffness(linkage, rows, l, state.x)
        lifted.append(np.zeros(motions.shape[1] ** 2) if B is None else (motions.T @ (B @ motions)).ravel())
    work, axes = np.linalg.eigh(np.array(lifted) @ np.array(lifted).T)
    idle = idle @ axes[:, work * size**2 < SEEN**2]
    forces = np.array([[linkage.force(linkage.links[k].name, rows, l) for l in idle.T] for k in of_joints]).reshape(len(of_joints), -1, d)
    open_ones = np.flatnonzero(np.abs(forces).max(axis=(1, 2), initial=0.0) > SEEN)
    if not open_ones.size:
        return
    names = [repr(linkage.links[of_joints[k]].name) for k in open_ones]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    yield (
        f"links {', '.join(names[:NAMED])}{more} hold bodies more often than it takes: what each of them bears"
        f"{_along(forces[open_ones].reshape(-1, d))} is not determined by equilibrium, only what they give a body together. Where shares "
        "count, give the bodies their stiffness, or the links one (SpringDamper)"
    )


def _along(forces: FloatArray) -> str:
    """The direction of all forces (k, d) in words, where they have one."""
    _, sizes, axes = np.linalg.svd(forces, full_matrices=False)
    if len(sizes) > 1 and sizes[1] > SEEN * sizes[0]:
        return ""
    axis = axes[0] * np.sign(axes[0][np.abs(axes[0]).argmax()])
    return f" along ({', '.join(f'{0.0 if abs(value) < SEEN else value:.4g}' for value in axis)})"
