"""Which nodes contacts with exact shapes can touch: the skin's, no inner ones, whose compliance nobody asks for."""

import numpy as np
import pytest

from fcsim import Body, Everything, ExactContacts, InputError, Material, build_model
from fcsim.mesh import brick, rigid_box, rigid_sphere


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


def test_curved_and_smooth_are_those_of_the_meshed_bodies() -> None:
    """Normals between meshed bodies are interpolated as `Everything` has them; names of others are refused."""
    boxes = [rigid_box("box", (1, 1, 1), (0, 0, 0.5), 1.0), rigid_box("base", (3, 3, 1), (0, 0, -0.5), 1.0)]
    model = build_model([*boxes, rigid_sphere("ball", 1.0, (0.0, 0.0, 9.0), 1.0)])
    meshed = ExactContacts(model, 0.3, curved=iter(["base"]), smooth=False).meshed
    assert meshed is not None
    assert meshed.curved == ("base",) and not meshed.smooth
    assert list(meshed.smoothed_bodies) == list(Everything(build_model(boxes), 0.3, curved=["base"]).smoothed_bodies)
    for wrong in ({"curved": ["ball"]}, {"curved": "base"}, {"curved": ["nobody"]}, {"smooth": 1}):
        with pytest.raises(InputError, match=f"ExactContacts, {next(iter(wrong))}: expected"):
            ExactContacts(model, 0.3, **wrong)  # type: ignore[arg-type]
