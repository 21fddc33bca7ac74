"""What fcsim needs of a machine, looked at one by one: Python, packages, compiler, system libraries, threads, room on disks.

The wheel of gmsh loads libraries of X and GL that no Python package brings; dolfinx compiles its forms with the C compiler; VTK draws with
EGL, OSMesa or an X display. What may end a process by a signal is tried in a process of its own.
"""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from fcsim.memory import free_memory
from fcsim.runtime import THREAD_VARIABLES, threads
from fcsim.version import __version__

# What `ldd` lists for the wheel's libgmsh beyond the run-time libraries of C and C++, with the Debian packages that hold them.
GMSH_LIBRARIES = {
    "libGLU.so.1": "libglu1-mesa",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libXcursor.so.1": "libxcursor1",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libXrender.so.1": "libxrender1",
    "libfontconfig.so.1": "libfontconfig1",
    "libgomp.so.1": "libgomp1",
}

LOAD_GMSH = """
from fcsim.runtime import gmsh_model
with gmsh_model("check") as gmsh:
    print(gmsh.option.getString("General.Version"))
"""

COMPILE_A_FORM = """
import tempfile
from fcsim.runtime import dolfinx
dolfinx = dolfinx()
import ufl
from mpi4py import MPI
mesh = dolfinx.mesh.create_unit_interval(MPI.COMM_SELF, 1)
with tempfile.TemporaryDirectory() as cache:
    dolfinx.fem.form(dolfinx.fem.Constant(mesh, 1.0) * ufl.dx(mesh), jit_options={"cache_dir": cache})
print(dolfinx.__version__, "and", " ".join(MPI.Get_library_version().splitlines()[0].split(",")[0].split()))
"""

DRAW = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Cube())
assert plotter.screenshot(None, return_img=True).std() > 0, "the picture is empty"
print("pyvista", pyvista.__version__)
"""

EXTRAS = {
    "view": ("plots, films, the page of a run", {"matplotlib": "matplotlib", "imageio_ffmpeg": "imageio-ffmpeg", "plotly": "plotly"}),
    "fem": ("mesh files, bars on a terminal", {"meshio": "meshio", "rich": "rich"}),
    "masonry": (
        "limit analysis of masonry in 3D",
        {"clarabel": "clarabel", "mapbox_earcut": "mapbox-earcut", "trimesh": "trimesh", "networkx": "networkx", "lxml": "lxml"},
    ),
    "completion": ("words that the shell completes", {"argcomplete": "argcomplete"}),
    "notebook": ("bars in notebooks", {"ipywidgets": "ipywidgets"}),
    "compas": ("problems of compas_dem", {"compas_dem": "compas_dem"}),
}
"""Extras that are optional: what they are for, and their packages by the names of import and of installation."""

LEAST_ROOM = 2**30
"""[bytes] free on a disk below which a run of some hundred steps may fill it."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at. state: "ok", "MISSING" (simulations do not work), "warning" or "absent" (optional);
    mend: what to do about it."""

    what: str
    state: Literal["ok", "MISSING", "warning", "absent"]
    said: str
    mend: str = ""


def _tried(script: str) -> tuple[bool, str]:
    """Run a script in a process of its own: whether it ended well, and its last words."""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    words = (run.stdout if run.returncode == 0 else run.stderr).strip().splitlines()
    return run.returncode == 0, words[-1] if words else f"exit code {run.returncode}"


def python() -> list[Finding]:
    """The interpreter and the packages of the core, which are imported by now."""
    enough = sys.version_info >= (3, 12)
    core = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba", "h5py"))
    return [
        Finding(
            "Python", "ok" if enough else "MISSING", f"{platform.python_version()} in {sys.prefix}", "" if enough else "Python >= 3.12"
        ),
        Finding("fcsim", "ok", f"{__version__} in {Path(__file__).parents[2]}"),
        Finding("core", "ok", core),
    ]


def compiler() -> list[Finding]:
    """The C compiler that forms are compiled with, and Python's headers that it includes."""
    command = next((found for name in (os.environ.get("CC", ""), "cc", "gcc", "clang") if name and (found := shutil.which(name))), None)
    header = Path(sysconfig.get_path("include"), "Python.h")
    return [
        Finding("C compiler", "ok", command)
        if command
        else Finding(
            "C compiler", "MISSING", "no cc, gcc or clang; dolfinx compiles forms with it", "Debian: apt-get install gcc libc6-dev"
        ),
        Finding("Python.h", "ok", str(header))
        if header.exists()
        else Finding("Python.h", "MISSING", f"no {header}", "Debian: apt-get install python3-dev, or a Python that brings its headers"),
    ]


