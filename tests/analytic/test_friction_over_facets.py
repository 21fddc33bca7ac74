"""Friction by the way slid, or by the rate of statics, of a block that is drawn far over a floor of finer cells, as new contacts come."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from fcsim import Body, Detector, Everything, Material, QuasiStatic, Simulation, Support, Theta, build_model
from fcsim.contact_detection import SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, SlipWeakening, StaticKinetic
from fcsim.mesh import rectangle


@pytest.mark.each_value
@pytest.mark.parametrize("rule", ["everything", "segments"])
@pytest.mark.parametrize(
    ("friction", "scheme", "pace"),
    [(SlipWeakening(0.8, 0.2, 0.05), Theta(1e-2, 1.0), 1.0), (StaticKinetic(0.8, 0.2), QuasiStatic(1.0), 0.01)],
    ids=["by slip", "by rate"],
)
def test_what_a_sliding_block_comes_to_slides_on(friction: Any, scheme: Theta | QuasiStatic, pace: float, rule: Any) -> None:
    """30 steps of 10 mm, six times the way that weakens: 0.8 as it begins, then 0.2 at every contact. Nodes of the floor under the block,
    and points of `segments` in each next facet, had 0.8 anew: 0.225 and 0.46 by slip, up to 0.29 and 0.42 by rate."""
    stone = Material(1e8, 0.0, 1000.0)
    block = Body("block", rectangle("b", (0.4, 0.1), (4, 2), stone))
    bed = Body("bed", rectangle("f", (1.0, 0.2), (40, 2), stone, origin=(0, -0.2)))
    pressed = Support("block", ("y",), "y+", velocity=lambda t: -1e-4 / scheme.h if t <= 1.5 * scheme.h else 0.0)
    held = [Support("bed", ("x", "y"), "y-"), Support("block", ("x",), "y+", velocity=pace), pressed]
    model = build_model([bed, block], supports=held)
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("bed", "y+")]), 0.5, 0.01, "segments")
    detection = Everything(model, 0.5) if rule == "everything" else Detector([pair], model.n_nodes)
    found = []
    for step in Simulation(model, detection, replace(scheme, law=Gap(friction=friction)), 30, created=float("inf")):
        across, normal = step.contact_force_on("block")
        found.append(abs(across / normal))
    assert found[0] == pytest.approx(0.8, abs=1e-3)
    assert found[-1] == pytest.approx(0.2, abs=1e-3)
