"""Press and shear on the four meshes of the benchmark and three rules of contact, beside four programs' figures.

    python cases/press_and_shear/compare_meshes.py [--out DIR]

prints the tables of the README in Markdown and draws DIR/press_and_shear.png (default: beside this file). About two minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fcsim import load_case
from fcsim.view.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, SKY, STYLE, figure, matplotlib, save

# nodes: divisions of the bottom and of the top block
MESHES = {
    123: ((4, 4, 2), (3, 3, 2)),
    596: ((9, 9, 3), (6, 6, 3)),
    2262: ((15, 15, 5), (10, 10, 5)),
    5672: ((21, 21, 7), (14, 14, 7)),
}
# meshes whose nodes meet on the interface: all rules are the same there but for the border of the top block
MATCHING = {k: ((6 * k, 6 * k, 2 * k), (4 * k, 4 * k, 2 * k)) for k in (1, 2, 3, 4)}
# normal force [N] after the press: programs with contact integrated over the slave surface (augmented Lagrangian), and node-to-segment ones
INTEGRAL = {123: 6.36e5, 596: 6.18e5, 2262: 6.14e5}
NODE_TO_SEGMENT = {123: 6.85e5, 596: 6.48e5, 2262: 6.30e5, 5672: 6.24e5}
RATIO = {123: 0.492, 596: 0.490, 2262: 0.489}  # |R_x / R_z| after the shear
RULES = {"nodes": "node-to-segment", "mortar": "mortar", "mortar-faces": "mortar-faces"}


def forces(divisions: tuple[tuple[int, ...], tuple[int, ...]], rule: str, steps: int = 10) -> np.ndarray:
    """Forces (steps, 3) [N] on the bottom block after each load step."""
    script = load_case(Path(__file__).parent)
    parameters = script.parameters(bottom_divisions=divisions[0], top_divisions=divisions[1], candidates=rule)
    case = script.build(parameters)
    return np.array([step.contact_force_on(0) for step, _ in zip(case.simulation, range(steps), strict=False)])


def measure() -> dict[str, dict[int, np.ndarray]]:
    """Forces after each step for each rule and mesh."""
    return {rule: {nodes: forces(divisions, rule) for nodes, divisions in MESHES.items()} for rule in RULES}


def table(found: dict[str, dict[int, np.ndarray]]) -> str:
    """The README's two tables."""
    lines = ["| normal force after the press [kN] | " + " | ".join(f"{n} nodes" for n in MESHES) + " |", "|---" * (1 + len(MESHES)) + "|"]
    for rule in RULES:
        theirs = NODE_TO_SEGMENT if rule == "nodes" else INTEGRAL
        if rule != "mortar-faces":
            other = "node-to-segment programs" if rule == "nodes" else "integral programs"
            lines.append(f"| {other} | " + " | ".join(f"{theirs[n] / 1e3:.0f}" if n in theirs else "-" for n in MESHES) + " |")
        values = {n: -f[1, 2] for n, f in found[rule].items()}
        cells = [f"{v / 1e3:.1f}" + (f" ({100 * (v / theirs[n] - 1):+.1f} %)" if n in theirs else "") for n, v in values.items()]
        lines.append(f"| **fcsim, {RULES[rule]}** | " + " | ".join(cells) + " |")
    lines += ["", "| R_x / R_z after the shear | " + " | ".join(f"{n} nodes" for n in MESHES) + " |", "|---" * (1 + len(MESHES)) + "|"]
    lines.append("| the programs | " + " | ".join(f"{RATIO[n]:.3f}" if n in RATIO else "-" for n in MESHES) + " |")
    for rule, name in RULES.items():
        cells = [f"{abs(f[-1, 0] / f[-1, 2]):.4f}" for f in found[rule].values()]
        lines.append(f"| **fcsim, {name}** | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(found: dict[str, dict[int, np.ndarray]], matching: dict[float, float], path: Path) -> Path:
    """Left: normal force against the element size; right: the ratio of the forces against the shear, on the finest mesh."""
    with matplotlib().rc_context({**STYLE, "savefig.dpi": 110}):
        drawing = figure(10.0, 4.2, layout="constrained")
        left, right = drawing.subplots(1, 2)
        size = {n: 1.0 / divisions[1][0] for n, divisions in MESHES.items()}
        for rule, colour, mark in (("nodes", ORANGE, "s"), ("mortar", BLUE, "o"), ("mortar-faces", SKY, "v")):
            ours = [-f[1, 2] / 1e3 for f in found[rule].values()]
            left.plot([size[n] for n in MESHES], ours, "-" + mark, color=colour, label=f"fcsim, {RULES[rule]}")
        for theirs, colour, name in ((NODE_TO_SEGMENT, RED, "node-to-segment"), (INTEGRAL, BLACK, "integral")):
            x, y = [size[n] for n in theirs], [f / 1e3 for f in theirs.values()]
            left.plot(x, y, "x", color=colour, markersize=10, label=f"programs, {name}")
        left.plot(list(matching), [f / 1e3 for f in matching.values()], "--^", color=GREEN, label="fcsim, mortar, matching meshes")
        left.set(xlabel="element size of the top block [m]", ylabel="[kN]", title="Normal force after the press", xlim=(0, None))
        left.legend(fontsize=9)
        shear = 0.1 * np.arange(9)  # [mm]
        for rule, colour, style in (("nodes", ORANGE, "s"), ("mortar", BLUE, "-")):
            f = found[rule][5672][1:]
            right.plot(shear, np.abs(f[:, 0] / f[:, 2]), style, color=colour, label=f"fcsim, {RULES[rule]}")
        right.axhline(0.5, color=BLACK, linewidth=1, linestyle=":")
        right.text(0.0, 0.5, "friction bound", color=GREY, va="bottom", fontsize=9)
        right.set(xlabel="imposed shear [mm]", ylabel="R_x / R_z", title="Shear, 5672 nodes", ylim=(0, 0.56))
        right.legend(fontsize=9, loc="lower right")
        return save(drawing, path)


def limit(sizes: Sequence[float], values: Sequence[float]) -> float:
    """What the two finest meshes say for element size 0, linearly: the corners of the top block leave first order."""
    (h, k), (f, g) = sizes[-2:], values[-2:]
    return g - k * (f - g) / (h - k)


def run(out: Path) -> None:
    found = measure()
    matching = {1.0 / top[0]: float(-forces((bottom, top), "mortar", steps=2)[-1, 2]) for bottom, top in MATCHING.values()}
    print(table(found))
    print()
    sizes = [1.0 / top[0] for _, top in MESHES.values()]
    print("Matching meshes, element size [m]: normal force [kN]: " + ", ".join(f"{h:.4f}: {f / 1e3:.1f}" for h, f in matching.items()))
    limits = {RULES[rule]: limit(sizes, [-f[1, 2] for f in meshes.values()]) for rule, meshes in found.items()}
    limits["matching meshes"] = limit(list(matching), list(matching.values()))
    print("Extrapolated to element size 0 [kN]: " + ", ".join(f"{name} {f / 1e3:.1f}" for name, f in limits.items()))
    print(draw(found, matching, out / "press_and_shear.png"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder of the picture (default: beside this script)")
    run(parser.parse_args().out)
