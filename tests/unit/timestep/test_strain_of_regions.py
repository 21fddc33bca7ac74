"""What a run says of strain in bodies of several materials, in several units: the regions whose law is of small strain count, and of them
the stretch alone, however they turn."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.kinematics.deformation import DeformationMeasure
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle, rigid_box
from fcsim.mesh.material import ByRegion, Material, Plastic, neo_hooke
from fcsim.mesh.part import Body, Part
from fcsim.timestep.limits import KinematicsLeft
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

UNITS = {"m kg s": (1.0, 1.0), "mm t s": (1e3, 1e-3), "km t s": (1e-3, 1e-3)}


def halves(length: float, left: Any, right: Any) -> Part:
    part = brick("bar", (0.4 * length, 0.1 * length, 0.1 * length), (4, 1, 1), Material(1.0, 0.0, 1.0))
    middle = part.points[part.cells].mean(axis=1)[:, 0]
    regions = {"left": np.flatnonzero(middle < 0.2 * length), "right": np.flatnonzero(middle > 0.2 * length)}
    return replace(part, material=ByRegion({"left": left, "right": right}), regions=regions)


def pulled(length: float, part: Part, shares: list[float]) -> tuple[list[list[str]], str]:
    """What is said of strain in each step of a bar whose end is pulled to these shares of its length, and with what it ends."""
    steps = np.diff([0.0, *shares]) * 0.4 * length
    model = build_model(
        [Body("bar", part), rigid_box("far", (length,) * 3, (1e2 * length, 0, 0), 1.0)],
        supports=[
            Support("bar", ("x", "y", "z"), "x-"),
            Support("bar", ("x",), "x+", velocity=lambda t: float(steps[min(int(t), len(steps) - 1)])),
            Support("far", ("x", "y", "z", "rx", "ry", "rz")),
        ],
    )
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies)
    detector, said, end = Detector([SurfacePair(slave, master, 0.0, 1e-3 * length)], model.n_nodes), list[list[str]](), ""
    try:
        for step in Simulation(model, detector, QuasiStatic(1.0), len(steps)):
            said.append([remark for remark in step.remarks if "strained" in remark])
    except KinematicsLeft as error:
        end = str(error)
    return said, end


@pytest.mark.parametrize("unit", UNITS)
def test_the_region_of_small_strain_is_named_and_ends_the_run(unit: str) -> None:
    """Rubber a hundred times softer beside it takes all of the strain: nothing is to be said; as stiff as it, both have half."""
    length, mass = UNITS[unit]
    E, density = 1e7 * mass / length, 1e3 * mass / length**3
    small = Material(E, 0.0, density)
    said, end = pulled(length, halves(length, neo_hooke(0.01 * E, 0.0, density), small), [0.1, 0.2, 0.3])
    assert said == [[], [], []] and not end
    said, end = pulled(length, halves(length, neo_hooke(E, 0.0, density), small), [0.03, 0.08, 0.12, 0.3])
    assert [len(own) for own in said] == [0, 1, 0, 0]
    assert "body 'bar' is strained by" in said[1][0]
    assert "step 4" in end and "body 'bar' is strained by" in end


def test_bending_by_any_angle_is_no_strain_of_laws_of_points() -> None:
    """A thin strip bent to an arc of 180 degrees: strains are those of straight cells, at the upper and lower faces by the chord, however
    far they have turned. (A linear material has one frame for the body: beyond it turning counts.)
    """
    n, length, height, angle = 24, 1.0, 0.01, np.pi

    def strained(material: Any) -> float:
        part = rectangle("strip", (length, height), (n, 1), material, origin=(0.0, -0.5 * height))
        model = build_model([Body("strip", part, kinematics="turning")])
        s, y = part.points.T
        turn, radius = angle * s / length, length / angle
        place = np.stack([(radius - y) * np.sin(turn), radius - (radius - y) * np.cos(turn)], axis=1)
        return float(DeformationMeasure(model.groups, 1)((place - part.points).ravel()).strain[0])

    half = 0.5 * angle / n
    outermost = 1 - (1 - 0.5 * height * angle / length) * np.sin(half) / half
    assert_allclose(strained(Plastic(1e9, 0.3, 1e3, 1e6)), outermost, rtol=1e-3)
    assert strained(Material(1e9, 0.3, 1e3)) > 0.2
