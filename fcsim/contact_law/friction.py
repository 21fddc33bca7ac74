"""Friction coefficients that are not one number: functions of slip, sliding velocity, place and time; and the elliptic cone.

A coefficient is taken at the beginning of a step, from what has been slid until then: explicit, with an error of the order of h. In
quasi-statics the velocity is that of the last load step, the way slid in it over its h.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, is_number, numbers_of
from fcsim.brief import shown
from fcsim.contact_law.law import Meeting, Outcome
from fcsim.errors import InputError, asked


@dataclass(frozen=True, eq=False)
class Sliding:
    """What a friction coefficient may depend on, contact by contact.

    slip (nc,) [m] the distance slid under pressure so far; velocity (nc,) [m/s] ||u_T||; point (nc, d) [m]; t [s]; mu (nc,) of the pair;
    rest (nc,) [m/s] at most so much is rest: `REST` of the smaller body's size in a step
    """

    slip: FloatArray
    velocity: FloatArray
    point: FloatArray
    t: float
    mu: FloatArray
    rest: FloatArray


REST = 1e-9
"""Share of a body's size that solvers leave of what sticks in a step, and more: their tolerance of what bodies move, 1e-8, is so much where
they move by a tenth of their size in a step."""

SEAT = "seat"
"""The variable of contacts that bear, see `seats`."""
BESIDE = 0.25
"""Of the smaller body's size: how far from one that bore a contact may be new and slide on as that does."""

Friction = Callable[[Sliding], FloatArray]
"""mu (nc,) from what it depends on: one of the classes below, or a function of one's own (a lookup of temperature, a field)."""


@dataclass(frozen=True)
class SlipWeakening:
    """mu = max(dynamic, static - (static - dynamic) slip / distance): linear slip weakening, that of fault mechanics.

    distance [m]. Source: Y. Ida, Cohesive force across the tip of a longitudinal-shear crack, J. Geophys. Res. 77, 1972.
    """

    static: float
    dynamic: float
    distance: float

    def __post_init__(self) -> None:
        _coefficients(self, "static", "dynamic")
        _positive(self, "distance")

    def __call__(self, sliding: Sliding) -> FloatArray:
        return self.static + (self.dynamic - self.static) * np.minimum(sliding.slip / self.distance, 1.0)


@dataclass(frozen=True)
class RateDependent:
    """mu = dynamic + (static - dynamic) / (1 + ||u_T|| / velocity): weakening (or, static < dynamic, strengthening) with the rate.

    velocity [m/s]: where half of the difference is gone.
    """

    static: float
    dynamic: float
    velocity: float

    def __post_init__(self) -> None:
        _coefficients(self, "static", "dynamic")
        _positive(self, "velocity")

    def __call__(self, sliding: Sliding) -> FloatArray:
        return self.dynamic + (self.static - self.dynamic) / (1 + sliding.velocity / self.velocity)


@dataclass(frozen=True)
class StaticKinetic:
    """mu = static where ||u_T|| <= at_rest [m/s], kinetic where it slides faster: the textbook's two coefficients.

    at_rest None: 1e-9 of the smaller body's size in a step, which is the same motion in all units
    """

    static: float
    kinetic: float
    at_rest: float | None = None

    def __post_init__(self) -> None:
        _coefficients(self, "static", "kinetic")
        if self.at_rest is not None:
            _positive(self, "at_rest")

    def __call__(self, sliding: Sliding) -> FloatArray:
        return np.where(sliding.velocity > (sliding.rest if self.at_rest is None else self.at_rest), self.kinetic, self.static)


@dataclass(frozen=True)
class Elliptic:
    """Orthotropic friction (r_1 / mu_1)^2 + (r_2 / mu_2)^2 <= r_N^2, 3D, with the slip that dissipates most (associated).

    direction: in which mu_1 > 0 holds, in the world axes, projected on the tangent plane; mu_2 > 0 holds across. With S =
    diag(1, 1, mu_2 / mu_1), r = S r' and u' = S u it is Coulomb's cone of mu_1, so the problem is solved and written as such.
    Source: A. Zmitrowicz, Mathematical descriptions of anisotropic friction, Int. J. Solids Struct. 25, 1989.
    """

    mu_1: float
    mu_2: float
    direction: tuple[float, float, float]

    def __post_init__(self) -> None:
        _positive(self, "mu_1")
        _positive(self, "mu_2")
        direction = numbers_of(self.direction)
        if direction.shape != (3,) or not np.isfinite(direction).all() or not np.any(direction):
            raise InputError(f"Elliptic, direction: expected three numbers, not all zero, got {shown(self.direction)}")


class FrictionTerms(NamedTuple):
    """mu (nc,), and the scale (nc, d) and frame (nc, d, d) of `Terms`."""

    mu: FloatArray
    scale: FloatArray | None = None
    frame: FloatArray | None = None


LARGEST = 1e6
"""Coefficient of friction. In the problem mu ||u_T|| stands beside u_N: with 1e6 the round-off of u_T, 1e-16, is a hundredth of the
tolerance of 1e-8, with 1e8 as large (dynamics of a block met it, statics did not), with 1e10 all solvers stagnate, at 6e-7 and above."""


def refuse_endless(mu: FloatArray) -> None:
    """InputError for coefficients beyond `LARGEST`."""
    most = float(np.max(mu, initial=0.0))
    if most > LARGEST:
        raise InputError(
            f"mu: expected coefficients of friction up to {LARGEST:g}, got {most:g}, beyond which round-off hides what slides: what never "
            "slides sticks at 100 as well, what is not to part either is a link (Tied, Bonded)"
        )


