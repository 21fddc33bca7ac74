"""Each mistake of docs/mistakes.md, made: it is answered once, by a message that names the mend, and the page quotes it.

What a mistake gives is an InputError, an end of the run, or a remark of the run (which run.json keeps among its notes).
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim import (
    Body,
    Detector,
    DrivenRotation,
    Everything,
    FcsimError,
    InputError,
    Linkage,
    Material,
    Part,
    QuasiStatic,
    Simulation,
    SolverSettings,
    SpringDamper,
    Support,
    SurfacePair,
    Theta,
    Witness,
    build_model,
    contact_surface,
)
from fcsim.assembly.loads import Force, Traction
from fcsim.assembly.model import Model
from fcsim.command_line.main import main
from fcsim.command_line.start.begin import TEMPLATE
from fcsim.mesh import brick, read_mesh, rectangle, rigid_box

PAGE = (Path(__file__).parents[2] / "docs" / "mistakes.md").read_text(encoding="utf-8")
ALL = ("x", "y", "z", "rx", "ry", "rz")
FLOOR = rigid_box("floor", size=(1.0, 0.4, 0.1), centre=(0.1, 0.05, -0.05), mass=1.0)
STONE = Material(E=2e8, nu=0.2, density=2000.0)


def block(material: Material = STONE, size: tuple[float, float, float] = (0.2, 0.1, 0.1)) -> Part:
    return brick("block", size=size, divisions=(2, 1, 1), material=material)


def with_inertia(moments: tuple[float, float, float]) -> Model:
    """A rigid block of 4 kg with these moments of inertia [kg m^2] on the floor."""
    box = rigid_box("block", (0.2, 0.1, 0.1), (0.1, 0.05, 0.05), 4.0)
    return build_model([replace(box, inertia=np.diag(moments)), FLOOR], supports=[Support("floor", ALL)], gravity=lambda t: (0, 0, -9.81))


@pytest.mark.parametrize(
    ("moments", "what"),
    [((0.0067, 0.0167, 0.0167), ""), ((0.004, 0.004, 0.0167), "than the two others together"), ((0.05, 0.05, 0.05), "at 0.137 m")],
)
def test_an_inertia_is_that_of_masses_within_the_body(moments: tuple[float, float, float], what: str) -> None:
    """The block's own, m/12 (b^2 + c^2), rounded; one larger than both others; tr I / 2 = 0.075 > m R^2 = 0.06 of its corners."""
    (step,) = Simulation(with_inertia(moments), Everything(with_inertia(moments), 0.5), Theta(1e-3), 1)
    assert [what in remark for remark in step.remarks if "inertia" in remark] == ([True] if what else [])


def soup() -> Part:
    """The block, each cell with nodes of its own."""
    whole = block()
    cells = np.arange(whole.cells.size).reshape(whole.cells.shape)
    return Part("soup", whole.points[whole.cells].reshape(-1, 3), cells, whole.cell_type, {}, STONE)


def scene(part: Part | None = None, *more: Body, at: tuple[float, float, float] = (0.0, 0.0, 0.0), **given: Any) -> Model:
    """A block on a held floor; what is given takes the place of what is right."""
    right: dict[str, Any] = {"supports": [Support("floor", ALL)], "gravity": lambda t: (0.0, 0.0, -9.81), "beta": 1e-3}
    return build_model([FLOOR, Body("block", part or block(), translation=at), *more], **(right | given))


def said(model: Model, detector: Any = None, scheme: Any = None, steps: int = 10, **given: Any) -> str:
    """All remarks of the run of a model, a line each."""
    simulation = Simulation(model, detector or Everything(model, mu=0.5), scheme or Theta(h=1e-3), steps, SolverSettings(tol=1e-8), **given)
    return "\n".join(remark for step in simulation for remark in step.remarks)


