"""The pressure of Hertz's contact beside the formula, and how it converges: a table on standard output, plots/pressure.png in the folder.

python cases/hertz/pressure.py --divisions 4,8,16,32 --set contact=cylinder --set approach=2.4e-4 --out results/hertz_cylinder
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fcsim import FloatArray
from fcsim.command_line.refinement import refinement_command
from fcsim.running.case import CaseScript
from fcsim.running.parameters import parse_parameters
from fcsim.view.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, STYLE, figure, matplotlib, prefixed, save

MARKS = (("s", 9, ORANGE), ("o", 7, BLUE), (".", 4, RED))  # coarse to fine, all visible where they coincide


class Refinement(NamedTuple):
    """One mesh: its size, the nodes' (r, pressure) at the last step, and the errors, root mean squares over the upper half of the steps.

    Errors are relative to the formulas for the computed force: contact radius, pressure in the middle, and the pressure's
    L2 norm over the surface.
    """

    divisions: int
    element: float
    nodes: int
    hertz: Any
    force: float
    r: FloatArray
    pressure: FloatArray
    radius_error: float
    peak_error: float
    pressure_error: float


def refine(script: CaseScript, assignments: dict[str, str], divisions: int) -> Refinement:
    p: Any = parse_parameters(script, {**assignments, "divisions": str(divisions)})
    module = sys.modules[script.build.__module__]
    case = script.build(p)
    hertz, loaded = module.formulas(p), module.Loaded(case.simulation.model, p)
    errors = []
    for step in case.simulation:
        if step.number <= p.steps / 2:
            continue
        P = loaded.force(step)
        r, pressure, area = loaded.nodal_pressure(step)
        exact = hertz.pressure(r, P)
        errors.append(
            (
                loaded.radius(step) / hertz.radius(P) - 1,
                loaded.peak(step) / hertz.peak(P) - 1,
                np.sqrt(area @ (pressure - exact) ** 2 / (area @ exact**2)),
            )
        )
    core = p.core * hertz.radius(hertz.force(p.approach))
    mean = np.sqrt(np.mean(np.square(errors), axis=0))
    return Refinement(divisions, core / divisions, case.simulation.model.n_elastic // hertz.d, hertz, P, r, pressure, *mean.tolist())


def table(found: list[Refinement]) -> str:
    """The errors and, from one mesh to the next, their orders in the size of the elements."""
    lines = ["| elements along the core | nodes | radius | order | pressure in the middle | order | pressure, L2 | order |"]
    lines.append("|" + "---|" * 8)
    before = None
    for one in found:
        cells = [f"{one.divisions}", f"{one.nodes}"]
        for name in ("radius_error", "peak_error", "pressure_error"):
            error, order = getattr(one, name), ""
            if before is not None:
                order = f"{np.log(getattr(before, name) / error) / np.log(before.element / one.element):.1f}"
            cells += [f"{100 * error:.2g} %", order]
        lines.append("| " + " | ".join(cells) + " |")
        before = one
    return "\n".join(lines)


def draw(found: list[Refinement], title: str, path: Path) -> Path:
    """Pressure over the distance beside the formula, and the errors over the size of the elements."""
    finest = found[-1]
    a, p0 = finest.hertz.radius(finest.force), finest.hertz.peak(finest.force)
    metre, length = prefixed("m", a)
    pascal, stress = prefixed("Pa", p0)
    with matplotlib().rc_context({**STYLE, "savefig.dpi": 120}):
        drawing = figure(11.0, 4.6, layout="constrained")
        left, right = drawing.subplots(1, 2)
        r = np.linspace(0, 1.15 * a, 400)
        exact = finest.hertz.pressure(r, finest.force) / pascal
        left.plot(r / metre, exact, color=BLACK, label=f"Hertz: a = {a / metre:.3g} {length}, p0 = {p0 / pascal:.4g} {stress}")
        for one, (mark, points, colour) in zip(found[:3], MARKS, strict=False):
            label = f"{one.divisions} elements"
            left.plot(one.r / metre, one.pressure / pascal, mark, markersize=points, fillstyle="none", color=colour, label=label)
        left.set(xlabel=f"distance from the middle [{length}]", ylabel=f"nodal pressure [{stress}]", xlim=(0, 1.15 * a / metre))
        left.set_ylim(0, 1.15 * p0 / pascal)
        left.legend(loc="lower left")
        size = np.array([one.element for one in found])
        for name, label, colour, mark in (
            ("pressure_error", "pressure, L2", RED, "s"),
            ("radius_error", "radius", BLUE, "o"),
            ("peak_error", "pressure in the middle", GREEN, "^"),
        ):
            right.loglog(size / a, [getattr(one, name) for one in found], mark + "-", color=colour, label=label)
        for slope, dash in ((1, "--"), (2, ":")):
            right.loglog(size / a, 0.2 * (size / a) ** slope, dash, color=GREY, linewidth=1.2, label=f"order {slope}")
        right.set(xlabel="element / contact radius", ylabel="relative error")
        right.set_xticks(size / a, [f"{value:.2g}" for value in size / a], minor=False)
        right.minorticks_off()
        right.legend(loc="best", ncols=2)
        drawing.suptitle(title)
        return save(drawing, path)


def main() -> int:
    return refinement_command(
        Path(__file__),
        "Converge Hertz's contact and draw its pressure.",
        "4,6,8",
        refine,
        table,
        lambda found, title, folder: draw(found, title, folder / "pressure.png"),
    )


if __name__ == "__main__":
    raise SystemExit(main())
