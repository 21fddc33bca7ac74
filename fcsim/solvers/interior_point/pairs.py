"""Coulomb's law as complementarity over half-lines and second-order cones, smooth in all unknowns: each contact has two pairs,

    r_N >= 0, u_N >= 0, r_N u_N = 0            and            x = (mu r_N, r_T), y = (s, u_T) in the cone, x o y = 0,

s a velocity of its own. The second pair is the principle of largest dissipation: s = ||u_T||, and r_T against u_T at the cone's surface
where it slides; s = 0 where it sticks. A contact with mu = 0 has the first pair alone, and r_T = 0. Where the products are tau e instead
of zero this is the central path; there r_N u_N = tau, x = tau y^-1.

Sources: Stewart, Trinkle, Int. J. Numer. Methods Eng. 39, 1996 (s, for cones with facets); Howell et al., "Dojo: a differentiable physics
engine for robotics", arXiv:2203.00806, 2022 (the two pairs); Chen, Ly, Wojtan, "Primal-dual non-smooth friction for rigid body animation",
SIGGRAPH 2024 (interior point on largest dissipation). The start is Chen, Harker, Kanzow and Smale's smoothing of each pair (Fukushima,
Luo, Tseng, SIAM J. Optim. 12, 2002).
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray

HALVINGS = 60
"""Of the interval in which ||x_T|| of a contact on the central path lies."""


class ContactPairs:
    """The pairs of nc contacts: the half-lines' numbers (nc,) first, then the cones' (k, d) of the k contacts with mu > 0."""

    def __init__(self, mu: FloatArray, dimension: int) -> None:
        self.mu, self._d = mu, dimension
        self.rough = np.flatnonzero(mu > 0)
        self.half_lines, self.cones, self.cone_size = len(mu), len(self.rough), dimension

    def weights(self, lines: FloatArray, cones: FloatArray) -> FloatArray:
        """One number a contact as a multiple of the identity of each of its pairs: lines and cones (nc,)."""
        of_cones = np.zeros((self.cones, self._d))
        of_cones[:, 0] = cones[self.rough]
        return np.concatenate([lines, of_cones.ravel()])

    def reactions(self, r: FloatArray) -> FloatArray:
        """r_N and (mu r_N, r_T) of r (nc, d), which is linear in r."""
        cones = r[self.rough].copy()
        cones[:, 0] *= self.mu[self.rough]
        return np.concatenate([r[:, 0], cones.ravel()])

    def velocities(self, u: FloatArray, s: FloatArray) -> FloatArray:
        """u_N and (s, u_T) of u (nc, d) and s (k,)."""
        cones = u[self.rough].copy()
        cones[:, 0] = s
        return np.concatenate([u[:, 0], cones.ravel()])

    def contact_velocity(self, y: FloatArray) -> FloatArray:
        """u (nc, d) of the velocities' side, or what stands for it; zero tangentially where mu = 0."""
        nc = self.half_lines
        u = np.zeros((nc, self._d))
        u[self.rough, 1:] = y[nc:].reshape(self.cones, self._d)[:, 1:]
        u[:, 0] = y[:nc]
        return u

    def contact_reaction(self, x: FloatArray) -> FloatArray:
        """r (nc, d) of the reactions' side."""
        return self.contact_velocity(x)

    def centred(self, r: FloatArray, u: FloatArray, tau: FloatArray, compliance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both sides x, y with products tau e, tau and compliance (nc,), near r and u (nc, d) of any kind.

        z = r - u / compliance keeps its normal part, and its tangential one: r_N u_N = tau with z_N kept is a quadratic equation, and
        x o y = tau e with x_0 = mu r_N and z_T kept is one for ||x_T|| that rises: rho (1 + tau / (c (x_0^2 - rho^2))) = ||z_T||.
        """
        c, rough = compliance, self.rough
        new_r, new_u = np.zeros_like(r), np.zeros_like(u)
        z = r - u / c[:, None]
        root = np.sqrt(z[:, 0] ** 2 + 4 * tau / c)
        larger = 0.5 * (np.abs(z[:, 0]) + root)
        smaller = tau / (c * larger)  # nothing cancels
        new_r[:, 0], new_u[:, 0] = np.where(z[:, 0] > 0, larger, smaller), c * np.where(z[:, 0] > 0, smaller, larger)
        x_0, z_T = self.mu[rough] * new_r[rough, 0], z[rough, 1:]
        length = np.sqrt(np.einsum("ai,ai->a", z_T, z_T))
        own = tau[rough] / c[rough]
        low, high = np.zeros_like(x_0), np.ones_like(x_0)  # 1 - rho / x_0, whose small values count
        for _ in range(HALVINGS):
            gap = 0.5 * (low + high)
            rho = x_0 * (1 - gap)
            over = rho * (1 + own / (x_0**2 * gap * (2 - gap))) > length
            low, high = np.where(over, gap, low), np.where(over, high, gap)
        gap = high
        share = np.where(length > 0, x_0 * (1 - gap) / np.where(length > 0, length, 1), 0.0)
        new_r[rough, 1:] = share[:, None] * z_T
        with np.errstate(divide="ignore"):  # of W x 1e300 x_0^2 is none
            y = (tau[rough] / (x_0**2 * gap * (2 - gap)))[:, None] * np.column_stack([x_0, -new_r[rough, 1:]])
        new_u[rough, 1:] = y[:, 1:]
        return self.reactions(new_r), self.velocities(new_u, y[:, 0])
