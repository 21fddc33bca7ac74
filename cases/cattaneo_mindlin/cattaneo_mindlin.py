"""Partial slip: a cylinder or a sphere pressed on a half-space of the same material, then pushed sideways by less than friction holds.

C. Cattaneo, 1938; R. D. Mindlin, 1949; the formulas are those of K. L. Johnson, Contact Mechanics, 1985, section 7.2. See README.md.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim import (
    Body,
    Case,
    Detector,
    FloatArray,
    InputError,
    Material,
    Model,
    QuasiStatic,
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
from fcsim.mesh import graded_brick, graded_rectangle, half_ball, half_disk

DEPTH = 2.0  # depth and half-width of the block, in radii


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one."""

    contact: Literal["cylinder", "sphere"] = "cylinder"
    radius: float = 0.05
    E: float = 20e9
    nu: float = 0.3
    mu: float = 0.3
    contact_radius: float = 1e-3
    shear: float = 1.5e-5
    divisions: int = 16
    core: float = 1.25
    steps: int = 20
    solver: str = "NSN-AC-HYBRID"
    tol: float = 1e-8


@dataclass(frozen=True)
class PartialSlip:
    """The formulas for P [N] and Q < mu P [N] (cylinder, d = 2: for one metre); R [m]; E* = E / (2 (1 - nu^2)) [Pa], both bodies alike.

    Like bodies are not sheared by a normal force, so P gives Hertz's pressure; Q then adds mu times that pressure, less mu times the
    pressure of a smaller Hertzian contact of radius c where nothing slips.
    """

    d: int
    R: float
    modulus: float
    mu: float

    def radius(self, P: float) -> float:
        """Radius or half-width a [m] of the contact: a^3 = 3 P R / (4 E*) (sphere), a^2 = 4 P R / (pi E*) (cylinder)."""
        return float(np.cbrt(3 * P * self.R / (4 * self.modulus)) if self.d == 3 else np.sqrt(4 * P * self.R / (np.pi * self.modulus)))

    def peak(self, P: float) -> float:
        """Largest pressure p0 [Pa]: 3 P / (2 pi a^2) (sphere), 2 P / (pi a) (cylinder)."""
        a = self.radius(P)
        return 3 * P / (2 * np.pi * a**2) if self.d == 3 else 2 * P / (np.pi * a)

    def stick_ratio(self, P: float, Q: float) -> float:
        """c/a = (1 - Q / (mu P))^(1/3) (sphere), to the power 1/2 (cylinder); 0 once all slips."""
        return float(np.maximum(1 - Q / (self.mu * P), 0) ** (1 / self.d))

    def pressure(self, r: FloatArray, P: float) -> FloatArray:
        """p0 sqrt(1 - (r/a)^2) [Pa]."""
        return self.peak(P) * np.sqrt(np.maximum(1 - (r / self.radius(P)) ** 2, 0))

    def traction(self, r: FloatArray, P: float, Q: float) -> FloatArray:
        """mu p0 (sqrt(1 - (r/a)^2) - c/a sqrt(1 - (r/c)^2)) [Pa], the second root where r < c."""
        a, ratio = self.radius(P), self.stick_ratio(P, Q)
        stuck = np.sqrt(np.maximum(ratio**2 - (r / a) ** 2, 0))
        return self.mu * (self.pressure(r, P) - self.peak(P) * stuck)

    def stick_ratio_of_forces(self, r: FloatArray, normal: FloatArray, tangential: FloatArray) -> float:
        """The c/a of the formula with the same second moments as the nodal forces: (c/a)^(d + 2) = 1 - sum q r^2 / (mu sum p r^2).

        It is not a multiple of the element, as the radius of the nodes that stick is.
        """
        return float(np.maximum(1 - tangential @ r**2 / (self.mu * (normal @ r**2)), 0) ** (1 / (self.d + 2)))


def formulas(p: Parameters) -> PartialSlip:
    return PartialSlip(3 if p.contact == "sphere" else 2, p.radius, p.E / (2 * (1 - p.nu**2)), p.mu)


