"""Crack growth in a joint between beams: the double cantilever beam's load and opening, and the energy that fracture takes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Cohesive
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.running.sensors import support_force
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

LENGTH, DEPTH, CRACK, E, STRENGTH, G_HALF = 0.08, 0.01, 0.03, 1e10, 1e7, 50.0


@pytest.mark.parametrize(("cells", "steps", "within"), [((80, 4), 240, 0.09), pytest.param((160, 8), 480, 0.045, marks=pytest.mark.slow)])
def test_a_double_cantilever_beam_opens_by_its_fracture_energy(cells: tuple[int, int], steps: int, within: float) -> None:
    """Half of the specimen on its plane of symmetry, which takes half of the fracture energy: with G = F^2 a^2 / (2 b E I) and the opening
    d = F a^3 / (3 E I) a growing crack has F^2 d = (2 b E I G)^(3/2) / (3 E I), wherever its tip is (and whatever the root gives way).
    The strength of a load step is that of its beginning, so F comes out too large by an error of first order in the step.

    The work that fracture has done is G times the fractured area, and what the supports supply, less what the beam and the joint hold
    and the load steps lose; all to what the solver's tolerance leaves."""
    part = rectangle("beam", (LENGTH, DEPTH), cells, Material(E, 0.0, 1000.0), plane="stress", elements="Q1-enhanced")
    lower = part.surfaces["y-"]
    bonded = lower[part.points[lower][:, :, 0].min(axis=1) > CRACK - 1e-9]
    part = replace(part, surfaces={**part.surfaces, "bond": bonded})
    floor = rigid_rectangle("floor", (2 * LENGTH, LENGTH), (LENGTH / 2, -LENGTH / 2), 1.0)
    stiffness = E * DEPTH**3 / 12
    opening = 3 * np.sqrt(2 * stiffness * G_HALF) * CRACK**2 / (3 * stiffness)
    supports = [Support("floor", ("x", "y", "rz")), Support("beam", ("x", "y"), "x+"), Support("beam", ("y",), "x-", velocity=opening)]
    model = build_model([Body("beam", part), floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("beam", "bond")]), contact_surface(model, [("floor", "y+")]), 0.0, 1e-3)
    law = Cohesive(tension=STRENGTH, mode_1=G_HALF, mode_2=G_HALF)
    settings = SolverSettings(name="auto", tol=1e-7, floor=1e-9)
    found = list(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1 / steps, 0.0, law), steps, settings, witness=None))
    sensor = support_force("F", model, "beam", "y", "x-")
    d, F = np.array([(opening * step.state.t, sensor.measure(step)) for step in found]).T
    growing = slice(6 * steps // 10, steps)
    assert_allclose(F[growing] ** 2 * d[growing], (2 * stiffness * G_HALF) ** 1.5 / (3 * stiffness), rtol=within)
    last = found[-1]
    fractured = last.law_variables["fracture"] * (LENGTH / cells[0])
    assert np.count_nonzero(last.law_variables["fracture"] == 1) > 8
    work = last.law_variables["work_1"].sum()
    assert_allclose(work, G_HALF * fractured.sum(), rtol=0.01)
    supplied = sum(step.energy.support_work - step.energy.numerical_dissipation for step in found)
    assert_allclose(supplied - last.energy.elastic, work, rtol=1e-3)
    assert_allclose(-sum(step.energy.contact_gain for step in found), work - last.energy.contact, rtol=1e-3)
