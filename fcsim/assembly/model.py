"""Bodies, supports and loads together: the degrees of freedom of a simulation and the operators on them.

The numbering is that of `layout`. Nothing here is one big matrix unless asked for: mass and stiffness act body by
body through the operators of the parts, which are assembled once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fcsim.arrays import BoolArray, FloatArray, IntArray, is_number, numbers_of
from fcsim.assembly.groups import Group, operator_groups
from fcsim.assembly.inner_forces import NonlinearBodies
from fcsim.assembly.kinematics.elastic_forces import ElasticForces
from fcsim.assembly.kinematics.following import FollowingLoads, When, following_loads
from fcsim.assembly.layout import DIRECTIONS, BodyLayout, in_order
from fcsim.assembly.loads import Follower, Load, factor_at, load_vector, turned, weight
from fcsim.assembly.rigid import RigidBodies, inverse_on, turned_matrices
from fcsim.assembly.shares.shares import Shares, shares_of
from fcsim.assembly.supports import DrivenRotation, HeldDofs, Support, held_dofs
from fcsim.assembly.time_functions import gravity_of
from fcsim.brief import brief, by_fields, shown
from fcsim.errors import InputError, asked
from fcsim.linear.over_ranks.rows import whole
from fcsim.linear.sparse._vectors_kernels import put_lumped
from fcsim.linear.sparse.each import times_each
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.mesh.part import Kinematics, Placed, refuse_kinematics


@dataclass(frozen=True, eq=False)
class Model(BodyLayout):
    """Bodies, supports, loads; see `build_model`, which checks them. What is where stands in `BodyLayout`.

    alpha [1/s], beta [s]: Rayleigh damping C = alpha M + beta K; gravity(t) -> (d,) [m/s^2]
    driven: "eliminated" removes driven dofs from the problems' unknowns, "identity" keeps them as rows of the identity
    kinematics: of the deformable bodies that do not name theirs; None: "turning" for those whose supports leave them a rotation,
    "linear" for the others and in quasi-statics
    """

    supports: tuple[Support | DrivenRotation, ...]
    loads: tuple[Load, ...]
    gravity: Callable[[float], ArrayLike] | None
    lumped: bool
    alpha: float
    beta: float
    driven: Literal["eliminated", "identity"]
    kinematics: Kinematics | None = None

    __repr__, __reduce__ = brief, by_fields

    @cached_property
    def held(self) -> HeldDofs:
        """What the supports hold and drive."""
        return held_dofs(self, self.supports)

    @property
    def driven_dofs(self) -> IntArray:
        """Ascending numbers of the driven dofs. They count components along the supports' axes, as do `free_dofs` and the problems'
        unknowns, see `along`; everything else is in the world's axes."""
        return self.held.dofs

    @cached_property
    def free_dofs(self) -> IntArray:
        return np.setdiff1d(np.arange(self.n_dofs), self.driven_dofs)

    @cached_property
    def place_of_unknowns(self) -> tuple[IntArray, int]:
        """Which of the problems' unknowns of the bodies each dof is (n_dofs,), -1: driven, and how many they are."""
        place, without = np.full(self.n_dofs, -1), self.driven == "eliminated"
        place[self.free_dofs] = np.arange(len(self.free_dofs)) if without else self.free_dofs
        return place, len(self.free_dofs) if without else self.n_dofs

    def driven_velocity(self, t: float, h: float = 1e-3) -> FloatArray:
        """Velocity (n_driven,) [m/s, rad/s] that the supports prescribe at time t; h [s]: the step, see `DrivenRotation`."""
        return self.held.velocity(t, h)

    def along(self, x: FloatArray) -> FloatArray:
        """Components (n_dofs,) along the supports' axes of x (n_dofs,) in world axes; x itself where all axes are the world's."""
        return x if self.held.axes is None else self.held.axes.along(x)

    def world(self, x: FloatArray) -> FloatArray:
        """The vector (n_dofs,) in world axes of components x (n_dofs,) along the supports' axes."""
        return x if self.held.axes is None else self.held.axes.world(x)

    @cached_property
    def axes_matrix(self) -> sp.csr_array | None:
        """T (n_dofs, n_dofs), `along` = T x; None where all axes are the world's."""
        return None if self.held.axes is None else self.held.axes.matrix(0, self.n_dofs)

    def of_driven(self, values: FloatArray) -> FloatArray:
        """The vector (n_dofs,) in world axes whose driven components are `values` (n_driven,), the others zero."""
        x = np.zeros(self.n_dofs)
        x[self.driven_dofs] = values
        return self.world(x)

    def driven_share(self, x: FloatArray) -> FloatArray:
        """The driven components of x (n_dofs,), both in world axes; x less this is what is free."""
        return self.of_driven(self.along(x)[self.driven_dofs])

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        return operator_groups(self, self.held, self.lumped, self.kinematics)

    @cached_property
    def elastic(self) -> ElasticForces:
        """The elastic forces of the deformable bodies of linear materials."""
        return ElasticForces(self.groups, len(self.deformable), self.dimension, self.beta)

    @cached_property
    def nonlinear(self) -> NonlinearBodies:
        """The inner forces of the others."""
        return NonlinearBodies(self.groups, self.beta, self)

    @property
    def shares(self) -> Shares | None:
        """Whose body is whose among the ranks that share what is computed now; None where this process computes alone."""
        return shares_of(self)

    @cached_property
    def following(self) -> FollowingLoads:
        """The pressures and forces that follow deformable bodies; those on bodies of linear kinematics do not."""
        soft = [load for load in self.loads if isinstance(load, Follower) and not self._on_rigid(load)]
        return following_loads(self, self.groups if soft else (), soft)

    def _on_rigid(self, load: Load) -> bool:
        return self.body_number(load.body) >= len(self.deformable)

    def moving(self, kinematics: Kinematics | None) -> Model:
        """Return the model with that kinematics where none is named; the model itself where that changes nothing."""
        return self if kinematics is None or self.kinematics is not None else replace(self, kinematics=kinematics)

    @cached_property
    def rigid_bodies(self) -> RigidBodies:
        """The rigid bodies' arrays and finite rotations."""
        return RigidBodies(self.rigid, self.dimension)

    @cached_property
    def rigid_free(self) -> BoolArray:
        """(nr, k): the dofs of rigid bodies that no support drives, along the supports' axes."""
        free = np.ones(self.n_dofs, dtype=bool)
        free[self.driven_dofs] = False
        return self.rigid_part(free)

    @cached_property
    def rigid_axes(self) -> FloatArray | None:
        """(nr, k, k): the supports' axes of rigid bodies as rows; None where all are the world's."""
        return None if self.held.axes is None else self.held.axes.blocks(self.n_elastic, self.n_dofs, len(DIRECTIONS[self.dimension]))

    @cached_property
    def _may_turn(self) -> bool:
        """Whether a rotation of some rigid body is free."""
        return bool(self.rigid_free[:, self.dimension :].any())

    def rigid_inverse(self, matrices: FloatArray) -> FloatArray:
        """Inverses (nr, k, k) on the free dofs of rigid bodies' matrices in world axes, along the supports' axes; zero elsewhere."""
        return inverse_on(self.rigid_free, turned_matrices(self.rigid_axes, matrices))

    def rigid_mass(self, x: FloatArray | None = None) -> FloatArray:
        """Mass matrices (nr, k, k) of the rigid bodies, diag(m I, R J R^T), in the configuration x (default: the reference).

        One and the same read-only array for all x where it does not depend on x: in 2D, and where all inertias are isotropic.
        """
        return self.rigid_bodies.reference_mass if x is None else self.rigid_bodies.mass(self.rigid_part(x))

    def apply_stiffness(self, x: FloatArray) -> FloatArray:
        """Return K x (n_dofs,) [N], K of the reference configuration (of nonlinear materials their tangent there)."""
        return self.elastic.stiffness_times(x)

    def apply_mass(self, v: FloatArray, rigid_mass: FloatArray | None = None) -> FloatArray:
        """Return M v (n_dofs,) [N s]; rigid_mass (nr, k, k): that of the configuration, see `rigid_mass` (default: the reference)."""
        y = np.empty_like(v)
        for group in self.groups:
            if group.lumped is not None:
                put_lumped(group.first, group.lumped, v, y)
            else:
                group.put(y, times_each(group.M, group.rows(v)))
        rigid_mass = self.rigid_mass() if rigid_mass is None else rigid_mass
        y[self.n_elastic :] = np.einsum("aij,aj->ai", rigid_mass, self.rigid_part(v)).ravel()
        return y

    def matrix(self, mass: float, stiffness: float) -> sp.csr_array:
        """Return mass M + stiffness K as one csr_array (n_dofs, n_dofs), M in the reference configuration."""
        count = len(self.deformable)
        blocks: list[sp.csr_array | None] = [None] * (count + len(self.rigid))
        for group in self.groups:
            block = mass * whole(group.M) + stiffness * whole(group.K)
            for first in group.first:
                blocks[int(np.searchsorted(self.dof_offset, first))] = block
        for k, rigid in enumerate(self.rigid_mass()):
            blocks[count + k] = sp.csr_array(mass * rigid)
        return sp.block_diag(blocks, format="csr")

    @property
    def mass(self) -> sp.csr_array:
        """M (n_dofs, n_dofs) [kg] in the reference configuration."""
        return self.matrix(1.0, 0.0)

    @property
    def stiffness(self) -> sp.csr_array:
        """K (n_dofs, n_dofs) [N/m]."""
        return self.matrix(0.0, 1.0)

    @property
    def damping(self) -> sp.csr_array:
        """C = alpha M + beta K (n_dofs, n_dofs) [N s/m]."""
        return self.matrix(self.alpha, self.beta)

    @cached_property
    def weight_of_units(self) -> FloatArray:
        """M e (d, n_dofs) [kg] of the accelerations 1 along each axis: four loads a step ask for gravity."""
        along = np.zeros((self.dimension, self.n_dofs))
        for i, acceleration in enumerate(along):
            acceleration[: self.n_elastic].reshape(-1, self.dimension)[:, i] = 1.0
            self.rigid_part(acceleration)[:, i] = 1.0
        return np.stack([self.apply_mass(acceleration) for acceleration in along])

    @cached_property
    def body_mass(self) -> FloatArray:
        """(nbodies,) [kg]."""
        return np.asarray(np.add.reduceat(self.weight_of_units[0], self.dof_offset[:-1]), dtype=np.float64)

    @cached_property
    def _load_vectors(self) -> tuple[FloatArray, ...]:
        return tuple(load_vector(self, load) for load in self.loads)

    def gravity_at(self, t: float) -> FloatArray:
        """The acceleration (d,) [m/s^2] at time t, 0 without gravity; InputError where its function gives none."""
        d = self.dimension
        if self.gravity is None:
            return np.zeros(d)
        given = asked(f"gravity at t = {t} s: expected a function of t alone, lambda t: (0.0, 0.0, -9.81)", self.gravity, t)
        g = numbers_of(given)
        if g.shape != (d,) or not np.all(np.isfinite(g)):
            raise InputError(f"gravity at t = {t} s: expected an acceleration of {d} finite numbers [m/s^2], got {shown(given)}")
        return g

    def load(self, t: float, x: FloatArray | None = None) -> FloatArray:
        """External forces (n_dofs,) [N] at time t: gravity and the loads; followers of rigid bodies as they stand at x (default: the
        reference). Without what follows deformable bodies, which is part of what a step solves for: see `following`."""
        force = np.zeros(self.n_dofs) if self.gravity is None else weight(self.weight_of_units, self.gravity_at(t))
        for load, vector in zip(self.loads, self._load_vectors, strict=True):
            if any(load is other for other in self.following.loads):
                continue
            if isinstance(load, Follower) and x is not None and self._on_rigid(load):
                vector = turned(self, load, vector, self.rigid_rotation(x))
            force += factor_at(load, t) * vector
        return force

    def rigid_rotation(self, x: FloatArray) -> FloatArray:
        """Rotation matrices (nr, d, d) of the rigid bodies in the configuration x."""
        return self.rigid_bodies.rotation(self.rigid_part(x))

    def positions(self, x: FloatArray) -> FloatArray:
        """Nodes (n_nodes, d) [m] in the configuration x (n_dofs,)."""
        moved = self.node_displacement(x)
        return np.add(self.reference, moved, out=moved)

    def node_displacement(self, x: FloatArray) -> FloatArray:
        """Displacement (n_nodes, d) [m] of all nodes, those of rigid bodies included."""
        d = self.dimension
        displacement, count = np.empty((self.n_nodes, d)), self.n_elastic // d
        displacement[:count] = x[: self.n_elastic].reshape(-1, d)
        displacement[count:] = self.rigid_bodies.displacement(self.rigid_part(x))
        return displacement

    def strained_displacement(self, x: FloatArray) -> FloatArray:
        """Displacement (n_nodes, d) [m] that strains: of turning bodies without their rotation, in the axes of the reference; of others
        as `node_displacement`."""
        displacement = self.node_displacement(x)
        displacement.ravel()[: self.n_elastic] = self.elastic.strained(self.elastic.at(x))
        return displacement

    def node_velocity(self, v: FloatArray, x: FloatArray | None = None) -> FloatArray:
        """Velocity (n_nodes, d) [m/s] of all nodes for v (n_dofs,), in the configuration x (default: the reference)."""
        rigid = self.rigid_part(np.zeros(self.n_dofs) if x is None else x)
        return np.concatenate([v[: self.n_elastic].reshape(-1, self.dimension), self.rigid_bodies.velocity(rigid, self.rigid_part(v))])

    def advance(self, x: FloatArray, dx: FloatArray) -> FloatArray:
        """Return the configuration x moved by the increment dx; rotations are composed, exp(dx) exp(x), not added."""
        moved = x + dx
        self.rigid_part(moved)[:] = self.rigid_bodies.advance(self.rigid_part(x), self.rigid_part(dx))
        return moved

    def keep_momentum(self, v: FloatArray, rigid_mass: FloatArray, x: FloatArray) -> FloatArray:
        """Return v (n_dofs,) with the angular velocities that have the same angular momentum in the configuration x as in another one.

        rigid_mass (nr, k, k): that of the other configuration. Driven rotations stay as they are.
        """
        if not self._may_turn or (now := self.rigid_mass(x)) is rigid_mass:
            return v
        d, axes = self.dimension, None if self.rigid_axes is None else self.rigid_axes[:, self.dimension :, self.dimension :]
        change = np.einsum("aij,aj->ai", (rigid_mass - now)[:, d:, d:], self.rigid_part(v)[:, d:])
        inverse = inverse_on(self.rigid_free[:, d:], turned_matrices(axes, now[:, d:, d:]))
        kept = v.copy()
        back = None if axes is None else axes.transpose(0, 2, 1)
        self.rigid_part(kept)[:, d:] += np.einsum("aij,aj->ai", turned_matrices(back, inverse), change)
        return kept

    def contact_matrix(self, nodal: sp.sparray, x: FloatArray) -> sp.csc_array:
        """Return H (n_dofs, m) from the nodal contact matrix (d n_nodes, m) in the configuration x: B^T times it, where node velocities are
        B v: those of deformable bodies, v + omega x (p - c) on rigid ones."""
        if not self.rigid:
            return with_short_indices(sp.csc_array(nodal))
        return self.rigid_bodies.on_bodies(self.rigid_part(x), with_short_indices(sp.csc_array(nodal)), self.n_elastic)