def approach(p: Parameters) -> float:
    """The approach [m] that makes a contact of about `contact_radius` = a.

    Sphere: a^2 / R. Cylinder (P for one metre, D the depth of the block): P (1 - nu^2) / (pi E) (2 ln(4 R / a) - 1 + 2 ln(2 D / a)
    - nu / (1 - nu)), Johnson eqs. 5.57 for the disk and 5.56 for the block.
    """
    a = p.contact_radius
    if p.contact == "sphere":
        return a**2 / p.radius
    logarithms = 2 * np.log(4 * p.radius / a) - 1 + 2 * np.log(2 * DEPTH * p.radius / a) - p.nu / (1 - p.nu)
    return float(a**2 / (8 * p.radius) * logarithms)


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if not p.mu > 0:
        raise InputError(f"case cattaneo_mindlin, mu: expected a friction coefficient > 0, got {p.mu}")
    if not p.core >= 1.1:  # the contact must stay inside
        raise InputError(f"case cattaneo_mindlin, core: expected at least 1.1 contact radii, got {p.core}")
    model = cut_bodies(p)
    pair = SurfacePair(
        contact_surface(model, [("round", "contact")]),
        contact_surface(model, [("block", "contact")]),
        p.mu,
        alert=2 * (p.core * p.contact_radius) ** 2 / p.radius,
    )
    scheme = QuasiStatic(2 / max(p.steps, 1))  # pressed from t = 0 to 1, pushed sideways from 1 to 2
    settings = SolverSettings(name=p.solver, tol=p.tol, floor=1e-2 * approach(p))
    simulation = Simulation(model, Detector([pair], model.n_nodes), scheme, p.steps, settings)
    slip, loaded = formulas(p), Loaded(model, p)

    def limit(step: Step) -> float:
        return p.mu * loaded.resultants(step)[0]

    return Case(
        name="cattaneo_mindlin",
        title=f"Partial slip of a {p.contact} on a half-space",
        simulation=simulation,
        sensors=(
            Sensor("shear", "tangential displacement", "m", lambda s: p.shear * max(s.state.t - 1, 0)),
            Sensor("P", "normal force", "N", lambda s: loaded.resultants(s)[0]),
            Sensor("Q", "tangential force", "N", lambda s: loaded.resultants(s)[1]),
            Sensor("limit", "friction times normal force", "N", limit),
            Sensor("stick_ratio", "c/a from the forces", "", loaded.stick_ratio),
            Sensor("stick_ratio_formula", "c/a from Q/(mu P)", "", lambda s: slip.stick_ratio(*loaded.resultants(s))),
        ),
        plots={"imposed": "shear", "reaction": ("Q", "limit")},
        fclib_set="FCSIM_CattaneoMindlin",
        description=f"{p.contact} on a block, {model.n_dofs} degrees of freedom",
    )


def cut_bodies(p: Parameters) -> Model:
    """The half disk on its block, or the half ball and its block cut by the plane y = 0 of the forces."""
    material, core = Material(p.E, p.nu, 0.0), p.core * p.contact_radius
    round_mesh, block_mesh, up = (half_ball, graded_brick, "z") if p.contact == "sphere" else (half_disk, graded_rectangle, "y")
    upper = round_mesh("round", p.radius, core, p.divisions, material, whole="x")
    block = block_mesh("block", DEPTH * p.radius, core, p.divisions, material, whole="x")
    speed = approach(p)
    supports = [
        Support("block", ("x", up), "base"),
        Support("round", (up,), "middle", velocity=lambda t: -speed if t < 1 else 0.0),
        Support("round", ("x",), "middle", velocity=lambda t: 0.0 if t < 1 else p.shear),
    ]
    if p.contact == "sphere":
        supports += [Support("block", ("y",), "y-"), Support("round", ("y",), "y-")]
    return build_model([Body("round", upper), Body("block", block)], supports=supports)


class Loaded:
    """What the contact forces on the round body say."""

    def __init__(self, model: Model, p: Parameters) -> None:
        self.model, self.slip = model, formulas(p)
        self.copies = 2 if p.contact == "sphere" else 1  # the plane y = 0 cuts the sphere
        self._area = nodal_area(model, "round", "contact")

    def resultants(self, step: Step) -> tuple[float, float]:
        """P and Q [N] of the whole contact; Q holds the body back against +x."""
        force = self.copies * step.contact_force_on(self.model.number["round"])
        return float(force[-1]), float(-force[0])

    def nodal_tractions(self, step: Step) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Of the slave nodes: distance r from the middle (nc,) [m], pressure, tangential traction against x (nc,) [Pa], area (nc,) [m^2].

        The traction is the part in the contact's own tangent plane: the surface is inclined by up to a/R.
        """
        node, normal = step.contacts.nodes[:, 0], step.contacts.frame[:, 0]
        r, area, pressure = np.linalg.norm(self.model.reference[node, :-1], axis=1), self._area[node], step.contact_force[:, 0]
        tangential = step.force_in_space[:, 0] - pressure * normal[:, 0]
        return r, pressure / area, -tangential / area, area

    def stick_ratio(self, step: Step) -> float:
        r, pressure, traction, area = self.nodal_tractions(step)
        return self.slip.stick_ratio_of_forces(r, pressure * area, traction * area)


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
