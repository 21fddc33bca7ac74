"""What the answering part of a bench's page is given: counted by hand from a small table."""

import base64
from pathlib import Path

import pytest

from fcsim.bench.reporting.comparison import compare
from fcsim.bench.reporting.explorer import explorer_section
from fcsim.bench.reporting.explorer.content import MOST_POINTS, content
from fcsim.bench.results import Measurement
from fcsim.errors import InputError


def row(problem, solver, seconds, status="SOLVED", tol=1e-4):
    solved = status == "SOLVED"
    return Measurement(
        problem, "local", 3, 10, 30, "fcsim", solver, tol,
        5.0, None, status, solved, seconds, seconds, 7, tol / 2 if solved else float("inf"),
        None, "Processor X", 1, "0.1.0", "2024-01-01T00:00:00+00:00",
    )  # fmt: skip


TABLE = [
    row("a", "ONE", 0.1), row("a", "TWO", 0.2),
    row("b", "ONE", None, "KILLED_TIME: above 5 s"), row("b", "TWO", 0.3),
    row("c", "ONE", 0.4),
]  # fmt: skip


@pytest.fixture
def bench(tmp_path):
    (tmp_path / "results").mkdir()
    return tmp_path / "results"


def test_each_problem_says_who_solved_it_and_who_was_not_measured(bench):
    said = content(compare(TABLE), (), bench, None)
    (part,) = said["tolerances"]
    rows = {of["problem"]: of for of in part["problems"]}
    assert list(rows) == ["a", "b", "c"] and part["count"] == 2  # c is left out: TWO was not measured on it
    assert rows["c"]["missing"] == ["TWO"] and rows["a"]["missing"] == []
    assert rows["b"]["cells"]["ONE"]["status"] == "KILLED_TIME: above 5 s" and not rows["b"]["cells"]["ONE"]["solved"]
    assert rows["b"]["cells"]["ONE"]["seconds"] is None and rows["b"]["cells"]["ONE"]["error"] is None  # JSON knows no infinity
    # ONE is the fastest on one of two and solves no other; TWO takes twice as long on it
    assert part["profiles"]["ONE"] == {"tau": [1.0, 2.0], "rho": [0.5, 0.5]}
    assert part["profiles"]["TWO"] == {"tau": [1.0, 2.0], "rho": [0.5, 1.0]}


def test_convergence_is_read_thinned_and_only_of_its_problems(bench):
    lines = "\n".join(f"ONE,{k},{k / 100},{2.0**-k}" for k in range(1000))
    (bench / "convergence-a.csv").write_text(f"solver,iteration,seconds,error\n{lines}\nTWO,0,0,nan\n")
    (bench / "convergence-other.csv").write_text("no table")
    (curve, empty) = content(compare(TABLE), (), bench, None)["curves"]["a"]
    assert curve["solver"] == "ONE" and curve["iteration"][0] == 0 and curve["iteration"][-1] == 999
    assert len(curve["error"]) <= MOST_POINTS + 1 and empty["error"] == []
    (bench / "convergence-b.csv").write_text("solver,iteration,seconds,error\nONE,one,2,3\n")
    with pytest.raises(InputError, match=r"convergence-b\.csv: expected the columns solver, iteration, seconds, error"):
        content(compare(TABLE), (), bench, None)


def test_pictures_are_those_of_the_problem_else_of_its_run(bench, tmp_path):
    folder = tmp_path / "set"
    folder.mkdir()
    for name in ("a.png", "b.png", "picture.png"):
        (folder / name).write_bytes(name.encode())
    (folder / "c.hdf5").touch()
    secret = tmp_path / "secret.png"
    secret.write_bytes(b"secret")
    (folder / "b-9.png").symlink_to(secret)
    table = [row("a", "ONE", 0.1), row("b-9", "ONE", 0.1), row("c", "ONE", 0.1), row("d", "ONE", 0.1)]
    found = content(compare(table), (folder,), bench, None)["pictures"]
    pictures = {name: base64.b64decode(uri.partition("base64,")[2]).decode() for name, uri in found.items()}
    assert pictures == {"a": "a.png", "b-9": "b.png", "c": "picture.png"}  # d is of no such collection; links out of it are not followed


def test_another_bench_must_have_something_in_common(bench, tmp_path):
    from fcsim.bench.results import append

    there = tmp_path / "there"
    there.mkdir()
    append(there, row("z", "ONE", 0.1))
    with pytest.raises(InputError, match="found none in common"):
        explorer_section(compare(TABLE), bench, (), there)
    append(there, row("b", "ONE", 0.5))
    (html,) = explorer_section(compare(TABLE), bench, (), there)
    assert '"other": "there"' in html and Path(there).name in html


def test_names_cannot_end_the_script(bench):
    """A solver of a plugin may have any name."""
    (html,) = explorer_section(compare([row("</script><b>", "</script>", 0.1)]), bench)
    assert html.count("</script>") == 3 and "<option>&lt;/script&gt;</option>" in html
