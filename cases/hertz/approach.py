"""How far bodies of finite size are from Hertz's half-spaces: two spheres, SSNV104 of code_aster and smaller approaches.

    python cases/hertz/approach.py --divisions 8 --out results/two_spheres

prints a table of force, contact radius and pressure over the formulas, for the approach and for the computed force, and draws the
deviations over a/R: plots/approach.png in the folder.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fcsim import FcsimError, load_case
from fcsim.running.case import CaseScript
from fcsim.view.style import BLUE, GREEN, GREY, ORANGE, RED, STYLE, figure, matplotlib, save

APPROACHES = (4e-3, 1e-3, 2.5e-4, 6.25e-5)  # [m]; the first is SSNV104's, each next one has half the a/R


class Pressed(NamedTuple):
    """The last step of an approach [m]: a/R by the formula; over the formulas for the approach: force, radius, peak; radius and peak over
    the formulas for the computed force; radius [m] and peak [Pa] themselves."""

    approach: float
    aspect: float
    force: float
    radius: float
    peak: float
    radius_for_force: float
    peak_for_force: float
    a: float
    p0: float


def press(script: CaseScript, parameters: dict[str, Any], approach: float) -> Pressed:
    p = script.parameters(contact="two-spheres", approach=approach, steps=10, **parameters)
    module = sys.modules[script.build.__module__]
    case = script.build(p)
    hertz, loaded = module.formulas(p), module.Loaded(case.simulation.model, p)
    for step in case.simulation:
        last = step
    P, exact = loaded.force(last), hertz.force(approach)
    a, p0 = loaded.radius(last), loaded.peak(last)
    return Pressed(
        approach,
        hertz.radius(exact) / p.radius,
        P / exact,
        a / hertz.radius(exact),
        p0 / hertz.peak(exact),
        a / hertz.radius(P),
        p0 / hertz.peak(P),
        a,
        p0,
    )


def table(found: list[Pressed]) -> str:
    lines = [
        "| approach | a/R | force / Hertz | radius / Hertz | p0 / Hertz | radius, p0 / Hertz for the computed force |",
        "|" + "---|" * 6,
    ]
    for one in found:
        lines.append(
            f"| {1e3 * one.approach:g} mm | {one.aspect:.3g} | {one.force:.3f} | {1e3 * one.a:.3f} mm, {one.radius:.3f} | "
            f"{1e-6 * one.p0:.0f} MPa, {one.peak:.3f} | {one.radius_for_force:.3f}, {one.peak_for_force:.3f} |"
        )
    return "\n".join(lines)


def draw(found: list[Pressed], title: str, path: Path) -> Path:
    """Deviations from the formulas for the approach, which fall with a/R, and from those for the computed force: the mesh's error."""
    aspect = np.array([one.aspect for one in found])
    with matplotlib().rc_context({**STYLE, "savefig.dpi": 120}):
        drawing = figure(7.5, 4.8, layout="constrained")
        axes = drawing.subplots()
        for name, label, colour, mark in (
            ("force", "force for the approach", RED, "s-"),
            ("radius", "radius for the approach", BLUE, "o-"),
            ("peak", "pressure for the approach", GREEN, "^-"),
            ("radius_for_force", "radius for the force", BLUE, "o:"),
            ("peak_for_force", "pressure for the force", ORANGE, "^:"),
        ):
            axes.loglog(aspect, [abs(getattr(one, name) - 1) for one in found], mark, color=colour, label=label)
        axes.loglog(aspect, 0.35 * aspect, "--", color=GREY, linewidth=1.2, label="order 1")
        axes.set_xticks(aspect, [f"{value:.2g}" for value in aspect])
        axes.minorticks_off()
        axes.set(xlabel="a/R", ylabel="deviation from Hertz's formulas", title=title)
        drawing.legend(loc="outside right upper")
        return save(drawing, path)


def main() -> int:
    parser = argparse.ArgumentParser(description="Press two spheres by smaller and smaller approaches.")
    parser.add_argument("--divisions", type=int, default=8, help="elements along the half-width of the core (default 8)")
    parser.add_argument("--out", type=Path, default=Path("results/two_spheres"), help="folder of the picture")
    options = parser.parse_args()
    try:
        script = load_case(Path(__file__).parent)
        found = [press(script, {"divisions": options.divisions}, approach) for approach in APPROACHES]
        print(table(found))
        title = f"Two spheres, {options.divisions} elements along the core"
        print(draw(found, title, options.out / "plots" / "approach.png"))
    except FcsimError as error:
        print(f"approach.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
