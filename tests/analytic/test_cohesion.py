"""Joints that hold together: strengths, fracture energies and energy release, from closed forms."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Cohesive, Gap, JointLost, Springs, laws_of_bodies, laws_of_pairs
from fcsim.errors import InputError
from fcsim.mesh.blocks import rigid_box
from fcsim.running.checkpoint import read_checkpoint, write_checkpoint
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.step import Step

HELD = ("x", "y", "z", "rx", "ry", "rz")
AREA, TENSION, G_1, G_2 = 0.5, 2e5, 20.0, 60.0
SETTINGS = SolverSettings(tol=1e-6, floor=1e-9)
STIFF = Springs(normal=1e10, tangential=2e9)
"""A held plate's normal force is determined by springs alone."""


def joint(law: Any, steps: int, *, lift: Any = 0.0, push: Any = 0.0, mu: float = 0.6, alert: float = 0.01) -> Simulation:
    """A rigid plate of 1 m x 0.5 m glued on a held floor, driven by displacements (velocities [m/s] over steps of 1 s)."""
    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), 4.0), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    supports = [
        Support("floor", HELD),
        Support("plate", ("rx", "ry", "rz", "y")),
        Support("plate", ("x",), velocity=push),
        Support("plate", ("z",), velocity=lift),
    ]
    model = build_model([plate, floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), mu, alert, name="joint")
    return Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, 0.0, law), steps, SETTINGS, witness=None)


def force(steps: list[Step]) -> np.ndarray:
    return np.array([step.contact_force_on(0) for step in steps])


def test_peel_of_one_joint() -> None:
    """Traction falls linearly from f_t to zero at 2 G_I / f_t; the work is G_I A, all of it dissipated."""
    opening, n = 2 * G_1 / TENSION, 400
    steps = list(joint(Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2), int(1.2 * n), lift=opening / n))
    found = -force(steps)[:, 2]
    way = np.arange(len(steps)) / n  # at the beginning of the step, as the law takes its strength
    assert_allclose(found, TENSION * AREA * np.maximum(1 - way, 0), atol=0.05 * TENSION * AREA)
    work = float(found.sum()) * opening / n
    assert work == pytest.approx(G_1 * AREA, rel=5e-3)
    last = steps[-1]
    assert_allclose(last.law_variables["fracture"], 1.0)
    assert last.law_variables["work_1"].sum() == pytest.approx(work, rel=1e-9)
    assert -sum(step.energy.contact_gain for step in steps) == pytest.approx(G_1 * AREA, rel=5e-3)
    assert last.energy.contact == 0.0


def test_shear_of_one_joint_that_cannot_open() -> None:
    """Shear strength mu f_t falls linearly to zero at 2 G_II / (mu f_t): work G_II A. No pressure, so nothing is left."""
    slip, n = 2 * G_2 / (0.6 * TENSION), 400
    steps = list(joint(Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, springs=STIFF), int(1.2 * n), push=slip / n))
    found = -force(steps)[:, 0]
    assert found[:60].max() == pytest.approx(0.6 * TENSION * AREA, rel=0.07)
    assert float(found.sum()) * slip / n == pytest.approx(G_2 * AREA, rel=5e-3)
    assert_allclose(steps[-1].law_variables["fracture"], 1.0)


def test_friction_is_left_where_the_joint_is_damaged() -> None:
    """Under a held pressure of springs: c i + mu p at first, mu p at last, c given apart from mu f_t."""
    shear, slip, n = 3e5, 2 * G_2 / 3e5, 200
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, shear=shear, springs=STIFF)
    pressed = 1e-5  # m into the springs in the first step: 1e5 Pa
    steps = list(joint(law, int(1.4 * n), lift=lambda t: -pressed if t < 1 else 0.0, push=lambda t: 0.0 if t < 2 else slip / n))
    found = -force(steps)[:, 0] / AREA
    assert found.max() == pytest.approx(shear + 0.6 * 1e5, rel=0.02)
    assert found[-1] == pytest.approx(0.6 * 1e5, rel=1e-3)
    assert steps[-1].law_variables["work_2"].sum() == pytest.approx(G_2 * AREA, rel=0.01)


