"""Statics of soft blocks on pins: what links leave free is named by its body and its motion, what they hold is not."""

import re
from dataclasses import replace

import numpy as np
import pytest

import fcsim
from fcsim.errors import InputError
from fcsim.linkage import Ball, Control, Linkage, without_contact_of
from fcsim.mesh import Body, Material, brick, rectangle
from fcsim.mesh.material import AnyMaterial, saint_venant_kirchhoff
from fcsim.timestep.chain import NotConverged
from fcsim.timestep.limits import KinematicsLeft


def pinned(places: list[tuple[float, ...]], *, unit: float = 1.0, kinematics: str = "linear", scheme: object = None) -> fcsim.Simulation:
    """Two soft blocks of 1 m side by side, the first held at its far side, the second on balls at `places`, bent down by its weight."""
    d = len(places[0])
    material, size, cells = Material(1e6 / unit, 0.3, 100.0 / unit**3), (unit,) * d, (2,) * d
    one, other = (brick(name, size, cells, material) if d == 3 else rectangle(name, size, cells, material) for name in ("one", "other"))
    bodies = [Body("one", one), Body("other", other, translation=(unit, *(0.0,) * (d - 1)))]
    held = fcsim.Support("one", ("x", "y", "z")[:d], "x-")
    model = fcsim.build_model(bodies, supports=[held], gravity=lambda t: (*(0.0,) * (d - 1), -9.81 * unit), kinematics=kinematics)
    linkage = Linkage(model, [Ball(f"pin {k}", "one", "other", tuple(unit * x for x in place)) for k, place in enumerate(places)])
    detection = without_contact_of(fcsim.Everything(model, mu=0.3), model, [("one", "other")])
    return fcsim.Simulation(model, detection, scheme or fcsim.QuasiStatic(1.0, 1e-6), 1, linkage=linkage, witness=None)


LINE = [(1.0, 0.0, 0.0), (1.0, 0.5, 0.0), (1.0, 1.0, 0.0)]


def said(simulation: fcsim.Simulation) -> list[str]:
    state = fcsim.State(0.0, np.zeros(simulation.model.n_dofs), np.zeros(simulation.model.n_dofs))
    return [remark for remark in simulation._opening(state) if "mechanism" in remark]


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_three_balls_on_a_line_are_a_hinge_and_end_the_run_with_its_line(unit: float) -> None:
    """The block turned by 90 degrees and was told to turn freely: `kinematics="turning"`."""
    through = f"({unit:.4g}, {0.5 * unit:.4g}, 0)"
    where = re.escape(f"body 'other' free beside 'one', to turn about the line through {through} m along (0, 1, 0)")
    with pytest.raises(KinematicsLeft, match=where):
        list(pinned(LINE, unit=unit))
    with pytest.raises(NotConverged, match=where):
        list(pinned(LINE, unit=unit, kinematics="turning"))


def test_a_hinge_without_a_load_is_named_too() -> None:
    """Two balls above each other: gravity has no moment about their line, so that there is an answer, also of bodies that turn: the balls
    bear the weight, 100 kg x 9.81 m/s^2, and its moment, half a metre beside them, as a couple."""
    places = [(1.0, 0.5, 0.0), (1.0, 0.5, 1.0)]
    (text,) = said(pinned(places))
    assert "turn about the line through (1, 0.5, 0.5) m along (0, 0, 1): " in text
    (step,) = pinned(places, kinematics="turning")
    low, high = (step.link_force(f"pin {k}") for k in range(2))  # on the first block
    weight = 981.0
    assert low + high == pytest.approx([0.0, 0.0, -weight], abs=1e-5 * weight)
    assert (low[0], high[0]) == pytest.approx((-weight / 2, weight / 2), rel=5e-3)  # the arm changes as the blocks bend


def test_one_ball_leaves_three_turns_and_a_pin_of_the_plane_one() -> None:
    (text,) = said(pinned([(1.0, 0.5, 0.5)]))
    assert "one of 3 such motions" in text
    (text,) = said(pinned([(1.0, 0.25)]))
    assert "turn about (1, 0.25) m: " in text