def chords() -> str:
    """A quarter of a shaft of four facets, 1 mm too large for its hub of six, by facets' own normals."""
    bodies = []
    for name, inside, facets in (("hub", 1.0, 6), ("shaft", 0.501, 4)):
        part = rectangle(name, (0.5, np.pi / 2), (2, facets), Material(1e9, 0.3, 1000.0), origin=(inside, 0.0))
        r, angle = part.points.T
        bodies.append(Body(name, replace(part, points=np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1))))
    symmetry = [Support(body.name, (axis,), side) for body in bodies for axis, side in (("y", "y-"), ("x", "y+"))]
    model = build_model(bodies, supports=symmetry)
    shaft, hub = contact_surface(model, [("shaft", "x+")]), contact_surface(model, [("hub", "x-")])
    fit = Detector([SurfacePair(shaft, hub, 0.0, 1e-3, "nodes")], model.n_nodes)
    return said(model, fit, QuasiStatic(1.0), steps=1, witness=Witness(initial="allow"))


def forgotten_pair() -> str:
    """Of two blocks on each other, both of which the floor may touch."""
    model = scene(None, Body("upper", block(), translation=(0.0, 0.0, 0.1)))
    slaves, floor = contact_surface(model, [("block", "z-"), ("upper", "x-")]), contact_surface(model, [("floor", "z+")])
    return said(model, Detector([SurfacePair(slaves, floor, mu=0.5, alert=1e-3)], model.n_nodes), steps=1)


def surface_mesh(folder: Path) -> Part:
    import meshio

    points, faces = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), np.array([[0, 1, 2], [0, 1, 3]])
    meshio.write(folder / "skin.vtk", meshio.Mesh(points, [("triangle", faces)]))
    return read_mesh(folder / "skin.vtk", STONE)


def inside_out() -> Part:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    return Part("shard", points, [[1, 0, 2, 3]], "tetrahedron", {}, STONE)


def high() -> Model:
    return scene(at=(0.0, 0.0, 5.0))


def flat() -> Model:
    return build_model([FLOOR, Body("sheet", rectangle("sheet", (0.2, 0.1), (2, 1), STONE))])


def spring() -> Linkage:
    return Linkage(scene(), [SpringDamper("spring", "block", "celing", ((0.1, 0.05, 0.1), (0.1, 0.05, 0.5)), stiffness=100.0)])


def tipping() -> Model:
    """A rigid block at rest on a floor that only its centre holds."""
    box = rigid_box("block", (0.2, 0.1, 0.1), (0.1, 0.05, 0.05), 4.0)
    return build_model([box, FLOOR], supports=[Support("floor", ("x", "y", "z"))], gravity=lambda t: (0, 0, -9.81))


