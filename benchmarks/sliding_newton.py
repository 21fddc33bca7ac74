"""Residuals of the outer Newton iteration of steps with large sliding, by rule of contact: a punch pressed into a bed and drawn along it.

    .venv/bin/python benchmarks/sliding_newton.py
    .venv/bin/python benchmarks/sliding_newton.py --dimension 3 --mu 0.3 --rules smooth,mortar
    .venv/bin/python benchmarks/sliding_newton.py --mu 0.3 --slide 0.1 --rules nodes,smooth --loop one

Bodies are neo-Hookean; the punch is pressed by a fifth of the bed's height in two steps, then drawn along in two. Nothing is written.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh import Body
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation

RULES: dict[str, dict[str, Any]] = {
    "nodes": {},
    "smooth": {"normals": "smooth"},
    "mortar": {"candidates": "mortar"},
    "segments": {"candidates": "segments"},
    "everything": {},
}
"""Keywords of `SurfacePair`; "everything" is the detection that needs no pairs."""


def punch(dimension: int, rule: str, mu: float, slide: float, loop: str = "auto") -> Simulation:
    """The bed of 4 x 1 (x 1 deep) and the punch of 0.5, with facets shorter than the bed's."""
    soft, hard = neo_hooke(1e6, 0.3, 1.0), neo_hooke(3e6, 0.3, 1.0)
    up = "xyz"[dimension - 1]
    if dimension == 2:
        bed, block, place = rectangle("bed", (4.0, 1.0), (4, 2), soft), rectangle("punch", (0.5, 0.5), (3, 3), hard), (0.6, 1.0)
    else:
        bed, block = brick("bed", (2.0, 1.0, 0.5), (4, 2, 1), soft), brick("punch", (0.5, 0.5, 0.3), (2, 2, 1), hard)
        place = (0.37, 0.21, 0.5)
    depth = 0.2 if dimension == 2 else 0.1
    supports = [
        Support("bed", tuple("xyz"[:dimension]), f"{up}-"),
        Support("punch", (up,), f"{up}+", velocity=lambda t: -depth if t < 1 else 0.0),
        Support("punch", ("x",), f"{up}+", velocity=lambda t: slide if t > 1 else 0.0),
    ]
    if dimension == 3:
        supports.append(Support("punch", ("y",), f"{up}+"))
    model = build_model([Body("bed", bed), Body("punch", block, translation=place)], supports=supports)
    detection: Any = Everything(model, mu=mu, alert=0.05)
    if rule != "everything":
        surfaces = (contact_surface(model, [of]) for of in (("punch", f"{up}-"), ("bed", f"{up}+")))
        detection = Detector([SurfacePair(*surfaces, mu, 0.05, **RULES[rule])], model.n_nodes)
    anywhere = Limits(rotation=np.inf, strain=np.inf)
    return Simulation(model, detection, QuasiStatic(0.5), 4, SolverSettings(tol=1e-12, loop=loop), limits=anywhere, witness=None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dimension", type=int, default=2, choices=(2, 3))
    parser.add_argument("--mu", type=float, default=0.0)
    parser.add_argument("--slide", type=float, default=0.2, help="a second, along the bed")
    parser.add_argument("--rules", default=",".join(RULES))
    parser.add_argument("--loop", default="sequence", choices=("sequence", "one"), help="how bodies and contacts are iterated")
    options = parser.parse_args()
    rules = options.rules.split(",")
    if unknown := [rule for rule in rules if rule not in RULES]:
        raise InputError(f"--rules: expected some of {', '.join(RULES)}, got {unknown[0]!r}")
    table = Table("rule", "step", "", "residuals, of the motion or of contact", title=f"{options.dimension}D, mu = {options.mu:g}")
    for rule in rules:
        for step in punch(options.dimension, rule, options.mu, options.slide, options.loop):
            residuals = " ".join(f"{max(problem.residual, problem.result.error):.1e}" for problem in step.linearised)
            table.add_row(rule, str(step.number), "pressed" if step.state.t <= 1 else "drawn", residuals)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