def finite_elements() -> list[Finding]:
    """dolfinx with its MPI, gmsh with the libraries of the system."""
    if find_spec("dolfinx") is None and find_spec("dolfinx_solver") is None:
        said = "not installed: files and solvers work, simulations do not"
        forms = Finding("dolfinx", "MISSING", said, "pip install 'fcsim[fem]', or dolfinx >= 0.10 by conda or Spack")
    else:
        works, said = _tried(COMPILE_A_FORM)
        mend = "does the C compiler work? Debian: apt-get install gcc libc6-dev"
        forms = Finding("dolfinx, MPI", "ok", said) if works else Finding("dolfinx, MPI", "MISSING", f"cannot compile a form: {said}", mend)
    works, said = _tried(LOAD_GMSH) if find_spec("gmsh") is not None else (False, "not installed")
    if works:
        return [forms, Finding("gmsh", "ok", said)]
    lacking = {library: package for library, package in GMSH_LIBRARIES.items() if not _loads(library)}
    if find_spec("gmsh") is None:
        return [forms, Finding("gmsh", "MISSING", said, "pip install 'fcsim[fem]'")]
    if lacking:
        return [forms, Finding("gmsh", "MISSING", f"needs {', '.join(lacking)}", f"Debian: apt-get install {' '.join(lacking.values())}")]
    return [forms, Finding("gmsh", "MISSING", said, "pip install --force-reinstall gmsh")]


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def drawing() -> list[Finding]:
    """VTK, without a display."""
    if find_spec("pyvista") is None:
        return [Finding("pyvista", "absent", "no VTK files, pictures, films", "pip install 'fcsim[view]'")]
    works, said = _tried(DRAW)
    if works:
        return [Finding("drawing", "ok", said)]
    return [Finding("drawing", "warning", f"no pictures: {said}", "Debian: apt-get install libegl1 libgl1-mesa-dri libxrender1")]


def extras() -> list[Finding]:
    """The optional packages."""
    findings = []
    for extra, (purpose, packages) in EXTRAS.items():
        lacking = [name for module, name in packages.items() if find_spec(module) is None]
        if lacking:
            findings.append(Finding(extra, "absent", f"no {', '.join(lacking)}: no {purpose}", f"pip install 'fcsim[{extra}]'"))
        else:
            findings.append(Finding(extra, "ok", ", ".join(f"{name} {_version(name)}" for name in packages.values())))
    return findings


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def siconos() -> list[Finding]:
    """The program that benches compare with, in the system's Python."""
    said = subprocess.run(
        ["/usr/bin/env", "python3", "-c", "import siconos.numerics"],
        capture_output=True, text=True, check=False, env={"PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    if said.returncode == 0:
        return [Finding("Siconos", "ok", "found by /usr/bin/python3")]
    return [Finding("Siconos", "absent", "only benches that compare with it need it", "Debian: apt-get install python3-siconos")]


def machine() -> list[Finding]:
    """Cores, threads, memory, disks, and the folders in which compiled code is kept."""
    chosen = ", ".join(f"{name}={os.environ[name]}" for name in THREAD_VARIABLES if os.environ.get(name))
    cores, count = len(os.sched_getaffinity(0)), threads()
    computes = f"{cores} cores; fcsim computes on {count} thread{'s' if count > 1 else ''} (FCSIM_THREADS changes that, and no result), "
    memory = free_memory()
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return [
        Finding("threads", "ok", f"{computes}BLAS and OpenMP on {chosen or 'one'}"),
        Finding("memory", "ok" if memory > LEAST_ROOM else "warning", f"{memory / 2**30:.1f} GiB free"),
        *(_room(what, place) for what, place in (("disk here", Path.cwd()), ("disk for temporaries", Path(tempfile.gettempdir())))),
        _writable("cache of forms", caches, "set XDG_CACHE_HOME to a folder that can be written"),
        _writable(
            "cache of kernels",
            Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parents[2]),
            "compiled anew in each process (a minute): set NUMBA_CACHE_DIR to a folder that can be written",
        ),
    ]


def _room(what: str, place: Path) -> Finding:
    free = shutil.disk_usage(place).free
    said = f"{free / 2**30:.1f} GiB free in {place}"
    if not os.access(place, os.W_OK):
        return Finding(what, "warning", f"{place} cannot be written", "go to another folder, or give --out")
    return Finding(what, "ok", said) if free > LEAST_ROOM else Finding(what, "warning", said, "make room, or give --out on another disk")


def _writable(what: str, place: Path, mend: str) -> Finding:
    existing = next(folder for folder in (place, *place.absolute().parents) if folder.exists())
    if os.access(existing, os.W_OK | os.X_OK):
        return Finding(what, "ok", str(place))
    return Finding(what, "warning", f"{place} cannot be written", mend)


CHECKS: tuple[Callable[[], list[Finding]], ...] = (python, compiler, finite_elements, drawing, extras, siconos, machine)
