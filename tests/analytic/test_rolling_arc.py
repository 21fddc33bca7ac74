"""Large sliding over many facets: a polygonal arc turns about its centre under an elastic block pressed on it (plane strain).

The circle does not change when it turns, so on the exact surface the reaction would be constant, its moment about the centre zero without
friction and mu R sum r_N with it. What is left is the polygon of n chords: heights vary by the sagitta R (1 - cos(b/2)), b the angle
of a facet, and facet normals are off the radius by up to b/2.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

ARC = 2 * np.pi / 3  # from 30 to 150 degrees
PRESSED = 0.01
MU = 0.3


class History(NamedTuple):
    """Of each step after the press: force on the block (steps, 2) [N per m], moment on the arc, sum of the normal reactions."""

    force: np.ndarray
    moment: np.ndarray
    normal: np.ndarray


def history_of(run: Simulation) -> History:
    """The history of a run whose first step presses; the block is its body 0, what turns body 1."""
    moment = run.model.dof_offset[1] + 2
    _, *turned = run
    return History(
        np.array([step.contact_force_on(0) for step in turned]),
        np.array([(step.H @ step.result.r)[moment] for step in turned]),
        np.array([step.contact_force[:, 0].sum() for step in turned]),
    )


@cache
def turn(n: int, rule: Any, normals: Any = "facet", steps: int = 30, mu: float = 0.0) -> History:
    """Press the block on n chords of the unit circle and turn them by two facets in equal steps."""
    angle = np.linspace(np.pi / 6, np.pi / 6 + ARC, n + 1)
    points = np.column_stack([np.cos(angle), np.sin(angle)])
    arc = RigidBody("arc", 1.0, [[1.0]], [0.0, 0.0], points, {"top": np.column_stack([np.arange(n), np.arange(1, n + 1)])})  # type: ignore[arg-type]
    block = rectangle("block", (0.6, 0.3), (24, 8), Material(1e6, 0.3, 1000.0), origin=(-0.3, 1.0))
    model = build_model(
        [Body("block", block), arc],
        supports=[
            Support("block", ("x",), "y+"),
            Support("block", ("y",), "y+", velocity=lambda t: -PRESSED if t < 1 else 0.0),
            Support("arc", ("x", "y")),
            Support("arc", ("rz",), velocity=lambda t: 2 * ARC / n / steps if t > 1 else 0.0),
        ],
    )
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("arc", "top")]), mu, 0.02, rule, "", normals)
    settings = SolverSettings(tol=1e-10, floor=1e-8)
    return history_of(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0), steps + 1, settings))


RULES = [("nodes", "facet"), ("nodes", "smooth"), ("mortar", "facet")]


@pytest.mark.parametrize(("rule", "normals"), RULES)
def test_reaction_varies_by_the_sagitta(rule: str, normals: str) -> None:
    """The force of a plane contact is about proportional to the approach, of which the sagitta is a part with facets' own normals; finer
    facets, less of it. Surfaces that bulge over their facets leave a fiftieth of that."""
    for n in (20, 40):
        force = turn(n, rule, normals).force[:, 1]
        assert force.min() > 0
        curved = (rule, normals) != ("nodes", "facet")
        assert np.ptp(force) / force.mean() < (0.1 if curved else 1.5) * (1 - np.cos(ARC / n / 2)) / PRESSED


def changes(values: np.ndarray, history: History) -> float:
    """Largest change in a step, relative to the mean reaction."""
    return float(np.abs(np.diff(values, axis=0)).max() / history.normal.mean())


@pytest.mark.parametrize("n", [20, 40])
def test_moment_of_facet_normals(n: int) -> None:
    """Node-to-segment with facet normals: the moment is below b/2 of the force."""
    history = turn(n, "nodes")
    assert 0.05 < np.abs(history.moment / history.normal).max() / (ARC / n / 2) < 1.0


@pytest.mark.slow
def test_facet_normals_make_jumps() -> None:
    """The moment jumps by about b/2 times the share of a node where it passes an edge, however small the steps are."""
    coarse, fine = turn(20, "nodes", steps=60), turn(20, "nodes", steps=180)
    jumps = [changes(h.moment, h) for h in (coarse, fine)]
    assert jumps[1] > 0.8 * jumps[0]
    assert jumps[1] > 0.1 * ARC / 20 / 2


def test_smoothed_normals_have_no_moment_and_no_jumps() -> None:
    """Interpolated between radii along a chord they point to the centre exactly; the force is continuous: a quarter of the step makes well
    below half of the changes."""
    coarse, fine = turn(20, "nodes", "smooth", steps=30), turn(20, "nodes", "smooth", steps=120)
    for history in (coarse, fine, turn(40, "nodes", "smooth")):
        assert np.abs(history.moment / history.normal).max() < 1e-8
    assert changes(fine.force, fine) < 0.45 * changes(coarse.force, coarse)


def test_mortar_has_no_jumps_and_little_moment() -> None:
    """The block's normals are vertical and the forces stand over the middle of the contact, which is that of the arc and not of its chords:
    the moment is a fiftieth of (b/2)^2; both are continuous."""
    coarse, fine = turn(20, "mortar"), turn(40, "mortar")
    for n, history in ((20, coarse), (40, fine)):
        assert np.abs(history.moment / history.normal).max() < max((ARC / n / 2) ** 2 / 20, 1e-4)
    quarter = turn(20, "mortar", steps=120)
    assert changes(quarter.force, quarter) < 0.45 * changes(coarse.force, coarse)
    assert changes(quarter.moment, quarter) < 0.45 * changes(coarse.moment, coarse)


@pytest.mark.parametrize(("rule", "normals"), RULES[1:])
def test_friction_moment(rule: str, normals: str) -> None:
    """All contacts slide: the moment about the centre is mu sum r_N R, R between the chords' nearest and farthest points."""
    n = 40
    history = turn(n, rule, normals, mu=MU)
    sliding = slice(10, None)  # the first facet's turn brings all to slide
    slack = 1e-3 + (1 - np.cos(ARC / n / 2)) + (0 if normals == "smooth" else ARC / n / 2)
    assert_allclose(np.abs(history.moment[sliding] / history.normal[sliding]), MU, rtol=slack)


