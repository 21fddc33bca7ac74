"""Every case folder obeys mechanics at every step: momentum, action and reaction, Coulomb's cone, no penetration.

A few steps of each, with the small parameters below; a folder that is not named there runs the first steps of its defaults. Nothing is
taken from the program's own checks: the equation of motion is written again, with the whole matrices, from the states at both ends of the
step, and what remains of it at degrees of freedom that nothing holds must vanish; what remains at held ones is the supports' reaction.
"""

from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import polar

from fcsim.contact_detection import Detector
from fcsim.contact_law import Gap
from fcsim.contact_law.coulomb import NO_GAP
from fcsim.running.case import CaseScript, load_case
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.inner_term import InnerTerm
from fcsim.timestep.theta import Theta

CASES = Path(__file__).parents[2] / "cases"

SMALL: dict[str, list[dict[str, Any]]] = {
    "masonry_wall": [
        {"courses": 2, "blocks": 1.5, "divisions": (4, 2, 2), "steps": 30},
        {"courses": 2, "blocks": 2.5, "divisions": (4, 2, 2), "driven": "eliminated", "theta": 0.7, "steps": 30},
    ],
    "hertz": [
        {"contact": "sphere", "divisions": 3, "steps": 4},
        {"contact": "cylinder", "divisions": 8, "approach": 2.4e-4, "steps": 4},
        {"contact": "two-spheres", "divisions": 3, "approach": 4e-3, "steps": 4},
    ],
    "cattaneo_mindlin": [
        {"contact": "cylinder", "divisions": 8, "steps": 6},
        {"contact": "sphere", "shear": 4.5e-6, "divisions": 3, "steps": 6},
    ],
    "press_and_shear": [
        {"top_divisions": (3, 3, 2), "bottom_divisions": (4, 4, 2), "shear_steps": 3},
        {"top_divisions": (3, 3, 2), "bottom_divisions": (4, 4, 2), "shear_steps": 3, "candidates": "nodes"},
    ],
    "arch": [{"voussoirs": 6, "steps": 30}, {"voussoirs": 6, "blocks_are": "mixed", "steps": 12}],
    "stack": [{"steps": 30}, {"blocks_are": "deformable", "overhang": 0.9, "steps": 30}],
    "impact_bar": [{"elements": 20, "steps": 40}, {"elements": 20, "steps": 40, "scheme": "generalised-alpha"}],
    "granular": [{"n": 12, "width": 0.1, "h": 4e-3, "steps": 60, "tol": 1e-9}],
    "rocks": [{"n": 2, "width": 0.22, "steps": 80, "tol": 1e-9}],
    "boxes": [{"across": 2, "steps": 12, "tol": 1e-9}],
    "wall_hit": [{"courses": 2, "blocks": 1.5, "steps": 15, "tol": 1e-9}],
    "falling_arch": [{"voussoirs": 6, "steps": 15, "tol": 1e-9}],
    "tilting_facade": [{"steps": 4, "tol": 1e-8}],
    "cohesive_panel": [{"courses": 2, "width": 2, "steps": 70}],
    "wall_earthquake": [{"courses": 2, "blocks": 1.5, "steps": 20}],
    "shaft": [{"cells": (2, 24), "steps": 40}, {"cells": (1, 16), "mu": 0.5, "speed": 5.0, "theta": 0.6, "steps": 40}],
    "slider_crank": [{"steps": 40}, {"steps": 40, "ahead": 0.001}],
    "bracket": [{"elements": "P1", "tightened": 1, "loaded": 2}],
    "stamped_sheet": [{"cells": (16, 2), "stroke": 6e-4, "pressing": 2, "leaving": 0}],
    "seal": [{"cells": (1, 12), "closing": 1e-3, "steps": 3, "time": 0.01}],
    "two_cubes": [{"elements": 3, "steps": 4}, {"elements": 3, "lower_elements": 2, "candidates": "gauss", "steps": 4}],
}
FOLDERS = sorted(folder.name for folder in CASES.iterdir() if (folder / f"{folder.name}.py").is_file())
FIRST = 5  # steps of a case without small parameters
RUNS = [(name, k) for name in FOLDERS for k in range(len(SMALL.get(name, [{}])))]


@cache
def script(name: str) -> CaseScript:
    return load_case(CASES / name)


