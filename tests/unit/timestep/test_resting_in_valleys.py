"""Statics on facets' own normals: nodes that come to rest in a valley between facets are held by all of them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh import Body, Part
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

ANYWHERE = Limits(rotation=np.inf, strain=np.inf)


def lowered(part: Part, x: float, y: float, by: float) -> Part:
    """The part with its node at (x, y) lower."""
    points = part.points.copy()
    points[np.argmin(np.linalg.norm(points - [x, y], axis=1)), 1] -= by
    return Part(part.name, points, part.cells, part.cell_type, part.surfaces, part.material)


def test_a_tip_in_a_groove_is_held_as_statics_says() -> None:
    """A tip pressed into a V and pushed to the side without friction: N_1 r_1 + N_2 r_2 is the force on it, two equations for r_1, r_2."""
    bed = lowered(rectangle("bed", (2.0, 1.0), (2, 2), neo_hooke(1e6, 0.3, 1.0)), 1.0, 1.0, 0.2)
    punch = lowered(rectangle("punch", (0.4, 0.4), (2, 2), neo_hooke(3e6, 0.3, 1.0)), 0.2, 0.0, 0.15)
    supports = [
        Support("bed", ("x", "y"), "y-"),
        Support("punch", ("y",), "y+", velocity=-0.02),
        Support("punch", ("x",), "y+", velocity=lambda t: 0.002 if t > 1 else 0.0),
    ]
    model = build_model([Body("bed", bed), Body("punch", punch, translation=(0.795, 0.95))], supports=supports)
    surfaces = (contact_surface(model, [of]) for of in (("punch", "y-"), ("bed", "y+")))
    detection = Detector([SurfacePair(*surfaces, 0.0, 0.05)], model.n_nodes)
    top = model.dof_of_node[np.unique(model.facets("punch", "y+"))]
    held = 0
    for step in Simulation(model, detection, QuasiStatic(0.5), 4, SolverSettings(tol=1e-12), limits=ANYWHERE, witness=None):
        r = step.reaction.reshape(-1, 2)[:, 0]
        pressed = r > 0
        assert_allclose(step.contacts.frame[pressed, 0].T @ r[pressed], -step.support_impulse[top].sum(axis=0), rtol=1e-7, atol=1e-4)
        if pressed.sum() == 2:
            held += 1
            assert_allclose(step.contacts.gap[pressed], 0.0, atol=1e-9)
            assert_allclose(
                np.linalg.solve(step.contacts.frame[pressed, 0].T, -step.support_impulse[top].sum(axis=0)), r[pressed], rtol=1e-6
            )
    assert held


def drawn(dimension: int, mu: float, slide: float) -> list[Step]:
    """A punch pressed by a fifth into a bed of facets longer than its own, and drawn along it, in two steps each."""
    soft, hard, up = neo_hooke(1e6, 0.3, 1.0), neo_hooke(3e6, 0.3, 1.0), "xyz"[dimension - 1]
    if dimension == 2:
        bed, block, place = rectangle("bed", (4.0, 1.0), (4, 2), soft), rectangle("punch", (0.5, 0.5), (3, 3), hard), (0.6, 1.0)
    else:
        bed, block = brick("bed", (2.0, 1.0, 0.5), (4, 2, 1), soft), brick("punch", (0.5, 0.5, 0.3), (2, 2, 1), hard)
        place = (0.37, 0.21, 0.5)
    depth = 0.2 if dimension == 2 else 0.1
    supports = [
        Support("bed", tuple("xyz"[:dimension]), f"{up}-"),
        Support("punch", (up,), f"{up}+", velocity=lambda t: -depth if t < 1 else 0.0),
        Support("punch", ("x",), f"{up}+", velocity=lambda t: slide if t > 1 else 0.0),
    ]
    if dimension == 3:
        supports.append(Support("punch", ("y",), f"{up}+"))
    model = build_model([Body("bed", bed), Body("punch", block, translation=place)], supports=supports)
    surfaces = (contact_surface(model, [of]) for of in (("punch", f"{up}-"), ("bed", f"{up}+")))
    detection = Detector([SurfacePair(*surfaces, mu, 0.05)], model.n_nodes)
    return list(Simulation(model, detection, QuasiStatic(0.5), 4, SolverSettings(tol=1e-12), limits=ANYWHERE, witness=None))


@pytest.mark.parametrize(("dimension", "mu", "slide"), [(2, 0.0, 0.1), (3, 0.3, 0.2)])
def test_drawn_over_a_valley_it_settles_quadratically(dimension: int, mu: float, slide: float) -> None:
    """Whole steps, the last iteration of each of second order; some node is held by more facets than one."""
    shared = 0
    for step in drawn(dimension, mu, slide):
        assert step.substeps == 1
        residuals = [max(problem.residual, problem.result.error) for problem in step.linearised]
        assert residuals[-1] < 1e-9 and residuals[-1] < max(1e-2 * residuals[-2], 1e-10)
        slave = step.contacts.nodes[step.reaction.reshape(-1, dimension)[:, 0] > 0, 0]
        shared += len(slave) > len(np.unique(slave))
    assert shared
