"""Mesh files changed anywhere: read as a mesh that can be computed with, or refused; what ends or hangs its reader too."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.errors import FcsimError
from fcsim.mesh import brick, foreign, rectangle
from fcsim.mesh.io import read_mesh, write_mesh
from fcsim.mesh.material import Material
from fcsim.mesh.quality import check_quality
from fcsim.runtime import gmsh_model

Apart = Callable[[Callable[[int], str], int], list[tuple[int, str]]]
STONE = Material(1e9, 0.2, 2000.0)


@pytest.fixture
def originals(tmp_path: Path) -> list[Path]:
    """The formats that fcsim writes, ASCII .msh 4.1 and 2.2 beside."""
    block, plate = brick("block", (1, 1, 1), (2, 1, 1), STONE), rectangle("plate", (1, 1), (2, 2), STONE, cell="triangle")
    paths = [tmp_path / f"{part.name}{suffix}" for part in (block, plate) for suffix in (".msh", ".vtu", ".vtk", ".xdmf")]
    for path in paths:
        write_mesh(block if path.stem == "block" else plate, path)
    bare = tmp_path / "bare.inp"
    write_mesh(block, bare, surfaces=False)
    texts = [tmp_path / "text41.msh", tmp_path / "text22.msh"]
    with gmsh_model("text") as gmsh:
        gmsh.merge(str(tmp_path / "block.msh"))
        gmsh.option.setNumber("Mesh.Binary", 0)
        for path, version in zip(texts, (4.1, 2.2), strict=True):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.write(str(path))
    return [path for path in (*paths, bare, *texts) if path.suffix != ".xdmf"] + texts  # text is where readers trust most


def test_meshes(tmp_path: Path, originals: list[Path], apart: Apart, how_many: Any, generator: Any, keep: Any, mutate_bytes: Any) -> None:
    """Read where fcsim reads them, in a child, here many in one; what ends that child is read again as a user does."""

    def file(number: int) -> Path:
        original = originals[number % len(originals)]
        path = tmp_path / f"mutated{original.suffix}"
        path.write_bytes(mutate_bytes(original.read_bytes(), generator("meshes", number)))
        return path

    def case(number: int) -> str:
        mesh = foreign._read(file(number), "strain", 1.0, ("", "regions")[number % 2])
        for volume in mesh.volumes:
            part = mesh.part(STONE, volume=volume)
            assert np.all(np.isfinite(part.points)) and check_quality(part).min() > 0
        return ""

    findings = []
    for number, what in apart(case, how_many(120, 5000)):
        path = file(number)
        if what.startswith(("SIG", "exit code", "MemoryError", "more than", "waiting")):  # its own child is there for these
            try:
                read_mesh(path, STONE)
            except FcsimError:
                continue
        keep(path, "mesh", number)
        findings.append((number, what))
    assert not findings