def simulation(name: str, k: int) -> Simulation:
    parameters = script(name).parameters
    return script(name).build(parameters(**SMALL.get(name, [{}])[k])).simulation


class Mechanics:
    """The equation of motion of a model in a scheme, with the whole matrices."""

    def __init__(self, run: Simulation) -> None:
        model, self.scheme = run.model, run.scheme
        self.model, self.M, self.K, self.C = model, model.mass, model.stiffness, model.damping
        d = model.dimension
        # of a rigid body the translations: its rotations are finite, and no matrix times a velocity
        self.linear = np.ones(model.n_dofs, dtype=bool)
        for first in model.dof_offset[len(model.deformable) : -1]:
            self.linear[first + d : first + 3 * (d - 1)] = False
        # [N s] the displacement y of turning bodies has the digits of positions
        turning = any(group.turning for group in model.groups)
        self.digits = self.scheme.h * 64 * np.finfo(float).eps * self.K.diagonal().max() * np.ptp(model.reference) if turning else 0.0
        self.held = np.zeros(model.n_dofs, dtype=bool)
        self.held[model.driven_dofs] = True

    def remainder(self, step: Step) -> tuple[np.ndarray, float] | None:
        """Change of momentum minus the impulses of loads, stresses, damping and contacts (n_dofs,) [N s; statics: N], and its scale.

        theta scheme, with a_theta = theta a+ + (1 - theta) a: M (v+ - v) - h (F - C v - K x)_theta - H r. Quasi-statics: K x+ - F+ - H r +
        eta M dx / h^2. Generalised-alpha: M (v+ - v) - h ((1 - gamma) p + gamma p+) - H r, with alpha_m p+ + (1 - alpha_m) p =
        (F - C v - K x)_alpha_f. None for other schemes.
        """
        before, after, h = step.previous, step.state, self.scheme.h
        contact = step.H @ step.reaction
        if step.linked is not None:
            contact = contact + step.linked.G @ step.result.multiplier
        if isinstance(self.scheme, QuasiStatic):
            regular = self.regularising(step)
            terms = [self.stresses(step), -self.model.load(after.t), regular, -contact]
        elif isinstance(self.scheme, Theta):
            theta = self.scheme.theta
            inner = [self.of_linear(self.C @ s.v + self.K @ s.x) - self.model.load(s.t) for s in (before, after)]
            terms = [self.M @ (after.v - before.v), h * (theta * inner[1] + (1 - theta) * inner[0] + self.turning(step)), -contact]
            if self.model.nonlinear.groups:  # at the scheme's mean of the strains, `tests/unit/timestep/test_nonlinear.py`
                terms.append(InnerTerm(self.scheme, self.model, before).at(after.v).force)
        elif isinstance(self.scheme, GeneralisedAlpha):
            alpha_f, alpha_m, gamma = self.scheme.alpha_f, self.scheme.alpha_m, self.scheme.gamma
            inner = [self.model.load(s.t) - self.C @ s.v - self.K @ s.x for s in (before, after)]
            p0 = inner[0] if before.inertia is None else before.inertia
            p1 = (alpha_f * inner[1] + (1 - alpha_f) * inner[0] - (1 - alpha_m) * p0) / alpha_m
            terms = [self.M @ (after.v - before.v), -h * ((1 - gamma) * p0 + gamma * p1), -contact]
        else:
            return None
        return np.sum(terms, axis=0), float(max(np.abs(term).max() for term in terms))

    def stresses(self, step: Step) -> np.ndarray:
        """Inner forces at the end of a step of statics (n_dofs,) [N]: K x, of bodies of other materials those that these say, which
        `tests/unit/assembly` holds against differences of the energy."""
        bodies, after = self.model.nonlinear, step.state
        forces = self.of_linear(self.K @ after.x)
        if not bodies.groups:
            return forces
        return forces + bodies.inner(after.x, step.previous.internal, after.t, after.t - step.previous.t).force

    def of_linear(self, forces: np.ndarray) -> np.ndarray:
        """The forces (n_dofs,) without those on bodies of other materials."""
        for group in self.model.nonlinear.groups:
            forces[group.dofs] = 0.0
        return forces

    def turning(self, step: Step) -> np.ndarray:
        """What the stress of turning bodies adds to that of small rotations (n_dofs,) [N], theta scheme: the gradient of y(x) . s with
        s = K (y_theta + beta dy / dt) held, by central differences in the middle of the step; y(x) is written out in `strained`."""
        model, (before, after), h, theta = self.model, (step.previous, step.state), self.scheme.h, self.scheme.theta
        added = np.zeros(model.n_dofs)
        for member in (int(k) for group in model.groups if group.turning for k in group.members):
            own = slice(model.dof_offset[member], model.dof_offset[member + 1])
            X = model.reference.ravel()[own].reshape(-1, model.dimension)
            mass = np.asarray(self.M[own, own].sum(axis=1)).reshape(X.shape)[:, 0]
            K, x0, x1 = self.K[own, own], before.x[own], after.x[own]
            y0, y1 = strained(X, mass, np.array([x0, x1]))
            s = K @ (theta * y1 + (1 - theta) * y0 + model.beta / h * (y1 - y0))
            eps = 1e-5 * np.ptp(X)
            moved = 0.5 * (x0 + x1) + eps * np.concatenate([np.eye(len(x0)), -np.eye(len(x0))])
            forward, backward = np.split(strained(X, mass, moved) @ s, 2)
            velocity = theta * after.v[own] + (1 - theta) * before.v[own]
            added[own] = (forward - backward) / (2 * eps) - K @ (theta * x1 + (1 - theta) * x0 + model.beta * velocity)
        return added

    def regularising(self, step: Step) -> np.ndarray:
        """eta M dx / h^2 (n_dofs,) [N] of statics, which supports do not carry; else 0."""
        if not isinstance(self.scheme, QuasiStatic):
            return np.zeros(self.model.n_dofs)
        return self.scheme.eta / self.scheme.h**2 * (self.M @ (step.state.x - step.previous.x))

    def resultants(self, forces: np.ndarray) -> np.ndarray:
        """Resultant (nbodies, d) on each body of a vector on all degrees of freedom."""
        model, d = self.model, self.model.dimension
        own = [forces[model.dof_offset[k] : model.dof_offset[k + 1]] for k in range(len(model.bodies))]
        return np.array([o.reshape(-1, d).sum(axis=0) if k < len(model.deformable) else o[:d] for k, o in enumerate(own)])


