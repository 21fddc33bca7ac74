"""Mesh files of others, read in a process of their own with limits on time and memory.

A malformed file can end the process that reads it (gmsh: segmentation fault on a node number of 1e20), hang it or fill its memory; here
that is an error like any other. `main` is what that process does.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, Literal, cast
from urllib.parse import unquote

import numpy as np

from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.cell_type import FROM_MESHIO
from fcsim.mesh.named_mesh import Block, NamedMesh, from_gmsh, named_mesh
from fcsim.runtime import gmsh_model

PROCESS = "import sys; from fcsim.mesh.foreign import main; raise SystemExit(main(*sys.argv[1:]))"
SURFACE = "surface:"
TAGS = ("gmsh:physical", "medit:ref", "cell_tags")
SECONDS, SECONDS_PER_MB = 60.0, 5.0
"""A reader may take so long: some MB a second is what the slowest formats are read at."""
MEMORY, MEMORY_PER_BYTE = 4 * 2**30, 100
"""[bytes] of addresses, libraries included."""


def read_apart(path: Path, plane: Literal["strain", "stress"], thickness: float) -> NamedMesh:
    """The mesh of a file, read in another process. InputError for what that says of it, and where it crashes, hangs or fills memory."""
    megabytes = path.stat().st_size / 1e6
    known = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, known))}
    with TemporaryDirectory(prefix="fcsim-mesh-") as folder:
        out = Path(folder) / "mesh.npz"
        command = [sys.executable, "-c", PROCESS, str(path), str(out), plane, repr(float(thickness))]
        patience = SECONDS + SECONDS_PER_MB * megabytes
        try:
            done = subprocess.run(command, env=environment, capture_output=True, timeout=patience, check=False, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"{path}: expected a mesh that can be read in {error.timeout:.0f} s, its reader was still at it") from None
        if done.returncode == 2:
            told = json.loads(done.stdout.decode().splitlines()[-1])
            raise (MissingDependency if told["missing"] else InputError)(told["error"])
        if done.returncode != 0:
            last = "".join(done.stderr.decode(errors="replace").strip().splitlines()[-1:])
            how = signal.Signals(-done.returncode).name if done.returncode < 0 else last or f"exit code {done.returncode}"
            raise InputError(f"{path}: expected a mesh file, got one that ends its reader ({how})")
        return _loaded(out, str(path), plane, thickness)


def _loaded(out: Path, source: str, plane: Literal["strain", "stress"], thickness: float) -> NamedMesh:
    with np.load(out, allow_pickle=False) as arrays:
        about = json.loads(str(arrays["about"]))
        return NamedMesh(
            source,
            arrays["points"],
            about["cell_type"],
            {name: arrays[f"volume {k}"] for k, name in enumerate(about["volumes"])},
            {name: arrays[f"surface {k}"] for k, name in enumerate(about["surfaces"])},
            about["ungrouped"],
            plane=plane,
            thickness=thickness,
        )


def main(path: str, out: str, plane: str, thickness: str) -> int:
    """Read a mesh file within the limits and write its arrays; what is wrong with it is printed as JSON, exit code 2."""
    size = Path(path).stat().st_size
    most = MEMORY + MEMORY_PER_BYTE * size
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        mesh = _read(Path(path), cast(Literal["strain", "stress"], plane), float(thickness))
        about = {"cell_type": mesh.cell_type, "volumes": list(mesh.volumes), "surfaces": list(mesh.surfaces), "ungrouped": mesh.ungrouped}
        arrays: dict[str, Any] = {f"volume {k}": cells for k, cells in enumerate(mesh.volumes.values())}
        arrays |= {f"surface {k}": facets for k, facets in enumerate(mesh.surfaces.values())}
        np.savez(out, allow_pickle=False, points=mesh.points, about=np.array(json.dumps(about)), **arrays)
    except (InputError, MissingDependency) as error:
        print("\n" + json.dumps({"error": str(error), "missing": isinstance(error, MissingDependency)}))
        return 2
    except MemoryError:
        print("\n" + json.dumps({"error": f"{path}: expected a mesh that fits into {most / 2**30:.1f} GiB", "missing": False}))
        return 2
    return 0


def _read(path: Path, plane: Literal["strain", "stress"], thickness: float) -> NamedMesh:
    if path.suffix == ".msh":
        with gmsh_model(path.stem) as gmsh:
            try:
                gmsh.merge(str(path))
                return from_gmsh(gmsh, str(path), plane=plane, thickness=thickness)
            except InputError:
                raise
            except Exception as error:  # gmsh's only exception class, and names of groups that are no UTF-8
                raise InputError(f"{path}: expected a mesh that gmsh can read, got: {error}") from None
    mesh = quietly(path, "a mesh that meshio can read", lambda: _read_meshio(path))
    blocks = quietly(path, "a mesh with groups that can be read", lambda: _blocks(mesh))
    return named_mesh(str(path), mesh.points, blocks, plane=plane, thickness=thickness)


def _read_meshio(path: Path) -> Any:
    meshio = meshio_package()
    if path.suffix not in meshio.extension_to_filetypes:
        raise InputError(f"{path}: expected the extension of a mesh file (as .msh, .vtu, .vtk, .xdmf), got {path.suffix!r}")
    return meshio.read(path)


def quietly[T](path: Path, expected: str, call: Callable[[], T]) -> T:
    """Call meshio, which prints what is wrong and leaves by SystemExit, and raise InputError instead."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            return call()
    except (InputError, MissingDependency):
        raise
    except (Exception, SystemExit) as error:  # readers of many formats: what they raise on a broken file is anything
        message = " ".join(said.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: expected {expected}, got: {message}") from None


def _blocks(mesh: Any) -> list[Block]:
    """The elements of a meshio mesh, once for each group that they are in, and those that are in none."""
    names = {int(values[0]): name for name, values in mesh.field_data.items() if np.size(values) == 2}
    blocks = []
    for b, cells in enumerate(mesh.cells):
        groups: dict[str, np.ndarray] = {}
        for key, data in mesh.cell_data.items():
            if key.startswith(SURFACE):
                groups[unquote(key.removeprefix(SURFACE))] = np.flatnonzero(data[b])
            elif key in TAGS:
                tags = np.asarray(data[b]).reshape(-1).astype(np.int64)
                groups |= {names.get(tag, str(tag)): np.flatnonzero(tags == tag) for tag in np.unique(tags).tolist() if tag != 0}
        groups |= {name: np.asarray(sets[b]) for name, sets in mesh.cell_sets.items() if sets[b] is not None}
        cell_type, elements = FROM_MESHIO.get(cells.type, cells.type), np.asarray(cells.data)
        alone = np.ones(len(elements), dtype=bool)
        for name, members in groups.items():
            alone[members] = False
            blocks.append(Block(cell_type, elements[members], name))
        blocks.append(Block(cell_type, elements[alone]))
    return blocks


def meshio_package() -> ModuleType:
    """meshio; MissingDependency where it is absent."""
    try:
        import meshio
    except ImportError as error:
        raise MissingDependency(f"meshio is needed for mesh files other than .msh ({error}): pip install 'fcsim[fem]'") from None
    return meshio
