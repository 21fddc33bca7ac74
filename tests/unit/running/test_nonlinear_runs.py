"""Runs with nonlinear bodies: the same bits after going on, internal variables in VTK files, all problems of Newton's method as files."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.export_fclib import read_fclib
from fcsim.running.case import load_case
from fcsim.running.run import RunOptions, run_case
from fcsim.solvers.solve import solve

pv = pytest.importorskip("pyvista")

SCRIPT = '''
from dataclasses import dataclass

import numpy as np

from fcsim import Body, Case, Detector, QuasiStatic, Simulation, Support, SurfacePair, Theta, build_model, contact_surface
from fcsim.mesh import rectangle, rigid_rectangle
from fcsim.mesh.material import (
    ByRegion, FinitePlastic, LinearHardening, Plastic, PointFunction, Thermal, Variable, Viscoelastic, neo_hooke
)
from dataclasses import replace


@dataclass(frozen=True)
class Parameters:
    steps: int = 8
    dynamic: bool = False
    material: str = "metal"


def damage(strain, before, at):
    """sigma = E (1 - D) eps, 1 - D = limit / k, k the largest |eps| so far."""
    E, limit = 2e7, 1e-2
    size = np.sqrt(np.einsum("nij,nij->n", strain, strain))
    k = np.maximum(np.maximum(size, before[:, 0]), limit)
    unit = 0.5 * (np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3)) + np.einsum("il,jk->ijkl", np.eye(3), np.eye(3)))
    growing = np.where((size >= k) & (size > limit), limit / k**3, 0.0)
    tangent = E * ((limit / k)[:, None, None, None, None] * unit - np.einsum("n,nij,nkl->nijkl", growing, strain, strain))
    energy = 0.5 * E * size**2
    lost = (limit / np.maximum(before[:, 0], limit) - limit / k) * energy
    return E * (limit / k)[:, None, None] * strain, tangent, k[:, None], limit / k * energy, lost


LOWER = {
    "metal": Plastic(2e7, 0.3, 1000.0, LinearHardening(2e5, 1e6)),
    "finite metal": FinitePlastic(2e7, 0.3, 1000.0, LinearHardening(2e5, 1e6)),
    "viscous": Viscoelastic(2e7, 0.3, 1000.0, ((0.3, 1e-3), (0.2, 0.5))),
    "warm metal": Thermal(Plastic(2e7, 0.3, 1000.0, LinearHardening(2e5, 1e6)), 1e-4, lambda X, t: 50 * np.tanh(1e3 * t) * np.ones(len(X))),
    "damaged": PointFunction(damage, 1000.0, "small", (Variable("largest"),)),
}


def build(p):
    """A block, rubber above and metal below that yields, pressed on a rigid plane (or thrown on it)."""
    metal = LOWER[p.material]
    part = rectangle("block", (0.2, 0.1), (4, 2), metal)
    below = part.points[part.cells].mean(axis=1)[:, 1] < 0.05
    regions = {"metal": np.flatnonzero(below), "rubber": np.flatnonzero(~below)}
    part = replace(part, material=ByRegion({"metal": metal, "rubber": neo_hooke(2e7, 0.4, 1000.0)}), regions=regions)
    plane = rigid_rectangle("plane", (2.0, 0.2), (0.1, -0.1), 1.0)
    held = [Support("plane", ("x", "y", "rz"))]
    if not p.dynamic:
        held += [Support("block", ("y",), "y+", velocity=-0.004), Support("block", ("x",), "y+", velocity=0.002)]
    model = build_model([Body("block", part), plane], supports=held, gravity=lambda t: (0.0, -9.81))
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("plane", "y+")]), 0.3, 1e-2)
    start = None
    if p.dynamic:
        from fcsim import State
        v = np.zeros(model.n_dofs)
        v[1 : model.n_elastic : 2] = -8.0
        start = State(0.0, np.zeros(model.n_dofs), v)
    scheme = Theta(2e-4) if p.dynamic else QuasiStatic(0.25)
    simulation = Simulation(model, Detector([pair], model.n_nodes), scheme, p.steps, initial=start, keep=5)
    return Case("block", "A block", simulation, fclib_set="BLOCK")
'''


@pytest.fixture
def script(tmp_path: Path) -> Path:
    (tmp_path / "block").mkdir()
    (tmp_path / "block" / "block.py").write_text(SCRIPT, encoding="utf-8")
    return tmp_path / "block"


def state(directory: Path) -> dict[str, np.ndarray]:
    with h5py.File(directory / "checkpoint.h5") as file:
        return {name: file[name][()] for name in ("x", "v", "internal", "memory/0/r")}


@pytest.mark.each_value
@pytest.mark.parametrize("material", ["metal", "finite metal", "viscous", "warm metal", "damaged"])
@pytest.mark.parametrize("dynamic", ["true", "false"])
def test_going_on_gives_the_same_bits(script: Path, tmp_path: Path, dynamic: str, material: str) -> None:
    options = RunOptions(export_every=0, vtk_every=0, checkpoint_every=1)
    given = {"dynamic": dynamic, "material": material}
    assert run_case(load_case(script), {**given, "steps": "8"}, tmp_path / "whole", options).converged
    run_case(load_case(script), {**given, "steps": "3"}, tmp_path / "part", options)
    run_case(load_case(script), {"steps": "8"}, tmp_path / "part", options, resume=True)
    whole, part = state(tmp_path / "whole"), state(tmp_path / "part")
    assert abs(whole["internal"]).max() > 1e-4  # it has yielded, flowed or is damaged
    for name in whole:
        assert np.array_equal(whole[name], part[name]), name


def test_files_of_all_iterations_and_internal_variables(script: Path, tmp_path: Path) -> None:
    options = RunOptions(export_every=4, export_forms=("global", "local"), export_iterations=True, vtk_every=4, checkpoint_every=0)
    seen = []
    assert run_case(load_case(script), {}, tmp_path / "out", options, watch=lambda case, step: seen.append(step)).converged
    step = seen[-1]
    assert len(step.linearised) >= 2
    files = sorted((tmp_path / "out" / "fclib" / "global").glob("BLOCK*-00008.hdf5"))
    assert len(files) == len(step.linearised)
    assert len(list((tmp_path / "out" / "fclib" / "local").glob("BLOCK*-00008.hdf5"))) == len(files)
    for file in files:
        content = read_fclib(file)
        assert content.solution is not None
        again = solve(content.problem, "auto", tol=1e-9)
        assert again.solved
        assert_allclose(again.v, content.solution.v, atol=1e-6 * abs(content.solution.v).max())
    grid = pv.read(next((tmp_path / "out" / "vtk").glob("blocks_00008.vtu")))
    plastic = grid.cell_data["equivalent_plastic_strain"]
    assert np.count_nonzero(np.isnan(plastic)) == 4 and np.nanmax(plastic) > 1e-4  # rubber has none
    assert grid.cell_data["plastic_strain"].shape == (8, 6)
    assert 1e4 < grid.cell_data["von_mises [Pa]"].max() < 1e8
