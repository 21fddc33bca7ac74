"""Masonry problems and surfaces changed anywhere: refused in a line, or an answer that is in equilibrium and a run that can be read."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.errors import FcsimError
from fcsim.masonry import LimitAnalysis, analyse, masonry_of_surfaces, pushed, read_masonry, tilted
from fcsim.masonry.case import masonry_case
from fcsim.mesh.solids import surface_file
from fcsim.running.folder import open_run
from fcsim.running.run import RunOptions, run_case

Apart = Callable[[Callable[[int], str], int], list[tuple[int, str]]]
pytestmark = pytest.mark.filterwarnings("ignore")


def box(low: tuple[float, float, float], size: tuple[float, float, float]) -> list[list[float]]:
    """A hexahedron's corners in VTK's order."""
    flat = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return [[low[0] + size[0] * p, low[1] + size[1] * q, low[2] + size[2] * r] for r in (0, 1) for p, q in flat]


def problem(dimension: int) -> dict[str, Any]:
    """Two blocks on a floor, one pushed by a force: every key of the format."""
    faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    return {
        "schema": "masonry-problem/1",
        "name": "two",
        "title": "Two blocks",
        "question": "multiplier",
        "source": ["by hand"],
        "dimension": dimension,
        "contact": {"mu": 0.5, "mu_between": [{"between": ["floor", 1], "mu": 0.4}]},
        "loads": [
            {"kind": "acceleration", "value": [0, 0, -9.81], "scaled_by_multiplier": False},
            {"kind": "force", "block": "top", "value": [1000, 0, 0], "point": [0, 0.5, 0.8], "scaled_by_multiplier": True},
        ],
        "expected": [{"quantity": "multiplier", "value": 3, "kind": "closed form", "bound": "both", "tolerance": 0.01}],
        "support_motion": [{"block": "floor", "velocity": [0, 0, 0]}],
        "initial_pose": [{"block": "top", "translation": [0, 0, 0], "rotation": [0, 0, 0], "about": [0.5, 0.5, 0.8]}],
        "blocks": [
            {"id": "floor", "vertices": box((-1, 0, -0.5), (3, 1, 0.5)), "support": True},
            {"id": 1, "vertices": box((0, 0, 0), (1, 1, 0.5)), "density": 2000, "faces": faces},
            {"id": "top", "vertices": box((0, 0, 0.5), (1, 1, 0.5)), "mass": 900.0},
        ],
    }


SHAKING = [
    {"kind": "half_sine", "value": [1.0, 0, 0], "duration": 0.1},
    {"direction": [1, 0, 0], "times": [0, 0.1, 0.2], "values": [0, 2.0, 0]},
    {"kind": "sine", "value": [1.0, 0, 0], "duration": 0.2, "frequency": 10.0},
]


def out_of_balance(analysis: LimitAnalysis) -> float:
    """Of the limit's forces, as a share of the largest load: H r + dead + lambda live, and how far r is outside of the cones."""
    limit, worst = analysis.limit, 0.0
    d, mu = limit.contacts.dimension, limit.contacts.mu
    for found in (analysis.associative, analysis.coulomb):
        if found.outcome != "limit":
            continue
        loads = (limit.dead + found.multiplier * limit.live)[limit.free]
        r = found.r.reshape(-1, d)
        outside = np.maximum(np.linalg.norm(r[:, 1:], axis=1) - mu * r[:, 0], -r[:, 0]).max(initial=0.0)
        share = max(float(np.abs(limit.H @ found.r + loads).max()), float(outside)) / max(limit.scale, float(np.abs(loads).max()))
        worst = max(worst, share) if np.isfinite(share) else np.inf
    return worst


