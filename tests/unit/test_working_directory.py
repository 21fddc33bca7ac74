"""A working directory of somebody else: nothing of it is run, and no library takes its options from there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fcsim.export_fclib import write_fclib
from fcsim.mesh.blocks import brick
from fcsim.mesh.io import write_mesh
from fcsim.mesh.material import Material
from fcsim.problem import LocalProblem
from fcsim.runtime import without_local_options

ROOT = Path(__file__).parents[2]
MODULES = ("json", "h5py", "numpy", "resource", "gmsh", "meshio", "numba", "yaml", "sitecustomize", "fcsim", "dolfinx", "matplotlib")


def python(program: str, folder: Path, **environment: str) -> str:
    """What a program says that runs in a folder as the installed `fcsim` does: its modules are not of the working directory."""
    variables = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run(
        [sys.executable, "-P", "-c", program], cwd=folder, env=variables, capture_output=True, text=True, check=True, timeout=120
    ).stdout


def test_modules_of_the_working_directory_are_not_run(tmp_path: Path) -> None:
    """The processes that read HDF5 files and meshes took them from there."""
    folder = tmp_path / "theirs"
    folder.mkdir()
    write_fclib(folder / "a.hdf5", LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3])))
    write_mesh(brick("block", (1, 1, 1), (1, 1, 1), Material(1e9, 0.2, 2000.0)), folder / "a.msh")
    for name in MODULES:
        (folder / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'a').write({name!r})")
    said = python(
        "from fcsim import read_fclib; from fcsim.mesh.io import read_mesh; from fcsim.mesh.material import Material;"
        "print(read_fclib('a.hdf5').problem.nc, len(read_mesh('a.msh', Material(1e9, 0.2, 2000.0)).points))",
        folder,
    )
    assert said.split() == ["1", "8"] and not (tmp_path / "ran").exists()


def test_options_of_the_working_directory_are_not_taken(tmp_path: Path) -> None:
    """Where compiled functions are loaded from, arguments of the C compiler, files that PETSc writes, programs that matplotlib calls."""
    pytest.importorskip("dolfinx_solver")
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: /theirs\n")
    (tmp_path / "dolfinx_jit_options.json").write_text(json.dumps({"cffi_extra_compile_args": ["-wrapper", "theirs"]}))
    (tmp_path / "ffcx_options.json").write_text(json.dumps({"verbosity": 7}))
    (tmp_path / ".petscrc").write_text("-theirs 1\n")
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    said = python(
        "import os; here = os.getcwd(); import fcsim; from fcsim import runtime; from fcsim.view.style import matplotlib;"
        "runtime.dolfinx(); import dolfinx.jit, ffcx.options, numba.core.config; from petsc4py import PETSc;"
        "print(os.getcwd() == here, matplotlib().rcParams['text.usetex'], 'theirs' in PETSc.Options().getAll(), "
        "'theirs' in dolfinx.jit.get_options()['cffi_extra_compile_args'], ffcx.options.get_options()['verbosity'] == 7, "
        "'theirs' in numba.core.config.CACHE_DIR)",
        tmp_path,
    )
    assert said.split() == ["True", *["False"] * 5]


def test_the_working_directory_comes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ZeroDivisionError), without_local_options():
        assert Path.cwd() == Path("/")
        raise ZeroDivisionError
    assert Path.cwd() == tmp_path
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with without_local_options():
        pass
    monkeypatch.chdir(tmp_path)
