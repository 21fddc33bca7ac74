"""The tractions of partial slip beside the formulas: a table on standard output, plots/traction.png in the folder.

python cases/cattaneo_mindlin/traction.py --divisions 8,16,32 --out results/cattaneo_mindlin
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
from fcsim.view.style import BLACK, BLUE, GREY, ORANGE, RED, STYLE, figure, matplotlib, prefixed, save


class Record(NamedTuple):
    """A step of the tangential loading: forces [N], c/a from the forces, nodes (r, pressure, traction, area)."""

    P: float
    Q: float
    stick_ratio: float
    nodes: tuple[FloatArray, FloatArray, FloatArray, FloatArray]


class Refinement(NamedTuple):
    """One mesh: `slip` the formulas, the tangential steps, the errors as root mean squares over these steps.

    ratio_error is that of c/a, traction_error that of the traction in the L2 norm over the surface, relative to mu times the pressure's.
    """

    divisions: int
    element: float
    nodes: int
    slip: Any
    steps: list[Record]
    ratio_error: float
    traction_error: float


def refine(script: CaseScript, assignments: dict[str, str], divisions: int) -> Refinement:
    p: Any = parse_parameters(script, {**assignments, "divisions": str(divisions)})
    module = sys.modules[script.build.__module__]
    case = script.build(p)
    model = case.simulation.model
    slip, loaded = module.formulas(p), module.Loaded(model, p)
    steps, errors = [], []
    for step in case.simulation:
        if step.number <= p.steps / 2:
            continue
        P, Q = loaded.resultants(step)
        record = Record(P, Q, loaded.stick_ratio(step), loaded.nodal_tractions(step))
        r, _, traction, area = record.nodes
        difference = traction - slip.traction(r, record.P, record.Q)
        norm = np.sqrt(area @ difference**2 / (area @ (p.mu * slip.pressure(r, record.P)) ** 2))
        errors.append((record.stick_ratio - slip.stick_ratio(record.P, record.Q), norm))
        steps.append(record)
    mean = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
    return Refinement(divisions, p.core * p.contact_radius / divisions, model.n_nodes, slip, steps, *mean)


def table(found: list[Refinement]) -> str:
    lines = ["| elements along the core | nodes | Q/(mu P) | c/a, formula | c/a, forces | error of c/a | error of the traction, L2 |"]
    lines.append("|" + "---|" * 7)
    for one in found:
        last = one.steps[-1]
        exact = one.slip.stick_ratio(last.P, last.Q)
        ratio = last.Q / (one.slip.mu * last.P)
        lines.append(
            f"| {one.divisions} | {one.nodes} | {ratio:.4f} | {exact:.4f} | {last.stick_ratio:.4f} | {one.ratio_error:.2g} | "
            f"{100 * one.traction_error:.2g} % |"
        )
    return "\n".join(lines)


def draw(one: Refinement, title: str, path: Path) -> Path:
    """Tractions at three steps over the distance, and c/a over Q/(mu P), both beside the formulas."""
    slip, last = one.slip, one.steps[-1]
    a, limit = slip.radius(last.P), slip.mu * slip.peak(last.P)
    metre, length = prefixed("m", a)
    pascal, stress = prefixed("Pa", limit)
    r = np.linspace(0, 1.1 * a, 600)
    with matplotlib().rc_context({**STYLE, "savefig.dpi": 120}):
        drawing = figure(11.0, 4.6, layout="constrained")
        left, right = drawing.subplots(1, 2)
        left.plot(r / metre, slip.mu * slip.pressure(r, last.P) / pascal, "--", color=GREY, label="friction × Hertz's pressure")
        count = len(one.steps)
        for k, colour in zip((count // 3, 2 * count // 3, count - 1), (BLUE, ORANGE, RED), strict=True):
            step = one.steps[k]
            distance, _, traction, _ = step.nodes
            left.plot(r / metre, slip.traction(r, step.P, step.Q) / pascal, color=colour)
            label = f"Q/(µP) = {step.Q / (slip.mu * step.P):.2f}"
            left.plot(distance / metre, traction / pascal, "o", markersize=5, fillstyle="none", color=colour, label=label)
        left.set(xlabel=f"distance from the middle [{length}]", ylabel=f"tangential traction [{stress}]", xlim=(0, 1.1 * a / metre))
        left.set_ylim(0, 1.2 * limit / pascal)
        left.legend(loc="upper right", ncols=2)
        ratio = np.linspace(0, 1, 300)
        right.plot(ratio, (1 - ratio) ** (1 / slip.d), color=BLACK, label=f"(1 − Q/(µP))^(1/{slip.d})")
        measured = [(step.Q / (slip.mu * step.P), step.stick_ratio) for step in one.steps]
        right.plot(*np.transpose(measured), "o", color=RED, fillstyle="none", label="from the nodal forces")
        right.set(xlabel="Q/(µP)", ylabel="radius of the stick zone c/a", xlim=(0, 1), ylim=(0, 1.05))
        right.legend(loc="lower left")
        drawing.suptitle(f"{title}, {one.divisions} elements along the core")
        return save(drawing, path)


def main() -> int:
    return refinement_command(
        Path(__file__),
        "Converge the partial slip and draw its tractions.",
        "8,16,32",
        refine,
        table,
        lambda found, title, folder: draw(found[-1], title, folder / "traction.png"),
    )


if __name__ == "__main__":
    raise SystemExit(main())
