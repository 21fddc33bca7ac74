"""Collections from several cases by a recipe, with all linearised problems of nonlinear steps on request."""

import json
from pathlib import Path

import pytest

from fcsim.collection import build_collection, check_collection, compose_collection, read_manifest, read_recipe
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.running.case import load_case
from fcsim.running.run import RunOptions, run_case

CASE = """
from dataclasses import dataclass

from fcsim import Body, Case, Limits, QuasiStatic, Sensor, Simulation, SolverSettings, Support, build_model
from fcsim import Detector, SurfacePair, contact_surface
from fcsim.mesh import rectangle, rigid_rectangle
from fcsim.mesh.material import neo_hooke


@dataclass(frozen=True)
class Parameters:
    mu: float = 0.2
    down: float = 0.05
    steps: int = 3
    solver: str = "auto"
    tol: float = 1e-10


def build(p):
    part = rectangle("pad", (1.0, 1.0), (4, 4), neo_hooke(1e6, 0.3, 1000.0))
    model = build_model(
        [Body("pad", part), rigid_rectangle("floor", (4.0, 1.0), (0.5, -0.5), 1.0)],
        supports=[
            Support("floor", ("x", "y", "rz")), Support("pad", ("y",), "y+", velocity=-p.down), Support("pad", ("x",), "y+", velocity=0.02)
        ],
    )
    pair = SurfacePair(contact_surface(model, [("pad", "y-")]), contact_surface(model, [("floor", "y+")]), mu=p.mu, alert=0.1)
    simulation = Simulation(
        model, Detector([pair], model.n_nodes), QuasiStatic(1.0), p.steps, SolverSettings(name=p.solver, tol=p.tol),
        limits=Limits(rotation=10.0, strain=10.0),
    )
    return Case(
        name="NAME", title="A pad", simulation=simulation, fclib_set="FCSIM_NAME",
        sensors=(Sensor("force", "force on the floor", "N", lambda s: float(s.contact_force_on(0)[1])),), plots={},
    )
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cases, the same but for their names, and a recipe beside them."""
    place = tmp_path_factory.mktemp("recipes")
    for name in ("soft", "firm"):
        (place / name).mkdir()
        (place / name / f"{name}.py").write_text(CASE.replace("NAME", name), encoding="utf-8")
    sources = [
        {"case": "soft", "parameters": {"mu": "0.4"}},
        {"case": "firm", "parameters": {"down": "0.02"}},
        {"case": "firm", "every": 2},
    ]
    recipe = {"format": "collection-recipe/1", "title": "Pads", "text": "Pads pressed and drawn.", "count": 5, "sources": sources}
    (place / "pads.json").write_text(json.dumps(recipe), encoding="utf-8")
    return place


@pytest.mark.filterwarnings("ignore")
def test_a_recipe_makes_a_collection_that_verifies(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The second case twice, with other parameters: 3 + 3 + 1 candidates, five of them in the collection, under names of their own."""
    out = tmp_path / "pads"
    assert main(["collection", "compose", str(folder / "pads.json"), "--out", str(out)]) == 0
    assert "5 of 7 problems" in capsys.readouterr().out
    entries = [entry for entry in read_manifest(out) if entry.form == "global"]
    assert len(entries) == 5
    assert {"FCSIM_soft", "FCSIM_firm"} <= {entry.name.split("-")[0] for entry in entries}
    assert {json.loads(entry.parameters)["mu"] for entry in entries} == {0.2, 0.4}
    assert not any(row.failures for row in check_collection(out))
    readme = (out / "README.md").read_text(encoding="utf-8")
    assert "# Pads" in readme and "fcsim collection compose pads.json --out DIR" in readme and "firm, every step, down = 0.02" in readme
    assert not [path.name for path in tmp_path.iterdir() if path != out]  # the runs are gone


def test_all_linearised_problems_on_request(folder: Path, tmp_path: Path) -> None:
    """Their last one is that of the collection without; M changes from one to the next, as a tangent does."""
    last = build_collection(folder / "soft", tmp_path / "last", pictures=False)
    every = build_collection(folder / "soft", tmp_path / "every", iterations=True, pictures=False)
    names = [entry.name for entry in every.entries if entry.form == "global"]
    assert {entry.name for entry in last.entries} <= set(names)
    first = sorted(name for name in names if name.endswith("-00001.hdf5"))
    assert [name.split("-")[1] for name in first[1:]] == [f"newton{k:02d}" for k in range(len(first) - 1)] and len(first) > 2
    named = [(int(entry.name.split("-i")[1][:5]), entry.iterations) for entry in every.entries]
    stated = [
        int(read_fclib(tmp_path / "every" / entry.place).info.math_info.split(" iterations")[0].split()[-1]) for entry in every.entries
    ]
    assert named == [(k, k) for k in stated]  # each its own, not the sum over the step
    M = [read_fclib(tmp_path / "every" / "global" / name).problem.M for name in first]
    assert all(abs(M[0] - M[k]).max() > 1e-6 * abs(M[0]).max() for k in (1, 2) if k + 1 < len(first))
    assert not any(row.failures for row in check_collection(tmp_path / "every"))
    assert "--iterations --out DIR" in (tmp_path / "every" / "README.md").read_text(encoding="utf-8")


def test_runs_that_exported_iterations_give_their_last_problems_unless_asked(folder: Path, tmp_path: Path) -> None:
    case = load_case(folder / "soft")
    run_case(case, {}, tmp_path / "all", RunOptions(export_every=1, export_iterations=True))
    run_case(case, {}, tmp_path / "last", RunOptions(export_every=1))
    plain = build_collection(tmp_path / "all", tmp_path / "a", pictures=False)
    assert sorted(entry.step for entry in plain.entries if entry.form == "global" and entry.step is not None) == [1, 2, 3]
    assert not any("newton" in entry.name for entry in plain.entries)
    assert len(build_collection(tmp_path / "all", tmp_path / "b", iterations=True, pictures=False).entries) > len(plain.entries)
    with pytest.raises(InputError, match="expected all linearised problems"):
        build_collection(tmp_path / "last", tmp_path / "c", iterations=True)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{}", "expected a recipe of the format 'collection-recipe/1', got None"),
        ("[]", "got None"),
        ("{", "expected JSON"),
        ('{"format": "collection-recipe/1", "title": "a", "text": "b"}', "sources"),
        ('{"format": "collection-recipe/1", "title": "a", "text": "b", "sources": []}', "at least one case"),
        ('{"format": "collection-recipe/1", "title": "a", "text": "b", "sources": [{"case": "nowhere"}]}', "nowhere"),
        ('{"format": "collection-recipe/1", "title": "a", "text": "b", "sources": [{"case": "soft"}], "count": "x"}', "whole number"),
    ],
)
def test_recipes_that_cannot_be_are_refused(folder: Path, tmp_path: Path, content: str, message: str) -> None:
    path = folder / "wrong.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        compose_collection(path, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_the_recipe_that_is_there_names_cases_that_are_there() -> None:
    cases = Path(__file__).parents[3] / "cases"
    recipe = read_recipe(cases / "nonlinear.json")
    assert recipe.count == 50
    assert all((cases / source.case / f"{source.case}.py").is_file() for source in recipe.sources)
