"""Every argument of the public constructors with what it cannot be: one line that names what was expected and what came, no traceback."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fcsim
from fcsim import Body, Detector, Everything, Gap, Linkage, Simulation, Support, SurfacePair, Theta, build_model, contact_surface
from fcsim.arrays import is_number, numbers_of
from fcsim.assembly.time_functions import GravityRamp, Ramp
from fcsim.contact_law import Sliding, Springs
from fcsim.mesh import brick, check_quality, mass_properties, rigid_box, rigid_sphere, with_surface
from fcsim.problem import error, scaled_error
from fcsim.problem.reduction import reduced

STONE = fcsim.Material(E=1e7, nu=0.2, density=1000.0)
HELD = Support("floor", ("x", "y", "z", "rx", "ry", "rz"))
ENDS = ((0.0, 0.0, 0.1), (0.0, 0.0, 0.5))


def _raising(*arguments: object) -> float:
    raise RuntimeError("no such record")


def _raising_friction(sliding: Sliding) -> fcsim.FloatArray:
    raise RuntimeError("no such record")


NO_NUMBER: tuple[object, ...] = ("0.3", True, None, float("nan"), [], np.array([1.0, 2.0]), 1j, object(), _raising, 10**400)
"""None of these is a number, whatever Python makes of them."""


def _bodies(rigid: bool = False) -> list[Any]:
    floor = rigid_box("floor", size=(1, 1, 0.1), centre=(0, 0, -0.05), mass=1.0)
    block = rigid_box("block", (0.1, 0.1, 0.1), (0.0, 0.0, 0.05), 1.0) if rigid else Body("block", brick("b", (0.1,) * 3, (1,) * 3, STONE))
    return [floor, block]


def _model(supports: tuple[Any, ...] = (), **more: Any) -> fcsim.Model:
    return build_model(_bodies(), supports=[HELD, *supports], **more)


def _linkage(link: Any) -> Linkage:
    return Linkage(build_model(_bodies(rigid=True), supports=[HELD]), [link])


def _pair(**more: Any) -> SurfacePair:
    model = _model()
    given = {"mu": 0.3, "alert": 0.01, **more}
    return SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), **given)


def _simulated(**more: Any) -> None:
    model = _model(gravity=lambda t: (0.0, 0.0, -10.0))
    given = {"scheme": Theta(1e-3), "steps": 1, **more}
    list(Simulation(model, Everything(model, mu=0.3), **given))


NUMBERS: dict[str, Callable[[Any], object]] = {
    "Material.E": lambda x: fcsim.Material(x, 0.2, 1000.0),
    "Material.nu": lambda x: fcsim.Material(1e9, x, 1000.0),
    "Material.density": lambda x: fcsim.Material(1e9, 0.2, x),
    "Theta.h": lambda x: Theta(x),
    "Theta.theta": lambda x: Theta(1e-3, x),
    "GeneralisedAlpha.rho": lambda x: fcsim.GeneralisedAlpha(1e-3, x),
    "QuasiStatic.eta": lambda x: fcsim.QuasiStatic(1.0, eta=x),
    "Gap.recovery": lambda x: Gap(x),
    "Velocity.restitution": lambda x: fcsim.Velocity(x),
    "Cohesive.tension": lambda x: fcsim.Cohesive(tension=x, mode_1=1.0, mode_2=1.0),
    "Cohesive.mode_2": lambda x: fcsim.Cohesive(tension=1.0, mode_1=1.0, mode_2=x),
    "Springs.normal": lambda x: Springs(normal=x, tangential=1.0),
    "Springs.tangential_damping": lambda x: Springs(normal=1.0, tangential=1.0, tangential_damping=x),
    "Rolling.resistance": lambda x: fcsim.Rolling(x),
    "SlipWeakening.static": lambda x: fcsim.SlipWeakening(x, 0.3, 1.0),
    "RateDependent.velocity": lambda x: fcsim.RateDependent(0.5, 0.3, x),
    "StaticKinetic.kinetic": lambda x: fcsim.StaticKinetic(0.5, x),
    "Elliptic.mu_2": lambda x: fcsim.Elliptic(0.5, x, (1.0, 0.0, 0.0)),
    "Limits.strain": lambda x: fcsim.Limits(strain=x),
    "Witness.every": lambda x: fcsim.Witness(every=x),
    "Witness.tolerance": lambda x: fcsim.Witness(tolerance=x),
    "SolverSettings.tol": lambda x: fcsim.SolverSettings(tol=x),
    "build_model.alpha": lambda x: _model(alpha=x),
    "build_model.beta": lambda x: _model(beta=x),
    "Everything.mu": lambda x: Everything(_model(), mu=x)(np.zeros((0, 3))),
    "SurfacePair.mu": lambda x: _pair(mu=x),
    "SurfacePair.alert": lambda x: _pair(alert=x),
    "Detector.penetration": lambda x: Detector([_pair()], 16, penetration=x),
    "Simulation.steps": lambda x: _simulated(steps=x),
    "Simulation.created": lambda x: _simulated(created=x),
    "rigid_box.mass": lambda x: rigid_box("b", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), x),
    "rigid_sphere.radius": lambda x: rigid_sphere("b", x, (0.0, 0.0, 0.0), mass=1.0),
    "SpringDamper.stiffness": lambda x: _linkage(fcsim.SpringDamper("s", "block", None, ENDS, x)),
    "Control.rate": lambda x: _linkage(fcsim.Control("c", (("block", (0.0, 0.0, 0.1), 1.0),), (0.0, 0.0, 1.0), x)),
    "Ramp.t0": lambda x: Ramp(x, 1.0),
    "GravityRamp.t1": lambda x: GravityRamp((0.0, 0.0, -9.81), 0.0, x),
    "Support.velocity": lambda x: _model((Support("block", ("x",), "z+", velocity=x),)),
    "FollowerPressure.pressure": lambda x: _model(loads=[fcsim.FollowerPressure("block", "z+", x)]),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_what_is_no_number_is_refused_in_one_line(name: str) -> None:
    for value in NO_NUMBER:
        if name == "Everything.mu" and value is _raising:
            continue  # a function of two names, asked when they meet
        with pytest.raises(fcsim.InputError, match=r"expected|raised") as refused:
            NUMBERS[name](value)
        said = str(refused.value)
        assert "\n" not in said and ("got" in said or "raised" in said), said


OTHERS: dict[str, Callable[[Any], object]] = {
    "Springs.each": lambda x: Springs(normal=1.0, tangential=1.0, each=x),
    "Limits.inversion": lambda x: fcsim.Limits(inversion=x),
    "Witness.stop": lambda x: fcsim.Witness(stop=x),
    "build_model.lumped": lambda x: _model(lumped=x),
    "Compliant.springs": lambda x: fcsim.Compliant(x),
    "Body.name": lambda x: build_model([Body(x, brick("b", (0.1,) * 3, (1,) * 3, STONE))]),
    "Body.part": lambda x: Body("block", x),
    "brick.name": lambda x: brick(x, (0.1,) * 3, (1,) * 3, STONE),
    "Ball.name": lambda x: _linkage(fcsim.Ball(x, "block", None, (0.0, 0.0, 0.1))),
    "Rod.ends": lambda x: _linkage(fcsim.Rod("r", "block", None, x)),
    "Rod.first": lambda x: _linkage(fcsim.Rod("r", x, "floor", ENDS)),
    "Support.body": lambda x: _model((Support(x, ("x",), "z+"),)),
    "Support.directions": lambda x: _model((Support("block", x, "z+"),)),
    "Support.surface": lambda x: _model((Support("block", ("x",), x),)),
    "Force.force": lambda x: _model(loads=[fcsim.Force("block", x, surface="z+")]),
    "Traction.traction": lambda x: _model(loads=[fcsim.Traction("block", "z+", x)]),
    "Simulation.solver": lambda x: _simulated(solver=x),
    "Simulation.limits": lambda x: _simulated(limits=x),
    "Simulation.witness": lambda x: _simulated(witness=x),
    "Simulation.initial": lambda x: _simulated(initial=x),
    "SolverSettings.name": lambda x: fcsim.SolverSettings(name=x),
    "gravity": lambda x: _model(gravity=x),
    "gravity(t)": lambda x: _model(gravity=lambda t: x),
    "Everything.model": lambda x: Everything(x, mu=0.3),
    "ExactContacts.model": lambda x: fcsim.ExactContacts(x, mu=0.3),
    "Linkage.model": lambda x: Linkage(x, []),
    "Linkage.links": lambda x: Linkage(_model(), [x]),
    "Detector.pairs": lambda x: Detector(x, 8),
    "Detector.pairs[]": lambda x: Detector([x], 8),
    "RigidBody.points": lambda x: fcsim.RigidBody("a", 1.0, np.eye(3), (0.0, 0.0, 0.0), x),
    "at_rest": fcsim.at_rest,
    "laws_of_bodies.model": lambda x: fcsim.laws_of_bodies(x, {}, Gap()),
    "laws_of_pairs.detector": lambda x: fcsim.laws_of_pairs(x, {}, Gap()),
    "nodal_area": lambda x: fcsim.nodal_area(x, "block", "z+"),
    "without_contact_of": lambda x: fcsim.without_contact_of(Everything(_model(), 0.3), x, []),
    "contact_force": lambda x: fcsim.contact_force("c", x, "block", "z"),
    "displacement": lambda x: fcsim.displacement("c", x, "block", "z", (0.0, 0.0, 0.0)),
    "stress": lambda x: fcsim.stress("c", x, "block", "zz", (0.0, 0.0, 0.0)),
    "support_force": lambda x: fcsim.support_force("c", x, "floor", "z"),
    "support_moment": lambda x: fcsim.support_moment("c", x, "floor", "rz", (0.0, 0.0, 0.0)),
    "check_quality": check_quality,
    "mass_properties": mass_properties,
    "with_surface": lambda x: with_surface(x, "top", lambda p: p[2] > 0),
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_of_another_kind_is_refused_in_one_line(name: str) -> None:
    for value in (3.5, 0, [], {}, (), object(), _raising, np.array([1.0, 2.0])):
        with pytest.raises(fcsim.InputError) as refused:
            OTHERS[name](value)
        assert "\n" not in str(refused.value)


def test_what_a_users_function_raises_is_said_with_its_line() -> None:
    where = re.escape(__file__)
    for model in (
        lambda: _model(gravity=_raising),
        lambda: _model((Support("block", ("x",), "z+", velocity=_raising),)),
        lambda: _model(loads=[fcsim.Force("block", (1.0, 0.0, 0.0), factor=_raising, surface="z+")]),
        lambda: _model((Support("block", ("x",), at=_raising),)),
        lambda: _simulated(scheme=Theta(1e-3, law=Gap(friction=_raising_friction))),
    ):
        with pytest.raises(fcsim.InputError, match=rf"the function raised RuntimeError: no such record \({where}, line \d+\)"):
            model()


def _later(*arguments: float) -> float:
    return 1.0 if arguments[0] < 0.5 else 1 / 0


@pytest.mark.parametrize(
    "more",
    [
        {"gravity": lambda t: (0.0, 0.0, -_later(t))},
        {"loads": [fcsim.Force("block", (1.0, 0.0, 0.0), factor=_later, surface="z+")]},
        {"supports": (Support("block", ("x",), "z+", velocity=_later),)},
    ],
    ids=["gravity", "load", "support"],
)
def test_what_a_function_raises_later_in_the_run_is_one_line_too(more: dict[str, Any]) -> None:
    """What is said as a run begins asks loads and motions at times to come."""
    model = _model(**{"gravity": lambda t: (0.0, 0.0, -10.0), **more})
    with pytest.raises(fcsim.InputError, match=r"at t = .* raised ZeroDivisionError"):
        list(Simulation(model, Everything(model, mu=0.3), Theta(0.1), 10))


@pytest.mark.parametrize("members", [("block", "z-"), "block", None, 3, [("block",)], [("block", 1)], [["block", "z-", "z+"]]], ids=str)
def test_surfaces_of_another_form_are_refused_in_one_line(members: Any) -> None:
    with pytest.raises(fcsim.InputError, match=r"contact_surface: expected a list of \(body, surface\), as .*, got "):
        contact_surface(_model(), members)


def test_values_without_their_names_and_a_problem_of_the_other_form_are_refused_with_the_mend() -> None:
    with pytest.raises(fcsim.InputError, match=r"as SolverSettings\(name='NSN-AC', tol=1e-06\), got 2 without"):
        fcsim.SolverSettings("NSN-AC", 1e-6)  # type: ignore[call-arg]
    assert replace(pickle.loads(pickle.dumps(fcsim.SolverSettings(tol=1e-6))), name="NSN-AC").tol == 1e-6
    problem = fcsim.GlobalProblem(M=np.eye(3), H=np.eye(3), f=np.zeros(3), w=np.array([-1.0, 0.0, 0.0]), mu=np.array([0.5]))
    for judged in (error, scaled_error):
        with pytest.raises(fcsim.InputError, match=r"got a GlobalProblem, .*reduced\(problem\)\.local"):
            judged(problem, np.zeros(3))  # type: ignore[arg-type]
        assert judged(reduced(problem).local, np.zeros(3)) == pytest.approx(1.0)  # r = 0: |q| / |q|


def test_numbers_of_every_kind_that_is_one_are_taken() -> None:
    for value in (1, 1.0, np.float32(1.0), np.int64(1), np.array(1.0)):
        assert is_number(value)
        assert fcsim.Material(value, 0.2, 1000.0).E == 1.0
    assert is_number(float("inf"), infinite=True) and not is_number(float("inf")) and not is_number(float("nan"), infinite=True)
    assert numbers_of([[1, 2], [3, 4.5]]).tolist() == [[1.0, 2.0], [3.0, 4.5]]
    assert numbers_of(["1", "2"]).size == numbers_of([[1], [2, 3]]).size == numbers_of([True]).size == 0