def test_masonry_problems(
    tmp_path: Path, apart: Apart, how_many: Any, generator: Any, keep: Any, mutate_json: Any, mutate_text: Any
) -> None:
    """Limit analysis, its pushed and tilted questions, and two steps of a run of every fourth."""
    path, out, limits = tmp_path / "model.json", tmp_path / "out", tmp_path / "limits"

    def file(number: int) -> Path:
        random = generator("masonry", number)
        data = problem(2 + number % 2)
        if number % 4 == 3:
            data["base_acceleration"] = SHAKING[int(random.integers(len(SHAKING)))]
        for _ in range(2 if random.random() < 0.2 else 1):
            data = mutate_json(data, random) if isinstance(data, dict) else data
        text = json.dumps(data).encode()
        path.write_bytes(mutate_text(text, random) if number % 7 == 0 else text)
        return path

    def case(number: int) -> str:
        place = file(number)
        if number % 4 == 3:
            shutil.rmtree(out, ignore_errors=True)
            steps = {"steps": "2", "multiplier": "0.1" if number % 8 == 3 else "0", "blocks_are": ("rigid", "mixed")[number % 3 == 0]}
            done = run_case(masonry_case(place), steps, out, RunOptions(export_every=1, vtk_every=0))
            values = open_run(out).numbers("displacement")
            good = done.status != "finished" or (values is not None and len(values) == 2 and np.isfinite(values).all())
            return "" if good else f"finished with displacements {values}"
        asked = read_masonry(place)
        if number % 4 == 1:
            asked = tilted(asked, (1.0, 0.0, 0.0)) if number % 8 == 1 else pushed(asked, (1.0, 0.0, 0.0))
        found = analyse(replace(asked, shaking=()))
        with limits.open("a") as note:
            note.write("x" if found.associative.outcome == "limit" else "")
        share = out_of_balance(found)
        return "" if share < 1e-5 else f"a limit out of balance by {share:.1e}"

    for number in range(8):  # compiled here, for all children
        with contextlib.suppress(FcsimError):
            case(number)
    findings = apart(case, how_many(120, 3000))
    for number, _ in findings:
        keep(file(number), "masonry", number)
    assert not findings
    assert limits.stat().st_size > 3  # most mutations are refused; what is left has limits


@pytest.fixture
def surfaces(tmp_path: Path) -> list[Path]:
    """Two boxes on each other in each format."""
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    for name, z in (("lower", 0.0), ("upper", 0.5)):
        scene.add_geometry(trimesh.creation.box((1.0, 1.0, 0.5)).apply_translation((0, 0, z)), node_name=name, geom_name=name)
    paths = [tmp_path / f"solids{suffix}" for suffix in (".obj", ".glb", ".3mf", ".stl", ".ply", ".off")]
    for path in paths:
        (scene if path.suffix in (".obj", ".glb", ".3mf") else trimesh.util.concatenate(scene.dump())).export(path)
    text = tmp_path / "text.stl"
    trimesh.util.concatenate(scene.dump()).export(text, file_type="stl_ascii")
    plain = tmp_path / "text.ply"
    plain.write_bytes(trimesh.exchange.ply.export_ply(trimesh.util.concatenate(scene.dump()), encoding="ascii"))
    return [*paths, text, plain]


def test_surfaces(
    tmp_path: Path, surfaces: list[Path], apart: Apart, how_many: Any, generator: Any, keep: Any, monkeypatch: Any, mutate_bytes: Any
) -> None:
    """Read where fcsim reads them, in a child, here many in one; what ends that child is read again as a user does."""

    def file(number: int) -> Path:
        original = surfaces[number % len(surfaces)]
        path = tmp_path / f"mutated{original.suffix}"
        path.write_bytes(mutate_bytes(original.read_bytes(), generator("surfaces", number)))
        return path

    def case(number: int) -> str:
        with monkeypatch.context() as patch:
            patch.setattr(surface_file, "read_apart", lambda path, *_: surface_file._read(path))
            found = masonry_of_surfaces(file(number))
        volumes = [block.surface.moments()[0] for block in found.blocks]
        if not all(np.isfinite(volume) and volume > 0 for volume in volumes):
            return f"volumes {volumes}"
        if number % 10 == 0 and len(found.blocks) < 10:
            analyse(pushed(found, (1.0, 0.0, 0.0)))
        return ""

    findings = []
    for number, what in apart(case, how_many(100, 2000)):
        path = file(number)
        if what.startswith(("SIG", "exit code", "MemoryError", "more than", "waiting")):  # its own child is there for these
            try:
                masonry_of_surfaces(path)
            except FcsimError:
                continue
        keep(path, "surface", number)
        findings.append((number, what))
    assert not findings
