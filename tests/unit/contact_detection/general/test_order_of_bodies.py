"""Contacts of curved bodies whose vertices meet are the same whichever body comes first."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from fcsim import Body, Everything, Material, build_model
from fcsim.mesh import half_disk

SOFT = Material(3e4, 0.3, 1.0)


def found(names: tuple[str, str]) -> dict[frozenset[tuple[str, int]], tuple[float, np.ndarray]]:
    """Gap and normal, upwards, of each contact of two disks pressed together by 0.01, by the nodes it joins."""
    parts = {"upper": half_disk("upper", 10.0, 0.8, 16, SOFT), "lower": half_disk("lower", 13.0, 0.8, 16, SOFT, side="below")}
    model = build_model([Body(name, parts[name]) for name in names])
    x = model.reference.copy()
    for name, k in model.number.items():
        rows = slice(*model.node_offset[k : k + 2])
        x[rows] += 1e-4 * np.random.default_rng(len(parts[name].points)).normal(size=x[rows].shape)
        x[rows, -1] -= 0.01 * (name == "upper")
    contacts, contact = Everything(model, 0.0)(x), {}
    for nodes, gap, normal, slave in zip(contacts.nodes, contacts.gap, contacts.frame[:, 0], contacts.bodies[:, 0], strict=True):
        of = [(node, int(np.searchsorted(model.node_offset, node, side="right")) - 1) for node in nodes[nodes >= 0].tolist()]
        key = frozenset((model.bodies[k].name, int(node - model.node_offset[k])) for node, k in of)
        contact[key] = gap, normal if model.bodies[slave].name == "upper" else -normal
    return contact


def test_vertices_that_meet_have_a_normal_of_both_surfaces() -> None:
    """The facets at two vertices that meet lean differently; either body's own normal would be that of the one that comes first."""
    one, other = found(("upper", "lower")), found(("lower", "upper"))
    assert one.keys() == other.keys()
    assert any(len(key) == 2 for key in one)
    for key, (gap, normal) in one.items():
        assert_allclose(other[key][0], gap, atol=1e-12)
        assert_allclose(other[key][1], normal, atol=1e-12)