def turning() -> Model:
    return scene(supports=[DrivenRotation("floor", lambda t: 30 * t, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])


def friction_of(mu: float) -> str:
    model = scene()
    return said(model, Everything(model, mu=mu), steps=1)


def coarse() -> str:
    """Of a cantilever ten times as long as high, with two bricks of first order over its height."""
    part = brick("block", (1.0, 0.1, 0.1), (20, 2, 2), STONE)
    held, pulled = Support("block", ("x", "y", "z"), "x-"), Traction("block", "x+", (0.0, 0.0, -1e3))
    return said(build_model([Body("block", part)], supports=[held], loads=[pulled]), scheme=QuasiStatic(1.0), steps=1)


def shaken(h: float) -> str:
    """Of a floor that swings 50 times a second."""
    floor = [Support("floor", ("y", "z", "rx", "ry", "rz")), Support("floor", ("x",), velocity=lambda t: 0.5 * np.sin(100 * np.pi * t))]
    return said(scene(supports=floor), scheme=Theta(h=h))


def blow() -> str:
    """Of a blow on the block that lasts half a step, between two of them."""
    hammer = Force("block", (100.0, 0.0, 0.0), surface="x-", factor=lambda t: float(0.0103 < t < 0.0113))
    return said(scene(loads=[hammer]), scheme=Theta(h=2e-3))


def column() -> str:
    """A clamped column, fifty times as high as thick, under twice the load that buckles it, pi^2 E I / (4 H^2)."""
    part = brick("block", (0.02, 0.02, 1.0), (1, 1, 20), STONE, elements="Q1-enhanced")
    held, pressed = Support("block", ("x", "y", "z"), "z-"), Traction("block", "z+", (0.0, 0.0, -2 * np.pi**2 * STONE.E * 0.02**2 / 48))
    return said(build_model([Body("block", part)], supports=[held], loads=[pressed]), scheme=QuasiStatic(1.0), steps=1)


# title of the page's entry: the mistake, and what the answer says of the mend
MISTAKES: Mapping[str, tuple[Callable[[], object], str]] = {
    "Gravity points upwards": (lambda: said(scene(gravity=lambda t: (0, 0, 9.81)), steps=1), "Downwards its last component is negative"),
    "Gravity is a number": (lambda: scene(gravity=-9.81), "expected an acceleration, as (0.0, 0.0, -9.81)"),
    "Nothing is held": (lambda: said(scene(supports=[]), steps=1), "Hold the floor: Support('floor'"),
    "theta below one half": (lambda: said(scene(), scheme=Theta(1e-3, 0.4), steps=1), "expected theta from 1/2"),
    "A pair of surfaces is forgotten": (forgotten_pair, "Add a SurfacePair, or take Everything(model, ...)"),
    "Bodies overlap to begin with": (lambda: said(scene(at=(0.0, 0.0, -0.02))), "move them apart, or allow it"),
    "Lengths in millimetres": (
        lambda: said(build_model([Body("block", block(size=(200.0, 100.0, 100.0)))], supports=[Support("block", ("z",), "z-")],
                                 gravity=lambda t: (0.0, 0.0, -9.81)), steps=1),
        "Give them in metres",
    ),
    "The mesh is inside out": (inside_out, "swap two nodes of every cell"),
    "The mesh has no volume cells": (lambda: surface_mesh(Path()), "expected volume cells"),
    "A 2D mesh among bodies in space": (flat, "expected all in 2D or all in 3D, got 'sheet' in 2D and 'floor' in 3D"),
    "Steps that are too long": (lambda: said(scene(), scheme=Theta(h=0.2), steps=1), "choose h below"),
    "A load that is faster than the steps": (lambda: shaken(0.02), "choose h below a tenth of its period"),
    "A pulse that is shorter than a step": (blow, "choose h below a tenth of its duration"),
    "A column of linear material that would buckle": (column, "saint_venant_kirchhoff(E, nu, density), of finite strain, does"),
    "h is 0 or negative": (lambda: Theta(h=-1e-3), "h: expected a number > 0"),
    "The number of steps is no whole number": (lambda: said(scene(), steps=10.5), "steps: expected a whole number"),  # type: ignore[arg-type]
    "A support moves more than is meant": (
        lambda: said(scene(supports=[Support("floor", ALL), Support("block", ("x", "y", "z"), "z+", velocity=0.01)]), steps=1),
        "a second Support with the others",
    ),
    "A name of a surface is misspelt": (lambda: contact_surface(scene(), [("block", "top")]), "expected a surface among 'x-', 'x+'"),
    "A support of a body that is not there": (lambda: scene(supports=[Support("flor", ALL)]), "expected one of 'block', 'floor'"),
    "A load on a surface that is not there": (
        lambda: scene(loads=[Traction("block", "inside", (0.0, 0.0, -1.0))]), "expected one of the surfaces"
    ),
    "Friction in per cent": (lambda: friction_of(40), "is it in per cent"),
    "Friction that names nobody": (lambda: Everything(scene(), mu={("block", "flor"): 0.5}), "expected names of bodies"),
    "E in GPa": (lambda: said(scene(block(replace(STONE, E=30.0))), steps=1), "1 GPa is 1e9 Pa"),
    "Density in g/cm3": (lambda: said(scene(block(Material(E=30e9, nu=0.2, density=2.4))), steps=1), "1 g/cm^3 is 1000 kg/m^3"),
    "Density 0": (lambda: said(scene(block(replace(STONE, density=0.0)))), "in dynamics a part needs a density > 0"),
    "Inertia of no body": (lambda: said(with_inertia((2.0, 2.0, 2.0)), steps=1), "Is it in kg m^2"),
    "Poisson's ratio 0.5": (lambda: Material(E=1e6, nu=0.5, density=1000.0), "-1 < nu < 0.5"),
    "Statics without supports": (lambda: said(scene(), scheme=QuasiStatic(0.1)), "Add supports, or choose eta > 0"),
    "A floor that may turn": (lambda: said(tipping(), scheme=QuasiStatic(1.0, eta=10.0), steps=1), "'rx', 'ry', 'rz')) holds it whole"),
    "A body begins far above the floor": (lambda: said(high(), steps=1), "begin nearer, with a velocity"),
    "A body beside the floor": (lambda: said(scene(at=(5.0, 0.0, 0.0)), steps=1), "the floor large enough?"),
    "The floor is forgotten": (lambda: said(build_model([Body("block", block())], gravity=lambda t: (0, 0, -9.81), beta=1e-3), steps=1),
                               "Is the floor forgotten"),
    "Nodes are doubled": (lambda: said(scene(soup()), steps=1), "merge the nodes"),
    "Friction twice": (
        lambda: Everything(scene(), {("block", "floor"): 0.4, ("floor", "block"): 0.6}),
        "one number for 'block' and 'floor'",
    ),
    "Friction of one body or of the other": (
        lambda: said(scene(), Everything(scene(), {("block", "*"): 0.4, ("*", "floor"): 0.6}), steps=1),
        "add an entry for ('block', 'floor')",
    ),
    "Cells that are too stiff": (coarse, 'smaller cells, or "Q1-enhanced" or "Q2"'),
    "A shaft in its hub, both of flat facets": (chords, 'normals="smooth" or candidates="mortar"'),
    "A rotation by an angle": (lambda: Body("block", block(), rotation=90), "Rotation.from_euler"),
    "An angle in degrees": (lambda: said(turning(), scheme=Theta(h=1e-2), steps=1), "Angles are in radians"),
    "A spring without a body": (spring, "expected one of 'block', 'floor'"),
    "A part in place of a body": (lambda: build_model([block()]), "Body(name, part)"),  # type: ignore[list-item]
    "A detector is forgotten": (lambda: Simulation(scene(), None, Theta(h=1e-3), 10), "Everything(model, mu=0.5)"),  # type: ignore[arg-type]
    "A solver is misspelt": (lambda: SolverSettings(name="NSN-CA").name, "did you mean NSN-AC"),
}  # fmt: skip


@pytest.mark.parametrize("title", MISTAKES)
def test_a_mistake_is_answered(title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    make, mend = MISTAKES[title]
    try:
        answer = make()
    except FcsimError as error:
        answer = str(error)
    assert isinstance(answer, str) and mend in answer
    assert len(answer.splitlines()) == 1
    quoted = " ".join(re.findall(r"^> (.*)", PAGE.partition(f"\n### {title}\n")[2].partition("\n### ")[0], re.MULTILINE))
    assert answer.startswith(quoted.removesuffix(" ..."))
    assert f"\n### {title}\n" in PAGE


def test_what_is_right_is_not_remarked_on() -> None:
    assert "free to turn" not in said(tipping(), steps=1)  # in dynamics it may be a pivot
    assert "free to turn" not in said(scene(), scheme=QuasiStatic(1.0, eta=10.0), steps=1)
    assert said(scene()) == ""
    assert shaken(0.002) == ""
    units = 1e3  # mm, t, s: MPa
    bodies = [
        rigid_box("floor", size=(1000.0, 400.0, 100.0), centre=(100.0, 50.0, -50.0), mass=1e-3),
        Body("block", block(Material(2e2, 0.2, 2e-9), (200.0, 100.0, 100.0))),
    ]
    model = build_model(bodies, supports=[Support("floor", ALL)], gravity=lambda t: (0.0, 0.0, -9.81 * units), beta=1e-3)
    assert said(model, steps=2) == ""


GOOD = TEMPLATE.read_text(encoding="utf-8")
CASES: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "A case without build": (GOOD.replace("def build(", "def built("), "found no function build", ()),
    "Parameters that is no dataclass": (GOOD.replace("@dataclass(frozen=True)\n", ""), "write @dataclass(frozen=True) above the class", ()),
    "build returns nothing": (GOOD.replace("    return Case(", "    Case("), "is the `return` missing?", ()),
    "An error in the script": (GOOD.replace("p.mu", "q.mu"), "NameError: name 'q' is not defined", ()),
    "A parameter is misspelt": (GOOD, "did you mean mu?", ("--set", "mue=0.3")),
    "A decimal comma": (GOOD, "expects a number", ("--set", "mu=0,3")),
}


@pytest.mark.parametrize("title", CASES)
def test_a_mistake_in_a_case_is_answered(title: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script, mend, arguments = CASES[title]
    (tmp_path / "mine.py").write_text(script, encoding="utf-8")
    assert main(["run", str(tmp_path / "mine.py"), "--out", str(tmp_path / "out"), *arguments]) == 2
    error = capsys.readouterr().err
    assert mend in error and error.count("\n") == 1 and not (tmp_path / "out").exists()
    assert f"\n### {title}\n" in PAGE


def test_mistakes_with_a_runs_folder(case_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that has results, and a run that is resumed after its end, which says so in run.json as well."""
    run = ["run", str(case_folder), "--out", str(tmp_path / "out"), "--export-every", "0", "--vtk-every", "0", "--steps", "2"]
    assert main(run) == 0 and main(run) == 2
    assert "go on with --resume, replace it with --overwrite" in capsys.readouterr().err
    assert main([*run, "--resume"]) == 0
    assert "the run had its 2 steps already" in capsys.readouterr().out
    assert "--resume --steps 4" in json.loads((tmp_path / "out" / "run.json").read_text())["message"]
    (tmp_path / "out" / "run.json").write_text("{")
    assert main([*run, "--overwrite"]) == 2
    assert "delete the folder yourself, or choose another --out" in capsys.readouterr().err
    assert "### The folder has results\n" in PAGE and "### The run.json is damaged\n" in PAGE and "### A finished run is resumed\n" in PAGE


def test_remarks_reach_run_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Friction in per cent and forgotten damping, by the command line: said, and kept among the notes."""
    undamped = GOOD.replace("        beta=1e-3,\n", "").replace("theta: float = 0.6", "theta: float = 0.5")
    (tmp_path / "mine.py").write_text(undamped, encoding="utf-8")
    assert (
        main(["run", str(tmp_path / "mine.py"), "--out", str(tmp_path / "out"), "--vtk-every", "0", "--steps", "1", "--set", "mu=40"]) == 0
    )
    notes = json.loads((tmp_path / "out" / "run.json").read_text())["notes"]
    assert [bool(re.search("is it in per cent", note)) for note in notes].count(True) == 1
    assert [bool(re.search(r"build_model\(beta=", note)) for note in notes].count(True) == 1
    assert "is it in per cent" in capsys.readouterr().out
    assert "### Damping is forgotten\n" in PAGE


def test_the_page_tells_of_each_what_it_means_and_mends() -> None:
    entries = re.split(r"^### ", PAGE, flags=re.MULTILINE)[1:]
    assert len(entries) >= 20
    for entry in entries:
        assert re.search(r"^> ", entry, re.MULTILINE) and "**Mend**" in entry, entry.splitlines()[0]
    known = {*MISTAKES, *CASES, "The folder has results", "The run.json is damaged", "A finished run is resumed", "Damping is forgotten"}
    assert {entry.splitlines()[0] for entry in entries} == known
    with pytest.raises(InputError):
        Theta(h=0.0)
