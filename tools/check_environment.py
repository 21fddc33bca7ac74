"""Check that the installed environment works: gmsh loads, dolfinx compiles a form, VTK draws. Says what is missing.

The wheel of gmsh loads libraries of X and GL that no Python package brings; dolfinx compiles its forms with the C compiler. Without
either of them the exit code is 1. VTK needs EGL, OSMesa or an X display to draw: that is only warned of, since all but pictures work.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys

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
with gmsh_model("check"):
    pass
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
"""

DRAW = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Cube())
assert plotter.screenshot(None, return_img=True).std() > 0
"""


def failure(script: str) -> str | None:
    """Run `script` in a process of its own (a missing library may end it by a signal); return its last words if it fails."""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    return None if run.returncode == 0 else (run.stderr.strip().splitlines() or [f"exit code {run.returncode}"])[-1]


def loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def main() -> int:
    missing = {library: package for library, package in GMSH_LIBRARIES.items() if not loads(library)}
    gmsh, dolfinx, drawing = failure(LOAD_GMSH), failure(COMPILE_A_FORM), failure(DRAW)
    if gmsh and missing:
        print(f"fcsim: gmsh needs {', '.join(missing)}. Debian: apt-get install {' '.join(missing.values())}", file=sys.stderr)
    elif gmsh:
        print(f"fcsim: gmsh cannot be used: {gmsh}", file=sys.stderr)
    if dolfinx:
        print(
            f"fcsim: dolfinx cannot compile a form; does the C compiler work? Debian: apt-get install gcc libc6-dev. It said: {dolfinx}",
            file=sys.stderr,
        )
    if drawing:
        print(
            "fcsim: warning: VTK cannot draw off-screen, so no pictures. Debian: apt-get install libegl1 libgl1-mesa-dri", file=sys.stderr
        )
    return 1 if gmsh or dolfinx else 0


if __name__ == "__main__":
    raise SystemExit(main())