def build_model(
    bodies: Sequence[Placed],
    *,
    supports: Sequence[Support | DrivenRotation] = (),
    loads: Sequence[Load] = (),
    gravity: ArrayLike | Callable[[float], ArrayLike] | None = None,
    lumped: bool = True,
    alpha: float = 0.0,
    beta: float = 0.0,
    driven: Literal["eliminated", "identity"] = "eliminated",
    kinematics: Kinematics | None = None,
) -> Model:
    """Return the model of the bodies, checked: names, surfaces, directions, contradictory supports.

    gravity: acceleration (d,) [m/s^2], or a function of t giving it; alpha [1/s], beta [s]: Rayleigh damping; lumped or consistent mass.
    kinematics: "turning" (small strain in frames that turn with the bodies) or "linear" (small rotation too) for the deformable bodies that
    do not name theirs; None: in dynamics "turning" for those whose supports leave them a rotation, "linear" for the others and in
    quasi-statics.
    """
    refuse_kinematics(kinematics, "kinematics")
    ordered = in_order(bodies)
    if not isinstance(lumped, bool | np.bool_):
        raise InputError(f"lumped: expected True or False, got {shown(lumped)}")
    if driven not in ("eliminated", "identity"):
        raise InputError(f"driven: expected 'eliminated' or 'identity', got {driven!r}")
    if not (is_number(alpha) and is_number(beta) and alpha >= 0 and beta >= 0):
        raise InputError(f"Rayleigh damping: expected alpha >= 0 and beta >= 0, got {shown(alpha)} and {shown(beta)}")
    for name, several in (("supports", supports), ("loads", loads)):
        if not isinstance(several, Iterable):
            raise InputError(f"{name}: expected several, in a list, got {type(several).__name__}: write [{type(several).__name__}(...)]")
    model = Model(ordered, tuple(supports), tuple(loads), gravity_of(gravity), lumped, alpha, beta, driven, kinematics)
    model.load(0.0)  # these refuse what loads and supports get wrong before the run starts
    model.following.force(np.zeros(model.n_dofs), When.at(0.0))
    model.driven_velocity(0.0)
    return model
