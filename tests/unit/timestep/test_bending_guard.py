"""What a run says of bodies that bend: parts that turn while the body does not, and the stretch that small rotations leave out."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.kinematics.deformation import DeformationMeasure
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle, rigid_rectangle
from fcsim.mesh.material import Material, Orthotropic, Plastic, saint_venant_kirchhoff
from fcsim.mesh.part import Body, Part
from fcsim.timestep.limits import KinematicsLeft, Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

E, NU, L, H = 2e11, 0.3, 1.0, 0.02
PLANE, INERTIA = E / (1 - NU**2), H**3 / 12
EVERY = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)


def strip(elements: str, cells: tuple[int, int], material: Any = None) -> Part:
    cell = "triangle" if elements.startswith("P") else "quadrilateral"
    return rectangle("strip", (L, H), cells, material or Material(E, NU, 7800.0), elements=elements, cell=cell)


def bent(part: Part, held: tuple[str, ...], force: float, limits: Limits, steps: int = 1) -> tuple[Model, list[Step], str]:
    """Under a uniform load (force per length) that grows, held at the surfaces, and with what the run ends."""
    supports = [Support("strip", ("x", "y"), side) for side in held] + [Support("far", ("x", "y", "rz"))]
    weight = force / (H * part.material.density)
    bodies = [Body("strip", part), rigid_rectangle("far", (1.0, 1.0), (0.0, 100.0), 1.0)]
    model = build_model(bodies, supports=supports, gravity=lambda t: (0.0, -t * weight))
    done: list[Step] = []
    try:
        for step in Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0 / steps), steps, limits=limits, witness=None):
            done.append(step)
    except KinematicsLeft as error:
        return model, done, str(error)
    return model, done, ""


def said(steps: list[Step]) -> list[str]:
    return [text for step in steps for text in step.remarks if "bent" in text]


@pytest.mark.parametrize(
    ("elements", "cells"), [("Q1-enhanced", (40, 1)), ("Q2", (20, 1)), ("P2", (20, 1)), ("Q1", (200, 8)), ("P1", (400, 10))]
)
def test_what_is_left_out_between_two_clamps(elements: str, cells: tuple[int, int]) -> None:
    """w = 16 w0 s^2 (1 - s)^2: the mean of w'^2 / 2 is 2.438 (w0/L)^2, so that its stretch has 0.348 (w0/h)^2 of the energy of bending."""
    model, (step,), _ = bent(strip(elements, cells), ("x-", "x+"), 384 * PLANE * INERTIA * 0.5 * H / L**4, EVERY)
    found = DeformationMeasure(model.groups, 1)(step.state.x)
    w = -step.state.x[: model.n_elastic].reshape(-1, 2)[:, 1].min() / H
    assert 0.45 < w < 0.52
    assert_allclose(found.left_out[0], 12 * (1024 / 420) ** 2 / 204.8 * w**2, rtol=0.05)
    assert [text for text in said([step]) if "would be stretched" in text]


@pytest.mark.parametrize(("elements", "cells"), [("Q1-enhanced", (10, 1)), ("Q2", (20, 1)), ("P2", (10, 1)), ("Q1", (100, 4))])
def test_a_cantilever_draws_in(elements: str, cells: tuple[int, int]) -> None:
    """Bent by twice its thickness: nothing stretches it, and its turning is named."""
    model, (step,), _ = bent(strip(elements, cells), ("x-",), 8 * PLANE * INERTIA * 2 * H / L**4, EVERY)
    assert DeformationMeasure(model.groups, 1)(step.state.x).left_out[0] == 0.0
    assert not said([step])
    (turned,) = (text for text in step.remarks if "has turned by" in text)
    assert "saint_venant_kirchhoff" in turned and "turning" not in turned  # a frame would not cover that


@pytest.mark.parametrize("law", ["linear", pytest.param("orthotropic", marks=pytest.mark.slow), "plastic"])
def test_a_clamped_strip_is_named_once_and_ends_the_run(law: str) -> None:
    """Its mean rotation and its strain are nothing to speak of."""
    materials = {
        "linear": Material(E, NU, 7800.0),
        "orthotropic": Orthotropic((E, E, E), (NU, NU, NU), (E / (2 + 2 * NU),) * 3, 7800.0),
        "plastic": Plastic(E, NU, 7800.0, 1e11),
    }
    force, steps = 384 * PLANE * INERTIA * 2 * H / L**4, 10
    part = strip("Q2", (16, 1), materials[law])
    _, done, end = bent(part, ("x-", "x+"), force, Limits(), steps)
    assert len([text for text in said(done) if "would be stretched" in text]) == 1
    assert "would be stretched by" in end and "Limits(left_out=...)" in end
    assert ('kinematics="turning"' if law == "plastic" else "saint_venant_kirchhoff") in end
    assert 5 <= len(done) <= 7  # 0.348 (w/h)^2 is 0.5 at w = 1.2 h, the sixth of ten steps to 2 h
    _, done, end = bent(part, ("x-", "x+"), force, EVERY, steps)
    assert len(done) == steps and not end
    assert len(said(done)) == 2  # parts of it have turned by more than 2 degrees, too


