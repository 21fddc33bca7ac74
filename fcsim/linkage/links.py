"""The links between bodies, as a user names them. Places are those of the reference configuration [m]; body None is the ground.

A place on a deformable body must lie in one of its cells; of a rigid body it may lie anywhere, as if an arm without mass held it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from fcsim.assembly.supports.support import finite

Place = tuple[float, ...]


@dataclass(frozen=True)
class Ball:
    """A ball joint (2D: a pin): the points of both bodies that stand at `at` stay together; they may turn about it as they like."""

    name: str
    first: str
    second: str | None
    at: Place


@dataclass(frozen=True)
class Hinge:
    """A hinge in 3D (in 2D take Ball): the bodies share the axis through the two `ends`, and turn about it. Neither slides along it."""

    name: str
    first: str
    second: str | None
    ends: tuple[Place, Place]


@dataclass(frozen=True)
class Slider:
    """Two points of `second`, at the `ends`, stay on the line through the points of `first` that stand there: it slides along it.

    In 3D it may turn about the line too, unless `beside`, a place off it, is named: the bodies' points there then stay in one plane with
    it. first None: the line stands still.
    """

    name: str
    first: str | None
    second: str
    ends: tuple[Place, Place]
    beside: Place | None = None


@dataclass(frozen=True)
class Rod:
    """The points of the two bodies at the `ends` keep their distance."""

    name: str
    first: str
    second: str | None
    ends: tuple[Place, Place]


@dataclass(frozen=True)
class Cable:
    """The points of the two bodies at the `ends` come no farther apart than `length` [m], by default their distance: it only pulls.

    One-sided, and so a contact without friction: see `WithCables`. The laws `Gap` and `Velocity` keep its length while it is taut; with
    restitution the second throws its ends back where it becomes so.
    """

    name: str
    first: str
    second: str | None
    ends: tuple[Place, Place]
    length: float | None = None


@dataclass(frozen=True)
class SpringDamper:
    """A force stiffness (L - length) + damping dL/dt that draws the points at the `ends`, L apart, together.

    stiffness [N/m] >= 0, damping [N s/m] >= 0, not both zero; length [m] without force, by default the distance of the ends
    """

    name: str
    first: str
    second: str | None
    ends: tuple[Place, Place]
    stiffness: float
    damping: float = 0.0
    length: float | None = None


@dataclass(frozen=True)
class Tied:
    """Two surfaces (body, surface) that stay together as they stand, on meshes that need not match: weighted means of the gap over the
    functions of the first surface's nodes are kept (mortar; take the finer one first).

    distance [m]: how far apart they may stand; by default 1e-3 of the smaller body's size
    """

    name: str
    first: tuple[str, str]
    second: tuple[str, str]
    distance: float | None = None


@dataclass(frozen=True)
class Bonded:
    """Nodes of the two bodies at the same place stay together: parts of one mesh, as `read_parts` gives them for its physical groups."""

    name: str
    first: str
    second: str


@dataclass(frozen=True)
class Control:
    """Points of bodies whose weighted mean goes along `direction` at the pace `rate` [m/s], by forces along it in the ratio of the weights:
    a load whose amount is what its displacement takes, also where that falls (control by displacement). rate 0 holds the mean where it is.

    points: (body, place, weight), weights > 0; only their ratio counts. Times are those of the simulation; a step of statics has h.
    displacement: in place of the rate the mean's way [m], a function of the time that is 0 at t = 0: there and back, in cycles, held
    """

    name: str
    points: tuple[tuple[str, Place, float], ...]
    direction: Place
    rate: float = 0.0
    displacement: Callable[[float], float] | None = field(default=None, kw_only=True)

    def way(self, t: float) -> float:
        """The mean's displacement [m] at t [s]; InputError where that is no number."""
        return finite(self.displacement, t, f"link {self.name!r}", "a displacement") if self.displacement else self.rate * t


Link = Ball | Hinge | Slider | Rod | Cable | SpringDamper | Tied | Bonded | Control
