"""Graded meshes: volume, named surfaces where they belong, outward facets that close the body, growing elements of good shape."""

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.graded import graded_brick, graded_rectangle, half_ball, half_disk
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part
from fcsim.mesh.quality import cell_volumes, scaled_jacobian

MATERIAL = Material(1e9, 0.3, 1000.0)
R, CORE = 0.05, 0.01


def normals(part: Part, facets: np.ndarray) -> np.ndarray:
    """Area vectors (nf, d), outward by the convention of Part."""
    x = part.points[facets]
    if part.dimension == 2:
        t = x[:, 1] - x[:, 0]
        return np.stack((t[:, 1], -t[:, 0]), axis=1)
    return np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]) / 2


def check_closed(part: Part, names: list[str]) -> None:
    """The surfaces together close the body: their area vectors sum to zero, and the divergence theorem gives the volume."""
    facets = np.concatenate([part.surfaces[name] for name in names])
    n = normals(part, facets)
    volume = cell_volumes(part.points, part.cells, part.cell_type).sum()
    assert n.sum(axis=0) == pytest.approx(0, abs=1e-12 * R**2)
    flux = np.sum(part.points[facets].mean(axis=1) * n) / part.dimension
    assert flux == pytest.approx(volume, rel=1e-12 if part.dimension == 2 else 1e-2)  # warped faces: the mean point is not the centroid


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize(("mesh", "whole"), [(half_disk, ""), (half_disk, "x"), (half_ball, ""), (half_ball, "x"), (half_ball, "xy")])
def test_half_round(mesh, whole, side):
    part = mesh("r", R, CORE, 4, MATERIAL, whole=whole, side=side)
    d, sign = part.dimension, 1 if side == "above" else -1
    cut = [axis for axis in "xy"[: d - 1] if axis not in whole]
    assert set(part.surfaces) == {"contact", "curved", "middle", *(f"{axis}-" for axis in cut)}
    centre = np.append(np.zeros(d - 1), sign * R)
    curved = part.points[np.unique(part.surfaces["curved"])]
    assert np.linalg.norm(curved - centre, axis=1) == pytest.approx(R)
    assert part.points[np.unique(part.surfaces["middle"]), -1] == pytest.approx(sign * R)
    assert np.linalg.norm(part.points - centre, axis=1).max() <= R * (1 + 1e-12)
    for axis in cut:
        assert part.points[np.unique(part.surfaces[f"{axis}-"]), "xy".index(axis)] == pytest.approx(0, abs=1e-15)
    contact = part.points[np.unique(part.surfaces["contact"])]
    assert {tuple(p) for p in contact} <= {tuple(p) for p in curved}
    assert np.abs(contact[:, 0]).max() <= CORE * (1 + 1e-12)
    assert contact[contact[:, 1:-1].sum(axis=1) == 0, 0].max() == pytest.approx(CORE)  # along x it reaches the core's half-width
    assert np.all(np.sign(normals(part, part.surfaces["contact"])[:, -1]) == -sign)
    check_closed(part, [name for name in part.surfaces if name != "contact"])
    assert scaled_jacobian(part.points, part.cells, part.cell_type).min() > 0.5


@pytest.mark.parametrize(("mesh", "exact"), [(half_disk, np.pi * R**2 / 4), (half_ball, np.pi * R**3 / 6)])
def test_volume_of_a_half_round_converges_with_order_2(mesh, exact):
    """A polygon in a circle misses an area of order h^2."""
    parts = [mesh("r", R, CORE, n, MATERIAL, layers=2 * n) for n in (2, 4, 8)]
    missing = [exact - cell_volumes(part.points, part.cells, part.cell_type).sum() for part in parts]
    assert np.log2(np.divide(missing[:-1], missing[1:])) == pytest.approx(2, abs=0.15)


@pytest.mark.parametrize(("mesh", "whole"), [(graded_rectangle, ""), (graded_rectangle, "x"), (graded_brick, ""), (graded_brick, "xy")])
def test_graded_box(mesh, whole):
    part = mesh("b", R, CORE, 3, MATERIAL, whole=whole)
    d, volumes = part.dimension, cell_volumes(part.points, part.cells, part.cell_type)
    assert volumes.sum() == pytest.approx(R**d * 2 ** len(whole))
    assert part.points[np.unique(part.surfaces["face"]), -1] == pytest.approx(0, abs=1e-15)
    assert part.points[np.unique(part.surfaces["base"]), -1] == pytest.approx(-R)
    assert np.abs(part.points[np.unique(part.surfaces["rim"])][:, :-1]).max(axis=1) == pytest.approx(R)
    check_closed(part, [name for name in part.surfaces if name != "contact"])
    assert volumes.min() == pytest.approx((CORE / 3) ** d)  # the core's cells are the smallest, and equal
    assert np.isclose(volumes, volumes.min()).sum() == 3**d * 2 ** len(whole)


def test_layers_can_be_given():
    assert len(half_disk("r", R, CORE, 4, MATERIAL, layers=3).cells) == 4 * 4 + 3 * 8


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"core": 0.06}, "expected 0 < core < radius"),
        ({"divisions": 0}, "divisions: expected a whole number >= 1"),
        ({"layers": 1.5}, "layers: expected a whole number >= 1"),
        ({"whole": "z"}, "whole: expected axes among 'xy'"),
        ({"side": "left"}, "side: expected 'above' or 'below'"),
    ],
)
def test_bad_arguments(arguments, message):
    given = {"radius": R, "core": CORE, "divisions": 4, "material": MATERIAL, **arguments}
    with pytest.raises(InputError, match=message):
        half_ball("r", **given)
