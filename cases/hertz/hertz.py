"""Hertz's contact: a sphere or a cylinder pressed on a rigid plane, or two equal spheres pressed on each other, without friction.

H. Hertz, 1882; the formulas are those of K. L. Johnson, Contact Mechanics, 1985, chapters 3 and 4 and section 5.6. See README.md.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from fcsim import (
    Body,
    Case,
    Detector,
    FloatArray,
    InputError,
    Material,
    Model,
    Part,
    QuasiStatic,
    RigidBody,
    Sensor,
    Simulation,
    SolverSettings,
    Step,
    Support,
    SurfacePair,
    build_model,
    contact_surface,
    main,
    nodal_area,
)
from fcsim.mesh import half_ball, half_disk, rigid_box, rigid_rectangle


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one."""

    contact: Literal["sphere", "cylinder", "two-spheres"] = "sphere"
    radius: float = 0.05
    E: float = 20e9
    nu: float = 0.3
    approach: float = 1.25e-4
    divisions: int = 8
    core: float = 1.25
    steps: int = 20
    solver: str = "NSN-AC"
    tol: float = 1e-8


@dataclass(frozen=True)
class Hertz:
    """The formulas for a relative radius R [m] (1/R = 1/R_1 + 1/R_2), the modulus E* [Pa] (1/E* = sum of (1 - nu^2)/E) and a force P.

    d = 3: force P [N]; d = 2: P [N] for one metre of cylinder, and the approach is that of the plane to the axis of a cylinder between
    two rigid planes, whose radius is R.
    """

    d: int
    R: float
    modulus: float

    def radius(self, P: float) -> float:
        """Radius or half-width a [m] of the contact: a^3 = 3 P R / (4 E*) (sphere), a^2 = 4 P R / (pi E*) (cylinder)."""
        return float(np.cbrt(3 * P * self.R / (4 * self.modulus)) if self.d == 3 else np.sqrt(4 * P * self.R / (np.pi * self.modulus)))

    def peak(self, P: float) -> float:
        """Largest pressure p0 [Pa]: 3 P / (2 pi a^2) (sphere), 2 P / (pi a) (cylinder)."""
        a = self.radius(P)
        return 3 * P / (2 * np.pi * a**2) if self.d == 3 else 2 * P / (np.pi * a)

    def pressure(self, r: FloatArray, P: float) -> FloatArray:
        """Pressure p0 sqrt(1 - (r/a)^2) [Pa] at the distance r [m] from the middle."""
        return self.peak(P) * np.sqrt(np.maximum(1 - (r / self.radius(P)) ** 2, 0))

    def approach(self, P: float) -> float:
        """Approach [m]: a^2 / R (sphere), P / (pi E*) (2 ln(4 R / a) - 1) (cylinder, Johnson eq. 5.57 for one of its two contacts)."""
        a = self.radius(P)
        return a**2 / self.R if self.d == 3 else P / (np.pi * self.modulus) * (2 * np.log(4 * self.R / a) - 1)

    def force(self, approach: float) -> float:
        """The force P [N] of an approach [m]."""
        if not approach:
            return 0.0
        if self.d == 3:
            return float(4 / 3 * self.modulus * np.sqrt(self.R) * approach**1.5)
        return float(brentq(lambda P: self.approach(P) - approach, 1e-12 * self.modulus * self.R, self.modulus * self.R / 2))

    def radius_of_forces(self, r: FloatArray, forces: FloatArray) -> float:
        """The radius a [m] of Hertz's pressure with the same second moment as the nodal forces: sum f r^2 = 2/5 P a^2, in 2D P a^2 / 4."""
        P = forces.sum()
        return float(np.sqrt((5 / 2 if self.d == 3 else 4) * (forces @ r**2) / P)) if P > 0 else 0.0