def strained(X: np.ndarray, mass: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Displacements (n, d nn) without the rotation R of the polar decomposition of sum m (x - c) (X - C)^T: y = R^T (x - c) - (X - C),
    of nodes X (nn, d) with masses (nn,) and displacements x (n, d nn)."""
    arm = X - mass @ X / mass.sum()
    here = X + x.reshape(-1, *X.shape)
    here = here - (mass @ here / mass.sum())[:, None]
    R = np.array([polar(A)[0] for A in here.transpose(0, 2, 1) @ (mass[:, None] * arm)])
    return (here @ R - arm).reshape(x.shape)


def edge_length(run: Simulation, facets: np.ndarray) -> float:
    """Length [m] of the facets' shortest first edge."""
    first, second = run.model.reference[facets[:, 0]], run.model.reference[facets[:, 1]]
    return float(np.linalg.norm(second - first, axis=1).min())


def moving(step: Step) -> np.ndarray:
    """What contacts are laws of (n_dofs,): the increment x+ - x of statics, else v+, of rigid bodies whose inertia turns at the angular
    momentum of the end in the middle of the step, where the theta scheme strikes them."""
    if isinstance(step.scheme, QuasiStatic):
        return step.state.x - step.previous.x
    if not isinstance(step.scheme, Theta):
        return step.state.v
    model, middle = step.model, step.scheme.detection_configuration(step.model, step.previous)
    return model.keep_momentum(step.state.v, model.rigid_mass(step.state.x), middle)


def smallest_element(run: Simulation) -> float:
    """Length [m] of the shortest facet that contacts lie on; of bodies without facets the smallest extent."""
    if isinstance(run.detector, Detector):
        return min(edge_length(run, pair.slave.facets) for pair in run.detector.pairs)
    return min(np.ptp(body.points, axis=0).min() if body.shape is None else body.shape.size for body in run.model.rigid)


@pytest.mark.parametrize(("name", "k"), RUNS)
def test_every_step_of_every_case(name: str, k: int) -> None:
    run = simulation(name, k)
    mechanics, touched, model = Mechanics(run), 0, run.model
    slack = 1e-6  # relative: the solver's 1e-8, amplified from displacements to forces
    element = smallest_element(run)
    for step in run if name in SMALL else islice(run, FIRST):
        contacts, d = step.contacts, model.dimension
        r = step.result.r.reshape(-1, d)
        size = max(np.abs(r).max(initial=0.0), 1e-300)
        touched += len(contacts)

        # action = reaction: (H r) on each body is what its contacts' forces sum to, taken from frames and body numbers alone
        forces = np.einsum("aij,ai->aj", contacts.frame, step.reaction.reshape(-1, d))
        expected = np.zeros((len(model.bodies), d))
        np.add.at(expected, contacts.bodies[:, 0], forces)
        np.add.at(expected, contacts.bodies[:, 1], -forces)
        contact = mechanics.resultants(step.H @ step.reaction)
        assert contact == pytest.approx(expected, abs=1e-10 * size * max(len(contacts), 1))
        assert contact.sum(axis=0) == pytest.approx(0, abs=1e-10 * size * max(len(contacts), 1))

        # every free degree of freedom obeys the equation of motion, hence every body and the whole the balance of momentum
        if (found := mechanics.remainder(step)) is not None:
            remainder, scale = found
            free = mechanics.linear & ~mechanics.held
            assert np.abs(remainder[free]).max() <= 1e-8 * scale + 1e-12 + mechanics.digits
            if not isinstance(run.scheme, GeneralisedAlpha):  # it weighs the supports' forces otherwise than the inertia of driven dofs
                supports = mechanics.resultants(np.where(mechanics.held, remainder, 0.0))
                expected = mechanics.resultants(np.where(mechanics.linear, remainder, 0.0))
                assert supports == pytest.approx(expected, abs=slack * scale + 1e-12)
                held = mechanics.linear & mechanics.held
                carried = remainder[held] - mechanics.regularising(step)[held]
                assert step.support_impulse[held] == pytest.approx(carried, abs=1e-8 * scale + 1e-12)

        # Coulomb's cone; friction takes energy
        tangential = np.linalg.norm(r[:, 1:], axis=1)
        assert np.all(r[:, 0] >= -slack * size) and np.all(tangential <= contacts.mu * r[:, 0] + slack * size)
        u = (step.H.T @ moving(step)).reshape(-1, d)
        slip = u if step.encounter.terms.compliance is None else step.result.u.reshape(-1, d)  # what springs do not give
        work = np.einsum("ai,ai->", r[:, 1:], slip[:, 1:])
        moved = max(np.abs(u).max(initial=0.0), run.substeps.settings(step.previous.t, len(step.contacts)).least_motion)
        assert work <= 10 * run.solver.tol * size * moved * max(len(contacts), 1)

        # no penetration where the step detects and, linearised, at its end; facets that turn leave the square of the step's motion
        h = run.scheme.h
        if isinstance(run.scheme, QuasiStatic) or isinstance(getattr(run.scheme, "law", None), Gap):
            travel = np.abs(step.state.x - step.previous.x).max()
            advance = 1.0 if isinstance(run.scheme, QuasiStatic) else h
            advance = 0.0 if model.nonlinear and isinstance(run.scheme, QuasiStatic) else advance  # found anew at the last iterate
            least = run.substeps.settings(step.previous.t, len(step.contacts)).least_motion * advance
            known = 10 * run.solver.tol * least + 1e-12 * np.ptp(model.reference)  # [m] what solver and digits resolve
            meeting = step.encounter.meeting
            none = NO_GAP * meeting.size * meeting.between_rigid if meeting.timing.moving else 0.0  # what the law takes for no gap
            assert np.all(contacts.gap + advance * u[:, 0] >= -slack * travel - known - none)
            assert contacts.gap.min(initial=0.0) >= -(travel**2) / element - run.solver.tol * np.ptp(model.reference)
            # what is bent within the step is known to second order, in both directions
            open_ = contacts.gap + advance * u[:, 0] > 1e-3 * travel + travel**2 / element + known + none
            assert np.all(r[open_, 0] <= 1e-3 * size)  # no force at a distance
    assert touched  # the contact was met


def test_small_parameters_name_cases_that_exist() -> None:
    assert set(SMALL) <= set(FOLDERS)