@cache
def turn_among_everything(n: int, curved: bool, steps: int = 30) -> History:
    """The same with a whole disk of 3 n chords and contact of everything, both ways."""
    angle = np.pi / 6 + 2 * np.pi / (3 * n) * np.arange(3 * n)
    rim = np.column_stack([np.arange(3 * n), np.roll(np.arange(3 * n), -1)])
    disk = RigidBody("disk", 1.0, [[1.0]], [0.0, 0.0], np.column_stack([np.cos(angle), np.sin(angle)]), {"rim": rim})  # type: ignore[arg-type]
    block = rectangle("block", (0.6, 0.3), (24, 8), Material(1e6, 0.3, 1000.0), origin=(-0.3, 1.0))
    model = build_model(
        [Body("block", block), disk],
        supports=[
            Support("block", ("x",), "y+"),
            Support("block", ("y",), "y+", velocity=lambda t: -PRESSED if t < 1 else 0.0),
            Support("disk", ("x", "y")),
            Support("disk", ("rz",), velocity=lambda t: 2 * ARC / n / steps if t > 1 else 0.0),
        ],
    )
    everything = Everything(model, 0.0, 0.02, curved=["disk"] if curved else [])
    settings = SolverSettings(name="auto", tol=1e-10, floor=1e-8)
    return history_of(Simulation(model, everything, QuasiStatic(1.0), steps + 1, settings))


def test_among_everything_a_named_disk_turns_with_less_chatter() -> None:
    """Both bodies' vertices are held, so where one enters or leaves a change is left; the rest goes with the steps. Facet normals keep
    most of it however small these are."""
    coarse, fine = turn_among_everything(20, True), turn_among_everything(20, True, 120)
    assert changes(fine.force, fine) < 0.45 * changes(coarse.force, coarse)
    assert changes(fine.moment, fine) < 0.6 * changes(coarse.moment, coarse)
    sharp = turn_among_everything(20, False, 120)
    assert changes(sharp.moment, sharp) > 2.5 * changes(fine.moment, fine)
    assert np.abs(fine.moment / fine.normal).max() < 0.5 * np.abs(sharp.moment / sharp.normal).max()
