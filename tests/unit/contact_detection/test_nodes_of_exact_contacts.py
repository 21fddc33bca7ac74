"""Which nodes contacts with exact shapes can touch: the skin's, no inner ones, whose compliance nobody asks for."""

import numpy as np
import pytest

from fcsim import Body, ExactContacts, Material, build_model
from fcsim.mesh import brick, rigid_sphere


@pytest.mark.parametrize("bodies", [1, 2])
def test_inner_nodes_are_none(bodies: int) -> None:
    """A brick of 6 x 6 x 6 cells has 7^3 - 5^3 nodes on its skin; the contacts that are found have no others."""
    n, soft = 6, Material(E=1e9, nu=0.3, density=1000.0)
    part = brick("block", (1.0, 1.0, 1.0), (n, n, n), soft, origin=(-0.5, -0.5, -1.0))
    blocks = [Body(f"block {k}", part, translation=(0.0, 0.0, -1.0 * k)) for k in range(bodies)]
    model = build_model([*blocks, rigid_sphere("ball", 1.0, (0.0, 0.0, 1.0), 1.0)])
    contact = ExactContacts(model, mu=0.3)
    own = contact.nodes[contact.nodes < bodies * len(part.points)]
    assert len(own) == bodies * ((n + 1) ** 3 - (n - 1) ** 3)
    inner = np.abs(part.points - (0.0, 0.0, -0.5)).max(axis=1) < 0.5 - 1e-9
    assert not inner[own % len(part.points)].any()
    met = contact(model.reference)
    assert len(met) and np.isin(met.nodes[met.nodes >= 0], contact.nodes).all()