def friction_terms(friction: Friction | Elliptic | None, meeting: Meeting) -> FrictionTerms:
    """Return what a law's friction gives; None is the pairs' own coefficient."""
    contacts = meeting.contacts
    if friction is None:
        return FrictionTerms(contacts.mu)
    if isinstance(friction, Elliptic):
        return _elliptic(friction, meeting)
    if not callable(friction):
        raise InputError(
            f"friction: expected a function of what slides, or None for the pairs' own coefficients (mu), got {friction!r:.60}"
        )
    if meeting.timing.moving:
        velocity = np.sqrt(np.einsum("ai,ai->a", meeting.before[:, 1:], meeting.before[:, 1:]))
    else:
        velocity = as_beside(meeting, "rate")
    rest = REST * meeting.size / meeting.timing.h
    sliding = Sliding(as_beside(meeting, "slip"), velocity, contacts.point, meeting.t, contacts.mu, rest)
    mu = numbers_of(asked(f"friction {friction!r:.60} at t = {meeting.t} s", friction, sliding))
    if mu.shape != contacts.mu.shape or not np.all(np.isfinite(mu) & (mu >= 0)):
        raise InputError(f"friction {friction!r}: expected {len(contacts)} finite coefficients >= 0, got {mu.shape}, {mu.ravel()[:5]} ...")
    return FrictionTerms(mu)


def way_slid(meeting: Meeting, outcome: Outcome) -> FloatArray:
    """The distance (nc,) [m] slid under pressure in the step, by the mean velocity theta u+ + (1 - theta) u^-."""
    theta = meeting.timing.theta
    mean = theta * outcome.after[:, 1:] + (1 - theta) * meeting.before[:, 1:]
    way = meeting.timing.length_per_u * np.sqrt(np.einsum("ai,ai->a", mean, mean))
    return np.where(outcome.r[:, 0] > 0, way, 0.0)


def seats(meeting: Meeting, outcome: Outcome) -> FloatArray:
    """Where contacts bear (nc, 2 + d): both bodies' numbers, ascending, and the point [m]; nan of those that do not."""
    contacts = meeting.contacts
    seat = np.column_stack([np.sort(contacts.bodies, axis=1), contacts.point])
    return np.where(outcome.r[:, :1] > 0, seat, np.nan)


def as_beside(meeting: Meeting, name: str) -> FloatArray:
    """The way slid [m] or the rate [m/s] of contacts (nc,), by name.

    One that has not slid and did not bear in the step before, as a node that a sliding body comes to, or a point in another facet, has that
    of the nearest one of the same two bodies that did, no farther off than `BESIDE`: it slides on with the surfaces that meet there.
    """
    own, earlier = np.nan_to_num(meeting.recall(name, np.zeros(len(meeting)))), meeting.variables
    if earlier is None or SEAT not in earlier.values or name not in earlier.values:
        return own
    contacts, value = meeting.contacts, earlier.values[name]
    seat = meeting.recall(SEAT, np.full((len(contacts), earlier.values[SEAT].shape[1]), np.nan))
    new = np.flatnonzero(np.isnan(seat[:, 0]) & (own == 0))
    bore = np.flatnonzero(~np.isnan(earlier.values[SEAT][:, 0]) & ~np.isnan(value))
    if not len(new) or not len(bore):
        return own
    there = earlier.values[SEAT][bore]
    here = np.column_stack([np.sort(contacts.bodies[new], axis=1), contacts.point[new]])
    apart = np.ones(here.shape[1])
    apart[:2] = 2.0 * BESIDE * meeting.size.max()  # so that what another body bore on is too far
    distance, nearest = cKDTree(there * apart).query(here * apart)
    near = distance <= BESIDE * meeting.size[new]
    own[new[near]] = value[bore[nearest[near]]]
    return own


def _elliptic(friction: Elliptic, meeting: Meeting) -> FrictionTerms:
    contacts = meeting.contacts
    if contacts.dimension != 3:
        raise InputError("Elliptic: expected contacts in 3D; in 2D there is one tangent: use a coefficient mu")
    normal = contacts.frame[:, 0]
    along = np.asarray(friction.direction) / np.linalg.norm(friction.direction)
    tangent = along - (normal @ along)[:, None] * normal
    length = np.sqrt(np.einsum("ai,ai->a", tangent, tangent))
    if np.any(length < 1e-6):
        raise InputError(f"Elliptic, direction: expected one that is not normal to the surfaces, got {friction.direction}")
    first = tangent / length[:, None]
    frame = np.stack([normal, first, np.cross(normal, first)], axis=1)
    scale = np.tile([1.0, 1.0, friction.mu_2 / friction.mu_1], (len(contacts), 1))
    return FrictionTerms(np.full(len(contacts), friction.mu_1), scale, frame)


def _coefficients(given: object, *names: str) -> None:
    for name in names:
        value = getattr(given, name)
        if not (is_number(value) and value >= 0):
            raise InputError(f"{type(given).__name__}, {name}: expected a friction coefficient >= 0, got {shown(value)}")


def _positive(given: object, name: str) -> None:
    value = getattr(given, name)
    if not (is_number(value) and value > 0):
        raise InputError(f"{type(given).__name__}, {name}: expected a number > 0, got {shown(value)}")