def formulas(p: Parameters) -> Hertz:
    """A rigid plane is flat and does not deform; a second sphere halves both the relative radius and E*."""
    modulus = p.E / (1 - p.nu**2)
    if p.contact == "two-spheres":
        return Hertz(3, p.radius / 2, modulus / 2)
    return Hertz(2 if p.contact == "cylinder" else 3, p.radius, modulus)


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if not 0 < p.approach < p.radius / 4:
        raise InputError(f"case hertz, approach: expected a length between 0 and a quarter of the radius {p.radius} m, got {p.approach}")
    if not p.core >= 1.1:  # the contact must stay inside; finite bodies make it a few per cent larger than the formula says
        raise InputError(f"case hertz, core: expected at least 1.1 contact radii, got {p.core}")
    hertz = formulas(p)
    core = p.core * hertz.radius(hertz.force(p.approach))
    bodies, supports = two_spheres(p, core) if p.contact == "two-spheres" else round_on_plane(p, core, hertz.d)
    model = build_model(bodies, supports=supports)
    face = "contact" if p.contact == "two-spheres" else ("y+" if hertz.d == 2 else "z+")
    master = contact_surface(model, [("lower", face)])
    pair = SurfacePair(contact_surface(model, [("upper", "contact")]), master, mu=0.0, alert=2 * core**2 / hertz.R)
    h = 1 / max(p.steps, 1)  # the approach is complete at t = 1
    simulation = Simulation(
        model,
        Detector([pair], model.n_nodes),
        QuasiStatic(h),
        p.steps,
        SolverSettings(name=p.solver, tol=p.tol, floor=1e-2 * p.approach),
    )
    loaded = Loaded(model, p)
    return Case(
        name="hertz",
        title=f"Hertz's contact: {p.contact.replace('-', ' ')}" + ("" if p.contact == "two-spheres" else " on a rigid plane"),
        simulation=simulation,
        sensors=(
            Sensor("approach", "approach", "m", lambda s: s.state.t * p.approach),
            Sensor("force", "force", "N", loaded.force),
            Sensor("force_hertz", "force of Hertz", "N", lambda s: hertz.force(s.state.t * p.approach)),
            Sensor("radius", "contact radius", "m", loaded.radius),
            Sensor("radius_hertz", "contact radius of Hertz for this force", "m", lambda s: hertz.radius(loaded.force(s))),
            Sensor("peak", "pressure in the middle", "Pa", loaded.peak),
            Sensor("peak_hertz", "pressure of Hertz for this force", "Pa", lambda s: hertz.peak(loaded.force(s))),
        ),
        plots={"imposed": "approach", "reaction": ("force", "force_hertz")},
        fclib_set="FCSIM_Hertz",
        description=f"{p.contact}, {model.n_dofs} degrees of freedom, {p.divisions} elements along the half-width of the core",
    )


def round_on_plane(p: Parameters, core: float, d: int) -> tuple[list[Body | RigidBody], list[Support]]:
    """A quarter of the half ball (half of the half disk) under its middle plane, which comes down by the approach."""
    mesh, box = (half_ball, rigid_box) if d == 3 else (half_disk, rigid_rectangle)
    part = mesh("half ball" if d == 3 else "half disk", p.radius, core, p.divisions, Material(p.E, p.nu, 0.0))
    up = "xyz"[d - 1]
    width, thickness = 1.4 * p.radius, 0.2 * p.radius
    plane = box("lower", (width,) * (d - 1) + (thickness,), (0.5 * p.radius,) * (d - 1) + (-thickness / 2,), mass=1.0)
    supports = [Support("lower", ("x", "y", "z", "rx", "ry", "rz") if d == 3 else ("x", "y", "rz"))]
    return [Body("upper", part), plane], [*supports, *symmetry("upper", part), Support("upper", (up,), "middle", -p.approach)]


def two_spheres(p: Parameters, core: float) -> tuple[list[Body | RigidBody], list[Support]]:
    """Quarters of two half balls, matching meshes, whose middle planes each come half the approach."""
    material = Material(p.E, p.nu, 0.0)
    upper = half_ball("upper half ball", p.radius, core, p.divisions, material)
    lower = half_ball("lower half ball", p.radius, core, p.divisions, material, side="below")
    supports = [
        *symmetry("upper", upper),
        *symmetry("lower", lower),
        Support("upper", ("z",), "middle", -p.approach / 2),
        Support("lower", ("z",), "middle", p.approach / 2),
    ]
    return [Body("upper", upper), Body("lower", lower)], supports


def symmetry(body: str, part: Part) -> list[Support]:
    """Planes of symmetry do not move along their normals."""
    return [Support(body, (axis,), f"{axis}-") for axis in "xy"[: part.dimension - 1]]


class Loaded:
    """What the contact forces on the upper body say."""

    def __init__(self, model: Model, p: Parameters) -> None:
        self.model, self.hertz = model, formulas(p)
        self.copies = 4 if self.hertz.d == 3 else 2  # the model is a quarter, in 2D a half
        self._area = nodal_area(model, "upper", "contact")

    def force(self, step: Step) -> float:
        """Resultant [N] of the whole contact."""
        return float(self.copies * step.contact_force_on(self.model.number["upper"])[-1])

    def nodal_pressure(self, step: Step) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance from the middle (nc,) [m] in the reference configuration, pressure (nc,) [Pa] and area (nc,) [m^2] of the nodes."""
        node = step.contacts.nodes[:, 0]
        r = np.linalg.norm(self.model.reference[node, :-1], axis=1)
        return r, step.contact_force[:, 0] / self._area[node], self._area[node]

    def radius(self, step: Step) -> float:
        r, pressure, area = self.nodal_pressure(step)
        return self.hertz.radius_of_forces(r, pressure * area)

    def peak(self, step: Step) -> float:
        r, pressure, _ = self.nodal_pressure(step)
        return float(pressure[np.argmin(r)]) if len(r) else 0.0


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
