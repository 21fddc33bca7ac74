"""A ring with an interference that statics turn in its casing: it bears Lame's pressure and is braked by mu N, whatever a load step turns.

The contacts of a step's beginning open by R (1 - cos(angle)) as bodies turn: of an interference of 1e-3 R a step of 2.25
degrees left 0.23, of 4.5 nothing. The pressure of both rings, held within and without, is that of `test_raised`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim import (
    Body,
    Detector,
    DrivenRotation,
    Everything,
    Material,
    QuasiStatic,
    Simulation,
    Support,
    SurfacePair,
    Witness,
    build_model,
    contact_surface,
)
from fcsim.mesh import Part

E, NU, A, B, C, INTERFERENCE, MU = 1e7, 0.3, 0.05, 0.1, 0.15, 1e-4, 0.3


def lame() -> float:
    """The force between the rings [N] a metre of their axis (G. Lame, 1852)."""
    give = [B * abs(1 - k) / (E / (1 + NU) * (1 / (1 - 2 * NU) + k)) for k in ((A / B) ** 2, (C / B) ** 2)]
    return 2 * np.pi * B * INTERFERENCE / sum(give)


def ring(name: str, inner: float, outer: float, around: int, first: float) -> Part:
    angle, radius = first + 2 * np.pi * np.arange(around) / around, np.linspace(inner, outer, 4)
    points = (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).reshape(-1, 2)
    here, after = np.arange(around), np.roll(np.arange(around), -1)
    cells = np.concatenate([np.stack([k + here, k + around + here, k + around + after, k + after], axis=1) for k in np.arange(3) * around])
    surfaces = {"in": np.stack([after, here], axis=1), "out": 3 * around + np.stack([here, after], axis=1)}
    return Part(name, points, cells, "quadrilateral", surfaces, Material(E, NU, 1000.0), elements="Q1-enhanced")


@pytest.mark.parametrize("degrees", [2.25, 4.5, 9.0])
@pytest.mark.parametrize("rule", ["mortar", "nodes", "Everything"])
def test_a_ring_turns_in_its_casing(rule: Any, degrees: float) -> None:
    bodies = [Body("casing", ring("casing", B, C, 28, 0.03)), Body("hub", ring("hub", A, B + INTERFERENCE, 36, 0.0), kinematics="turning")]
    turned = DrivenRotation("hub", lambda t: np.deg2rad(degrees) * max(t - 1.0, 0.0), (0.0, 0.0), surface="in")
    model = build_model(bodies, supports=[Support("casing", ("x", "y"), "out"), turned])
    slave, master = contact_surface(model, [("hub", "out")]), contact_surface(model, [("casing", "in")])
    detection: Any = Everything(model, MU)
    if rule != "Everything":
        pair = SurfacePair(slave, master, MU, 5e-3, rule, normals="smooth" if rule == "nodes" else "facet")
        detection = Detector([pair], model.n_nodes)
    steps = list(Simulation(model, detection, QuasiStatic(1.0), 4, witness=Witness(initial="allow")))
    for step in steps:
        assert step.contact_force[:, 0].sum() == pytest.approx(lame(), rel=0.02)
        assert not any("fit each other" in said for said in step.remarks)
    contacts, force = steps[-1].contacts, np.einsum("ad,ade->ae", steps[-1].contact_force, steps[-1].contacts.frame)
    on_hub = np.where(contacts.bodies[:, 0] == model.number["hub"], 1.0, -1.0)
    torque = on_hub @ (contacts.point[:, 0] * force[:, 1] - contacts.point[:, 1] * force[:, 0])
    assert torque == pytest.approx(-MU * B * lame(), rel=0.04)
