"""Two cubes pressed on each other: sizes of FCLIB's set Cubes_H8, patch test, balance of forces.

Sizes: 2 (n + 1)^3 3 degrees of freedom. Patch test (Taylor and Papadopoulos 1991): with nu = 0 two cubes of side L in series carry the
uniform pressure compression / (L / E_upper + L / E_lower), whatever the friction. A single pass of nodes against facets can pass it on
matching meshes only: on others a node's force goes to a facet's nodes by the shape functions at its foot, which is not what a uniform
pressure gives them. Four Gauss points a face leave the solver enough reactions (hyperstatic) to pass it on any mesh.
"""

import resource
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.elasticity import pressure as pressure_load
from fcsim.assembly.stress import stress_operator
from fcsim.export_fclib import read_fclib
from fcsim.running.case import CaseScript, load_case
from fcsim.running.fclib_series import write_step
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

CASE = Path(__file__).parents[2] / "cases" / "two_cubes"
E_UPPER, E_LOWER, COMPRESSION = 1e9, 4e9, 0.02
UNIFORM = COMPRESSION / (1 / E_UPPER + 1 / E_LOWER)
FACES = (("upper", "z+"), ("lower", "z-"))


@cache
def script() -> CaseScript:
    return load_case(CASE)


def simulation(**parameters: Any) -> Simulation:
    p = script().parameters(E_upper=E_UPPER, E_lower=E_LOWER, compression=COMPRESSION, **parameters)
    return script().build(p).simulation


def nodal_pressure(run: Simulation, step: Step) -> np.ndarray:
    """H r on the nodes of the upper cube's face over what a unit pressure gives them."""
    model = run.model
    upper = model.number["upper"]
    own = slice(model.dof_offset[upper], model.dof_offset[upper + 1])
    unit = pressure_load(model.deformable[upper].part, "z-", 1.0).reshape(-1, 3)[:, 2]
    force = (step.H @ step.result.r)[own].reshape(-1, 3)[:, 2]
    assert np.abs(force[unit == 0]).max() == 0
    return force[unit > 0] / unit[unit > 0]


@pytest.mark.parametrize(("elements", "dofs", "nodes", "faces"), [(2, 162, 9, 4), (5, 1296, 36, 25), (20, 55566, 441, 400)])
def test_sizes(elements: int, dofs: int, nodes: int, faces: int) -> None:
    """All driven degrees of freedom are kept, as in FCLIB's files."""
    for candidates, contacts in (("nodes", nodes), ("faces", faces)):
        run = simulation(elements=elements, candidates=candidates)
        assert run.model.n_dofs == dofs
        assert len(run.detector(run.model.reference)) == contacts


@pytest.mark.parametrize("elements", [2, 5])
def test_exported_problem(elements: int, tmp_path: Path) -> None:
    step = next(iter(simulation(elements=elements, candidates="faces")))
    paths = write_step(tmp_path, step, "FCSIM_Cubes_H8", ("global",))
    problem = read_fclib(paths[0]).problem
    assert (problem.n, problem.nc) == (6 * (elements + 1) ** 3, elements**2)
    assert np.all(problem.mu == 0.3)  # as in FCLIB's file CubeH8


@pytest.mark.each_value
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize(
    ("elements", "lower", "candidates"), [(5, 0, "nodes"), (4, 0, "faces"), (4, 0, "gauss"), (4, 2, "gauss"), (4, 3, "gauss")]
)
def test_patch_test_is_passed(mu: float, elements: int, lower: int, candidates: str) -> None:
    run = simulation(elements=elements, lower_elements=lower, candidates=candidates, nu=0.0, mu=mu, steps=2)
    last = list(run)[-1]
    # the problem with more reactions than the bodies can tell apart is solved to 1e-8 of the displacement, not of the stress
    exact = 1e-6 if candidates != "gauss" else 1e-5
    assert_allclose(nodal_pressure(run, last), UNIFORM, rtol=exact)
    for body, model in ((body, run.model) for body in run.model.deformable):
        own = slice(*model.dof_offset[model.number[body.name] : model.number[body.name] + 2])
        stress = (stress_operator(body.part) @ last.state.x[own]).reshape(-1, 6)
        assert_allclose(stress, np.tile([0, 0, -UNIFORM, 0, 0, 0], (len(stress), 1)), atol=exact * UNIFORM)


@pytest.mark.parametrize(("elements", "lower"), [(5, 4), (5, 7), (10, 8)])
def test_nodes_against_facets_on_other_meshes(elements: int, lower: int) -> None:
    """What is achieved: the force within 0.5 %, single nodes off by up to a fifth, and refinement does not help these."""
    run = simulation(elements=elements, lower_elements=lower, nu=0.0, steps=1)
    last = next(iter(run))
    off = np.abs(nodal_pressure(run, last) / UNIFORM - 1)
    assert last.contact_force_on(1)[2] == pytest.approx(UNIFORM, rel=5e-3)
    assert off.max() < 0.2
    assert off.max() > 0.01  # it does not pass


@pytest.mark.parametrize("lower", [0, 4])
def test_forces_balance_at_every_step(lower: int) -> None:
    """nu = 0.3: what the platen presses, the joint and the ground carry; sideways the cube's symmetry leaves nothing."""
    run = simulation(elements=5, lower_elements=lower)
    model = run.model
    for step in run:
        top, bottom = (step.support_impulse[model.dof_of_node[np.unique(model.facets(*f))]].sum(axis=0) for f in FACES)
        joint = step.contact_force_on(model.number["upper"])
        force = joint[2]
        assert 0.8 * UNIFORM * step.number / 10 < force < 1.35 * UNIFORM * step.number / 10  # between nu = 0 and no lateral strain
        assert_allclose(top, [0, 0, -force], atol=1e-6 * force)
        assert_allclose(bottom, [0, 0, force], atol=1e-6 * force)
        assert_allclose(step.contact_force_on(model.number["lower"]), -joint, atol=1e-9 * force)
        assert step.penetration <= 1e-9
        assert step.friction_dissipation >= -1e-8 * force * COMPRESSION


@pytest.mark.slow
def test_twenty_elements_in_time_and_memory(tmp_path: Path) -> None:
    """55 566 degrees of freedom: the median step takes less than 5 s, the process less than 4 GiB."""
    command = [sys.executable, "-m", "fcsim", "run", str(CASE), "--set", "elements=20", "--steps", "5", "--out", str(tmp_path / "run")]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 < 4 * 2**30
    header, *rows = (tmp_path / "run" / "steps.csv").read_text().splitlines()
    columns = [k for k, name in enumerate(header.split(",")) if name.startswith("seconds_")]
    seconds = [sum(float(row.split(",")[k]) for k in columns) for row in rows]
    assert len(seconds) == 5 and np.median(seconds) < 5


def test_cubes_that_are_drawn_apart_bear_nothing() -> None:
    """A compression below 0 was refused by the name of another argument, the solver's floor."""
    p = script().parameters(elements=1, steps=1, compression=-0.01)
    step = next(iter(script().build(p).simulation))
    assert not len(step.contacts) or np.abs(step.result.r).max() == 0.0
