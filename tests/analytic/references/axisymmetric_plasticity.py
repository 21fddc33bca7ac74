"""A program of its own for bodies of revolution: a block of perfect plasticity under a rigid sphere, small strains, no friction.

It shares nothing with fcsim: quadrilaterals (r, z) with the mean volume of their cell, von Mises by radial return, contact of nodes by an
active set, Newton's method on (displacements, forces). Source: J. C. Simo, T. J. R. Hughes, Computational inelasticity, 1998, sections 3.3
and 4.5.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tests.analytic.references.meshes import spaced

ONE = np.array([1.0, 1.0, 1.0, 0.0])
DEVIATOR = np.diag([1.0, 1.0, 1.0, 0.5]) - np.outer(ONE, ONE) / 3


class Block:
    """[0, size] x [-size, 0], n cells a direction within `fine` of the origin, 10 that grow beyond. Components rr, zz, tt, rz; a radian."""

    def __init__(self, fine: float, size: tuple[float, float], n: int, E: float, nu: float, sy: float) -> None:
        self.mu, self.K, self.sy = E / 2 / (1 + nu), E / 3 / (1 - 2 * nu), sy
        r = np.concatenate([spaced(0, fine, n), spaced(fine, size[0], 10, 1.25)[1:]])
        z = -np.concatenate([spaced(0, fine, n), spaced(fine, size[1], 10, 1.25)[1:]])[::-1]
        self.points = np.stack(np.meshgrid(r, z, indexing="ij"), axis=-1).reshape(-1, 2)
        number = np.arange(len(self.points)).reshape(len(r), len(z))
        cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
        self.top, self.held = number[:, -1], np.zeros((len(self.points), 2), dtype=bool)
        self.held[number[0], 0] = self.held[number[:, 0]] = True
        self.dofs = (2 * cells[..., None] + np.arange(2)).reshape(-1, 8)
        self.places = np.repeat(self.dofs, 8, axis=1).ravel(), np.tile(self.dofs, (1, 8)).ravel()
        self.B, self.weight = np.zeros((len(cells), 4, 4, 8)), np.zeros((len(cells), 4))
        for q, (s, t) in enumerate(np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / np.sqrt(3)):
            a, b = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
            shape, slope = 0.25 * (1 + a * s) * (1 + b * t), 0.25 * np.stack([a * (1 + b * t), b * (1 + a * s)], axis=1)
            J = np.einsum("aj,cai->cij", slope, self.points[cells])
            G = np.einsum("aj,cji->cai", slope, np.linalg.inv(J))
            radius = self.points[cells][..., 0] @ shape
            self.weight[:, q] = np.linalg.det(J) * radius
            self.B[:, q, 0, 0::2], self.B[:, q, 1, 1::2] = G[..., 0], G[..., 1]
            self.B[:, q, 2, 0::2], self.B[:, q, 3, 0::2], self.B[:, q, 3, 1::2] = shape / radius[:, None], G[..., 1], G[..., 0]
        volume = self.B[:, :, :3].sum(axis=2)
        mean = np.einsum("cq,cqk->ck", self.weight, volume) / self.weight.sum(axis=1)[:, None]
        self.B[:, :, :3] += ((mean[:, None] - volume) / 3)[:, :, None]
        self.plastic = np.zeros((len(cells), 4, 4))

    def respond(self, u: np.ndarray) -> tuple[np.ndarray, sp.csr_array, np.ndarray]:
        """Forces (n,), tangent and plastic strains at the displacements u (n,), from the plastic strains kept."""
        strain = np.einsum("cqik,ck->cqi", self.B, u[self.dofs]) * [1, 1, 1, 0.5]
        volume = strain[..., :3].sum(axis=-1, keepdims=True)
        trial = 2 * self.mu * (strain - volume / 3 * ONE - self.plastic)
        size, limit = np.sqrt(np.square(trial) @ [1, 1, 1, 2])[..., None], np.sqrt(2 / 3) * self.sy
        flows, share = size > limit, np.minimum(1.0, limit / np.maximum(size, 1e-30))
        along = trial / np.maximum(size, 1e-30)
        stress = trial * share + self.K * volume * ONE
        plastic = self.plastic + np.where(flows, (size - limit) / (2 * self.mu), 0.0) * along
        share = share[..., None]
        D = self.K * np.outer(ONE, ONE) + 2 * self.mu * share * (DEVIATOR - flows[..., None] * along[..., :, None] * along[..., None, :])
        forces = np.bincount(self.dofs.ravel(), np.einsum("cq,cqik,cqi->ck", self.weight, self.B, stress).ravel())
        tangent = np.einsum("cq,cqik,cqij,cqjl->ckl", self.weight, self.B, D, self.B, optimize=True)
        return forces, sp.csr_array((tangent.ravel(), self.places)), plastic


def pressed_by_sphere(block: Block, R: float, depths: Sequence[float], *, moved: bool) -> np.ndarray:
    """Forces [N a radian] of a sphere of radius R at the depths. moved: a node meets it where it has gone, along the sphere's normal there;
    otherwise where it was, along the axis: the linear theory."""
    u, forces = np.zeros(block.points.size), np.zeros(len(block.top))
    found: dict[float, float] = {}
    at, todo = 0.0, list(depths)[::-1]
    while todo:
        step = _step(block, R, todo[-1], u, forces, moved)
        if step is None:
            assert todo[-1] - at > 1e-4 * max(depths), "no equilibrium"
            todo.append(0.5 * (at + todo[-1]))
            continue
        (u, forces), at = step, todo.pop()
        block.plastic, found[at] = block.respond(u)[2], float(forces.sum())
    return np.array([found[depth] for depth in depths])


def _state(
    block: Block, R: float, depth: float, moved: bool, on: np.ndarray, v: np.ndarray, f: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, sp.csr_array, sp.csr_array]:
    """How far from equilibrium, the forces out of balance, the gaps, their gradient (n, k) at the nodes `on`, the tangent."""
    top, free = block.top, ~block.held.ravel()
    x = block.points[top] + v.reshape(-1, 2)[top]
    r = x[:, 0] if moved else block.points[top, 0]
    root = np.sqrt(np.maximum(R * R - r * r, 1e-6 * R * R))
    gap, slope, bend = R - depth - root - x[:, 1], moved * r / root, moved * R * R / root**3
    where = np.concatenate([2 * top[on], 2 * top[on] + 1]), np.tile(np.arange(len(on)), 2)
    G = sp.csr_array((np.concatenate([slope[on], -np.ones(len(on))]), where), shape=(len(v), len(on)))
    inner, tangent, _ = block.respond(v)
    K = tangent - sp.csr_array(((f * bend)[on], (2 * top[on], 2 * top[on])), shape=tangent.shape)
    off = (inner - G @ f[on])[free]
    worst = max(np.linalg.norm(off) / max(np.abs(f).sum(), block.sy), np.abs(gap[on]).max() / depth)
    return float(worst), off, gap, G, K


def _step(block: Block, R: float, depth: float, u: np.ndarray, forces: np.ndarray, moved: bool) -> tuple[np.ndarray, np.ndarray] | None:
    free, touching = ~block.held.ravel(), forces > 0
    touching[0] |= not touching.any()
    for _ in range(40):
        on = np.flatnonzero(touching)
        v, f = u.copy(), np.where(touching, forces, 0.0)
        for _ in range(40):
            worst, off, gap, G, K = _state(block, R, depth, moved, on, v, f)
            if worst < 1e-9 or not np.isfinite(worst):
                break
            K = K[free][:, free]
            A = sp.block_array([[K + 1e-9 * sp.diags_array(K.diagonal()), -G[free]], [G[free].T, None]], format="csc")
            d = spsolve(A, -np.concatenate([off, gap[on]]))
            best, length = (np.inf, v, f), 1.0
            while length > 0.02 and best[0] > worst * (1 - 0.1 * length):
                w, g = v.copy(), f.copy()
                w[free] += length * d[: len(off)]
                g[on] += length * d[len(off) :]
                best, length = min(best, (_state(block, R, depth, moved, on, w, g)[0], w, g), key=lambda one: one[0]), 0.5 * length
            _, v, f = best
        if not worst < 1e-9:
            return None
        kept = np.where(touching, f >= 0, gap < -1e-10 * R)
        if np.array_equal(kept, touching):
            return v, f
        touching = kept
    return None
