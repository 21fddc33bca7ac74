"""The convex sets of the variational inequalities: cones, half-cylinders and disks, one a contact, with their projections."""

from __future__ import annotations

from dataclasses import dataclass

from fcsim.arrays import FloatArray
from fcsim.problem.rolling._cone_kernels import step_rolling_cone
from fcsim.solvers.variational._set_kernels import step_cone, step_cylinder, step_disk


@dataclass(frozen=True, eq=False)
class Cone:
    """K = {||r_T|| <= mu r_N}."""

    mu: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """out = P_C(r - rho F), arrays (nc, d); return ||out - r||^2."""
        return step_cone(r, F, self.mu, rho, out)


@dataclass(frozen=True, eq=False)
class RollingCone:
    """K = {||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N, |r_S| <= mu_s r_N}, vectors (nc, 5), or (nc, 6) with the spinning moment S."""

    mu: FloatArray
    mu_r: FloatArray
    mu_s: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """As `Cone.step`."""
        return step_rolling_cone(r, F, self.mu, self.mu_r, self.mu_s, rho, out)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """{r_N >= 0, ||r_T|| <= radius}; with d = 1 the half-line r_N >= 0."""

    radius: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """As `Cone.step`."""
        return step_cylinder(r, F, self.radius, rho, out)


@dataclass(frozen=True, eq=False)
class Disk:
    """{||r_T|| <= radius} for tangential vectors (nc, d - 1)."""

    radius: FloatArray

    def step(self, r: FloatArray, F: FloatArray, rho: float, out: FloatArray) -> float:
        """As `Cone.step`."""
        return step_disk(r, F, self.radius, rho, out)


ConvexSet = Cone | RollingCone | Cylinder | Disk