@pytest.mark.parametrize("places", [[(1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.5, 1.0)], [(1.0, 0.0), (1.0, 1.0)]])
def test_what_links_hold_has_no_mechanism(places: list[tuple[float, ...]]) -> None:
    assert not said(pinned(places))
    assert len(list(pinned(places))) == 1


@pytest.mark.parametrize(("along", "free"), [((0.0, 1.0, 0.0), True), ((1.0, 0.0, 0.0), False)])
def test_a_control_holds_the_hinge_unless_it_acts_along_its_line(along: tuple[float, ...], free: bool) -> None:
    """A control has no two bodies, as the other links do."""
    simulation = pinned(LINE)
    assert simulation.linkage is not None
    drive = Control("drive", (("other", (1.5, 0.5, 0.5), 1.0),), along, 0.0)  # moved along x by a turn about y
    assert bool(said(replace(simulation, linkage=Linkage(simulation.model, [drive, *simulation.linkage.links])))) is free


def test_dynamics_follow_it() -> None:
    assert not said(pinned(LINE, scheme=fcsim.Theta(1e-2)))
    with pytest.raises(InputError):
        pinned([(3.0, 0.0, 0.0)])


def cube(material: AnyMaterial, kinematics: str = "turning", beside: float | None = 0.0, z: float = 1.0) -> fcsim.Simulation:
    """A cube of 1 m and 2 t on two balls at the height z above its centre or so far `beside` it [m], None: on an edge whose nodes supports
    hold."""
    body = Body("cube", brick("cube", (1.0, 1.0, 1.0), (2, 2, 2), material), kinematics=kinematics)  # type: ignore[arg-type]
    supports = [fcsim.Support("cube", ("x", "y", "z"), at=(x, 0.0, 1.0)) for x in (0.0, 1.0)] if beside is None else []
    model = fcsim.build_model([body], supports=supports, gravity=(0.0, 0.0, -9.81))
    balls = [Ball(f"ball {x:.0f}", None, "cube", (x, 0.5 + (beside or 0.0), z)) for x in (0.0, 1.0)]
    linkage = None if beside is None else Linkage(model, balls)
    return fcsim.Simulation(model, fcsim.Everything(model, mu=0.3), fcsim.QuasiStatic(1.0, 1e-6), 1, linkage=linkage, witness=None)


@pytest.mark.parametrize("beside", [0.0, 0.01, 0.03])
def test_a_turning_body_hangs_on_two_balls(beside: float) -> None:
    """It "did not settle": its centre comes to hang below the balls, by up to 3.4 degrees, and each bears half of the weight, 2000 kg x
    9.81 m/s^2."""
    simulation = cube(Material(1e8, 0.2, 2000.0), beside=beside)
    (step,) = simulation
    weight = simulation.model.groups[0].nodal_volume
    assert weight @ simulation.model.positions(step.state.x)[:, 1] / weight.sum() == pytest.approx(0.5 + beside, abs=1e-8)
    for name in ("ball 0", "ball 1"):
        assert step.link_force(name)[1:] == pytest.approx([0.0, -9810.0], abs=9810 * 1e-6)  # on the ground


@pytest.mark.parametrize(("beside", "z"), [(0.0, 0.0), (0.001, 0.0), (0.02, 0.0), (0.0, 0.4)])
def test_a_turning_body_that_balances_on_two_balls_is_no_answer(beside: float, z: float) -> None:
    """Below its centre they cannot hold it. It came to stand upright above them, turned against its weight by up to 2.3 degrees."""
    with pytest.raises(NotConverged, match="statics of turning bodies of linear material have no stiffness"):
        list(cube(Material(1e8, 0.2, 2000.0), beside=beside, z=z))


def test_a_turning_body_that_falls_far_says_why_statics_end() -> None:
    with pytest.raises(NotConverged, match="statics of turning bodies of linear material have no stiffness by the stress in them"):
        list(cube(Material(1e7, 0.2, 2000.0), beside=None))


def test_a_body_of_finite_strain_that_hangs_already_has_the_stiffness_of_its_stress() -> None:
    """What the error advises, where bodies hang: half of the weight on each ball."""
    (step,) = cube(saint_venant_kirchhoff(1e7, 0.2, 2000.0))
    for name in ("ball 0", "ball 1"):
        assert step.link_force(name)[2] == pytest.approx(-9810.0, rel=1e-6)
