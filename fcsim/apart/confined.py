"""Files of others that would bring in, or run, more than themselves: refused before a library reads them.

gmsh takes a .msh that does not begin as a mesh for a script, which may call programs, and runs FILE.msh.opt beside it; XDMF names files of
data anywhere; HDF5 has links to other files and arrays stored in them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import h5py

from fcsim.errors import InputError
from fcsim.files import inside

MSH_HEADS = (b"$MeshFormat", b"$Comments", b"$NOD", b"$ELM")
"""How a mesh of gmsh's begins, whose reader is taken then; after $Comments too (gmsh, Common/OpenFile.cpp, MergeFile)."""


@contextmanager
def msh_alone(path: Path) -> Iterator[Path]:
    """A place of a .msh file at which gmsh reads a mesh, and nothing beside it; InputError where gmsh would run it as a script."""
    with path.open("rb") as file:
        head = file.read(16)
    if not head.startswith(MSH_HEADS):
        raise InputError(f"{path}: expected a mesh that gmsh can read, which begins with $MeshFormat, got {head!r}")
    with TemporaryDirectory(prefix="fcsim-mesh-") as folder:
        alone = Path(folder) / "mesh.msh"
        alone.symlink_to(path.resolve())
        yield alone


def refuse_others(path: Path) -> None:
    """InputError where a mesh file takes data from files outside of its folder."""
    if path.suffix.lower() in (".xdmf", ".xmf"):
        _refuse_xdmf(path)
    elif h5py.is_hdf5(path):
        refuse_elsewhere(path)


def _refuse_xdmf(path: Path) -> None:
    folder = path.resolve().parent  # against which meshio takes names of HDF5 files; those of binary ones are of the working directory
    try:
        items = [element for element in ElementTree.parse(path).iter("DataItem") if element.attrib.get("Format") in ("HDF", "Binary")]
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: expected an XDMF file: {error}") from None
    for name, binary in sorted({((item.text or "").strip(), item.attrib["Format"] == "Binary") for item in items}):
        place = Path(name) if binary else folder / name.split(":")[0]
        try:
            inside(folder, place)
            if not binary and place.is_file():
                refuse_elsewhere(place)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        except (OSError, ValueError) as error:  # a name with a zero byte, a circle of links
            raise InputError(f"{path}: expected data in files beside it, got {name!r}: {error}") from None


def refuse_elsewhere(path: Path) -> None:
    """InputError where an HDF5 file has links to other files, or arrays that are stored in them."""
    try:
        with h5py.File(path, "r") as file:
            groups: list[h5py.Group] = [file]
            seen = set()
            while groups:
                group = groups.pop()
                address = h5py.h5o.get_info(group.id).addr
                if address in seen:
                    continue
                seen.add(address)
                for name in group:
                    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                        raise InputError(f"{path}, {group.name.rstrip('/')}/{name}: expected data in this file, got a link to another")
                    entry = group.get(name)
                    if isinstance(entry, h5py.Dataset) and (entry.external or entry.is_virtual):
                        raise InputError(f"{path}, {entry.name}: expected data in this file, got data that are stored in others")
                    if isinstance(entry, h5py.Group):
                        groups.append(entry)
    except (OSError, RuntimeError, KeyError, ValueError, UnicodeError) as error:
        raise InputError(f"{path}: the HDF5 file is truncated or damaged: {error}") from None