def test_in_mixed_mode_the_shares_of_the_energies_add_up_to_one() -> None:
    """Half of mode II first, then opened: W_I / G_I + W_II / G_II = 1 at the end."""
    law, n = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, springs=STIFF), 400
    slip, opening = 2 * G_2 / (0.6 * TENSION), 2 * G_1 / TENSION
    half = int(0.3 * n)
    steps = list(joint(law, 2 * n, push=lambda t: slip / n if t < half else 0.0, lift=lambda t: opening / n if t > half else 0.0))
    last = steps[-1].law_variables
    shares = last["work_1"].sum() / (G_1 * AREA), last["work_2"].sum() / (G_2 * AREA)
    assert min(shares) > 0.3 and sum(shares) == pytest.approx(1.0, rel=5e-3)


def test_what_was_not_joined_at_the_start_does_not_stick() -> None:
    """A plate let down on the floor is lifted again without force."""
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2)
    model_steps = joint(law, 5, lift=1e-3)
    gone = [step.contact_force_on(0)[2] for step in joint(law, 8, lift=lambda t: 1e-3 if t < 3 else (-1e-3 if t < 6 else 1e-3))]
    assert next(iter(model_steps)).contact_force_on(0)[2] < 0
    assert gone[-1] == pytest.approx(0.0, abs=1e-9 * TENSION) and gone[-2] == pytest.approx(0.0, abs=1e-9 * TENSION)


def test_a_joint_that_holds_and_is_not_seen_any_more_stops_the_run() -> None:
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2)
    with pytest.raises(JointLost, match=r"4 joints that still hold .* expected an alert distance above"):
        list(joint(law, 10, lift=2e-5, alert=5e-5))


def test_a_run_goes_on_from_its_checkpoint_bit_by_bit(tmp_path: Any) -> None:
    law, opening = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2), 2 * G_1 / TENSION
    whole = list(joint(law, 30, lift=opening / 40, push=opening / 30))
    write_checkpoint(tmp_path / "checkpoint.h5", whole[12])
    stored = read_checkpoint(tmp_path / "checkpoint.h5")
    assert stored is not None
    again = list(joint(law, 30, lift=opening / 40, push=opening / 30).run(*stored))
    assert [step.number for step in again] == list(range(14, 31))
    for one, other in zip(whole[13:], again, strict=True):
        assert_array_equal(one.state.x, other.state.x)
        assert_array_equal(one.reaction, other.reaction)
        for name, values in one.law_variables.items():
            assert_array_equal(values, other.law_variables[name])


def test_two_laws_in_one_model() -> None:
    """One plate glued, one only lying there; both are lifted. By bodies and by pairs."""
    glued, loose = rigid_box("glued", (1.0, 0.5, 0.1), (-1, 0, 0.05), 4.0), rigid_box("loose", (1.0, 0.5, 0.1), (1, 0, 0.05), 4.0)
    floor = rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    supports = [Support("floor", HELD)]
    for name in ("glued", "loose"):
        supports += [Support(name, ("rx", "ry", "rz", "x", "y")), Support(name, ("z",), velocity=1e-6)]
    model = build_model([glued, loose, floor], supports=supports)
    ground = contact_surface(model, [("floor", "z+")])
    pairs = [SurfacePair(contact_surface(model, [(name, "z-")]), ground, 0.6, 0.01, name=name) for name in ("glued", "loose")]
    detector = Detector(pairs, model.n_nodes)
    glue = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2)
    by_bodies = laws_of_bodies(model, {("glued", "floor"): glue}, Gap())
    by_pairs = laws_of_pairs(detector, {"glued": glue}, Gap())
    for law in (by_bodies, by_pairs):
        steps = list(Simulation(model, detector, QuasiStatic(1.0, 0.0, law), 3, SETTINGS, witness=None))
        assert steps[0].contact_force_on(0)[2] == pytest.approx(-TENSION * AREA, rel=1e-6)
        assert all(step.contact_force_on(1)[2] == 0 for step in steps)
        assert steps[-1].law_variables["fracture"].shape == (8,)
    with pytest.raises(InputError, match="expected names of surface pairs"):
        laws_of_pairs(detector, {"mortar": glue}, Gap())
    with pytest.raises(InputError, match="nobody"):
        laws_of_bodies(model, {"nobody": glue}, Gap())


def test_refusals() -> None:
    for options, message in (
        ({"tension": 0.0, "mode_1": 1.0, "mode_2": 1.0}, "tension: expected"),
        ({"tension": 1.0, "mode_1": -1.0, "mode_2": 1.0}, "mode_1: expected"),
        ({"tension": 1.0, "mode_1": 1.0, "mode_2": 1.0, "shear": 0.0}, "shear: expected"),
    ):
        with pytest.raises(InputError, match=message):
            Cohesive(**options)  # type: ignore[arg-type]