def test_a_body_that_covers_it_is_not_named() -> None:
    """The same with Green and Lagrange's strain, which is stiffer: w0 / h + 0.7 (w0 / h)^3 = 2 has w0 = 1.1 h."""
    force = 384 * PLANE * INERTIA * 2 * H / L**4
    model, done, end = bent(strip("Q2", (16, 1), saint_venant_kirchhoff(E, NU, 7800.0)), ("x-", "x+"), force, Limits(), 2)
    w = -done[-1].state.x[: model.n_elastic].reshape(-1, 2)[:, 1].min() / H
    assert 1.0 < w < 1.2 and not said(done) and not end


def test_parts_of_a_turning_body_turn_from_its_frame() -> None:
    """Bent to an arc of 20 and 60 degrees, ends turned by half of that from the middle; the whole of it turned by any angle."""
    part = rectangle("strip", (L, H), (60, 1), Material(E, NU, 7800.0), origin=(0.0, -0.5 * H))
    model = build_model([Body("strip", part, kinematics="turning")])
    s, y = part.points.T
    for angle in np.radians([20.0, 60.0]):
        turn, radius = angle * (s / L - 0.5) + 2.0, L / angle
        place = np.stack([(radius - y) * np.sin(turn), -(radius - y) * np.cos(turn)], axis=1)
        found = DeformationMeasure(model.groups, 1)((place - part.points).ravel())
        assert_allclose(found.bent[0], 0.5 * angle * (1 - 1 / 60), rtol=1e-2)
        assert_allclose(found.rotation[0], 2.0, rtol=1e-6)
        assert found.left_out[0] < 1e-2
    found = DeformationMeasure(model.groups, 1)((part.points[:, ::-1] * [-1.0, 1.0] - part.points).ravel())
    assert found.bent[0] < 1e-12 and found.left_out[0] == 0.0


def test_a_cantilever_in_a_frame_is_told_how_stiff_it_is() -> None:
    """A turning body whose parts turn from its frame is strained by that; what is left out tells how far off it is: 14 % of energy, 29 %
    of the deflection."""

    def tip(material: Any, kinematics: Any, elements: str) -> tuple[float, list[Step], Model]:
        part = rectangle("strip", (1.5, 0.1), (12, 2), material, elements=elements)
        bodies = [Body("strip", part, kinematics=kinematics), rigid_rectangle("far", (1.0, 1.0), (0.0, 100.0), 1.0)]
        supports = [Support("strip", ("x", "y"), "x-"), Support("far", ("x", "y", "rz"))]
        model = build_model(bodies, supports=supports, gravity=lambda t: (0.0, -600.0 * t))
        done = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.2), 5, witness=None))
        return float(done[-1].state.x[: model.n_elastic].reshape(-1, 2)[:, 1].min()), done, model

    right, done, _ = tip(saint_venant_kirchhoff(1e9, 0.3, 1e3), None, "Q2")
    assert not said(done)
    framed, done, model = tip(Material(1e9, 0.3, 1e3), "turning", "Q1-enhanced")
    share = DeformationMeasure(model.groups, 1)(done[-1].state.x).left_out[0]
    assert_allclose(2 * share, 1 - framed / right, rtol=0.1)
    assert len(said(done)) == 2


def test_a_free_strip_that_swings_by_more_than_its_frame_covers() -> None:
    """Thrown into its first bending shape, about: its ends turn, its mean does not; named at 2, ended at 10 degrees."""
    part = rectangle("strip", (L, H), (20, 1), Material(1e7, 0.0, 1000.0), elements="Q1-enhanced", origin=(0.0, -0.5 * H))
    model = build_model([Body("strip", part), rigid_rectangle("far", (1.0, 1.0), (0.0, 100.0), 1.0)])
    v = np.zeros(model.n_dofs)
    s = 2 * part.points[:, 0] / L - 1
    v[: model.n_elastic].reshape(-1, 2)[:, 1] = 1.5 * (s**2 - 1 / 3)
    start, done = State(0.0, np.zeros(model.n_dofs), v), []
    with pytest.raises(KinematicsLeft, match=r"a part of it has turned by .* degrees from the body's frame, allowed are 10"):
        for step in Simulation(model, Everything(model, mu=0.0), Theta(2e-3), 200, initial=start, witness=None):
            done.append(step)
    assert len([text for text in said(done) if "a part of it has turned" in text]) == 1


@pytest.mark.parametrize("d", [2, 3])
def test_strain_of_a_single_row_of_cells_that_bends(d: int) -> None:
    """kappa h / 2 in the outer fibres, in the middle of the cells none; five times as long as high, and turned."""
    make: Any = rectangle if d == 2 else brick
    size, corner = (0.5, *(0.1,) * (d - 1)), (-0.25, *(-0.05,) * (d - 1))
    part = make("block", size, (1,) * d, Material(E, 0.0, 1.0), elements="Q1-enhanced", origin=corner)
    model = build_model([Body("block", part)])
    kappa, (x, y) = 0.2, part.points.T[:2]
    u = np.zeros_like(part.points)
    u[:, 0] = -kappa * x * y
    assert_allclose(DeformationMeasure(model.groups, 1)(u.ravel()).strain[0], kappa * 0.05, rtol=1e-3)


def test_a_limit_that_is_none() -> None:
    with pytest.raises(InputError, match="Limits, left_out: expected a number > 0"):
        Limits(left_out=0.0)
