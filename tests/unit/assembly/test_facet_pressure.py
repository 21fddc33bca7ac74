"""Pressure on facets that deform: against forms of dolfinx in the reference, differences, and what a closed surface must give."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly import elasticity
from fcsim.assembly.forms.facet_pressure import facet_forces, facet_tangents, nodal_sum
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part

MATERIAL = Material(1e6, 0.3, 1e3)


def parts() -> dict[str, Part]:
    return {
        "Q1": brick("b", (1, 2, 3), (2, 1, 2), MATERIAL),
        "Q2": brick("b", (1, 2, 3), (1, 1, 2), MATERIAL, elements="Q2"),
        "P1": brick("b", (1, 2, 3), (2, 1, 2), MATERIAL, "tetrahedron"),
        "P2": brick("b", (1, 2, 3), (1, 1, 2), MATERIAL, "tetrahedron", elements="P2"),
        "Q1 2D": rectangle("r", (1, 2), (2, 3), MATERIAL),
        "Q2 2D": rectangle("r", (1, 2), (2, 3), MATERIAL, elements="Q2"),
    }


@pytest.mark.parametrize("kind", parts())
def test_forces_of_the_reference_are_those_of_a_form(kind: str) -> None:
    part = parts()[kind]
    for name, facets in part.surfaces.items():
        forces = -3.0 * part.thickness * nodal_sum(facet_forces(part.points[facets]), facets, len(part.points))
        assert_allclose(forces.ravel(), elasticity.pressure(part, name, 3.0), atol=1e-12)


@pytest.mark.parametrize("kind", parts())
def test_tangents_are_the_derivatives(kind: str) -> None:
    part, random = parts()[kind], np.random.default_rng(3)
    points = part.points[next(iter(part.surfaces.values()))]
    points = points + 0.1 * random.standard_normal(points.shape)
    way, h = random.standard_normal(points.shape), 1e-4
    change = (facet_forces(points + h * way) - facet_forces(points - h * way)) / (2 * h)  # exact up to h^2 times third derivatives: none
    assert_allclose(np.einsum("fabik,fbk->fai", facet_tangents(points), way), change, atol=1e-9)


@pytest.mark.parametrize("kind", parts())
def test_a_closed_surface_is_pushed_by_the_change_of_its_volume_alone(kind: str) -> None:
    """However it is deformed: no resultant, no moment, a symmetric derivative, and F . x = d V, since the volume is of degree d."""
    part, random = parts()[kind], np.random.default_rng(4)
    d, n = part.dimension, len(part.points)
    x = part.points @ (np.eye(d) + 0.3 * random.standard_normal((d, d))).T + 0.05 * random.standard_normal((n, d))
    surfaces = list(part.surfaces.values())
    F = sum((nodal_sum(facet_forces(x[f]), f, n) for f in surfaces), np.zeros((n, d)))
    size = np.abs(F).sum()
    assert np.abs(F.sum(axis=0)).max() < 1e-14 * size
    moment = x[:, :, None] * F[:, None, :]
    assert np.abs(moment - moment.transpose(0, 2, 1)).sum() > 1e-3  # of the nodes one by one
    assert np.abs((moment - moment.transpose(0, 2, 1)).sum(axis=0)).max() < 1e-13 * size
    blocks = np.zeros((n, n, d, d))
    for facets in surfaces:
        np.add.at(blocks, (facets[:, :, None], facets[:, None, :]), facet_tangents(x[facets]))
    K = blocks.transpose(0, 2, 1, 3).reshape(n * d, n * d)
    assert np.abs(K - K.T).max() < 1e-13 * np.abs(K).max()
    way, h = random.standard_normal((n, d)), 1e-4

    def volume(y: np.ndarray) -> float:
        return float(sum(np.vdot(nodal_sum(facet_forces(y[f]), f, n), y) for f in surfaces)) / d

    assert_allclose((volume(x + h * way) - volume(x - h * way)) / (2 * h), np.vdot(F, way), rtol=1e-6, atol=1e-9)
