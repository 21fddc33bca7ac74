"""The site's own parts: every public name, every solver and every case has its place, and what is generated comes from the code."""

import ast
import inspect
import json
import re
import sys
from importlib import import_module
from pathlib import Path

import pytest

from fcsim import SOLVERS
from fcsim.running.known_cases import known_cases

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "extensions"))

import api_pages  # noqa: E402
import offline  # noqa: E402
import plain_docstrings  # noqa: E402
import reached  # noqa: E402
import solver_formulas  # noqa: E402
import solver_pages  # noqa: E402

LESSONS = sorted((DOCS / "gallery").glob("*/*.py"))
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def pages():
    return api_pages.pages()


def test_no_public_name_of_a_face_is_missing(pages):
    known = api_pages.faces()
    assert known[0] == "fcsim" and {"fcsim.mesh", "fcsim.view", "fcsim.solvers", "fcsim.masonry"} <= set(known)
    described = re.findall(r"^\.\. auto\w+:: (\S+)", "\n".join(pages.values()), re.MULTILINE)
    assert len(described) == len(set(described))  # each once
    places = api_pages.described_in(known)
    for face in known:
        for name in import_module(face).__all__:
            home, there = places[face, name]
            module = rf"^\.\. py:module:: \S*{there}$"
            assert f"{home}.{there}" in described or re.search(module, pages[f"{home}.rst"], re.MULTILINE), (face, name)
            assert name in pages[f"{face}.rst"]
            assert getattr(import_module(home), there) is getattr(import_module(face), name)


def test_every_public_class_and_function_says_what_it_is():
    bare = [
        f"{face}.{name}"
        for face in api_pages.faces()
        for name in import_module(face).__all__
        if (inspect.isclass(value := getattr(import_module(face), name)) or inspect.isroutine(value)) and not (value.__doc__ or "").strip()
    ]
    assert not bare


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_has_its_formula_or_words(name):
    method = SOLVERS[name]
    formulas = solver_formulas.formulas(method)
    assert formulas or solver_formulas.in_words(method)
    for formula in formulas:
        assert formula.count("{") == formula.count("}")
    section = solver_pages.page().split(f"### {name}\n")[1].split("\n### ")[0]
    assert method.source in section and "options: `max_iterations=" in section


def test_where_a_solver_wins_is_counted_from_the_table():
    table = """## Error at most 0.01
| problem | form | contacts | A | auto |
| :--- | :--- | ---: | ---: | ---: |
| one | local 3D | 3 | 1.05 ms (2) | 10 µs (1) |
| two | local 3D | 4 | *T 2e-03* | 1 s (1) |

| problem | form | contacts | B |
| :--- | :--- | ---: | ---: |
| one | local 3D | 3 | 1 ms (9) |
| two | local 3D | 4 | 2 s (9) |
"""
    _, times = solver_pages.measured(table)
    assert times[0.01]["one", "local 3D", 3] == {"A": pytest.approx(1.05e-3), "auto": pytest.approx(1e-5), "B": pytest.approx(1e-3)}
    assert solver_pages.where_it_wins("A", times) == "at 0.01 1 of 2: one (local 3D, 3)"  # within 1.1 of B
    assert solver_pages.where_it_wins("B", times).startswith("at 0.01 2 of 2")


def test_the_measured_table_is_read_whole():
    counts, times = solver_pages.measured(solver_pages.TABLE.read_text(encoding="utf-8"))
    assert counts["auto"] == {1e-4: (36, 36), 1e-8: (36, 36)}
    for tolerance, problems in times.items():
        assert len(problems) == 36
        for name, of in counts.items():
            assert sum(name in solved for solved in problems.values()) == of[tolerance][0], (name, tolerance)


def test_docstrings_keep_what_they_say():
    lines = ["Solve `W r + q` for r_N * 2, see x_.", "", "    M v = H r + f", "", "r    (m,) reactions", "", "3. is no list |here|"]
    text = "\n".join(plain_docstrings.converted(lines))
    assert "``W r + q``" in text and r"r\_N \* 2" in text and r"x\_" in text
    assert text.count(".. code-block:: none") == 2 and "       M v = H r + f" in text and "   r    (m,) reactions" in text
    assert r"\3. is no list \|here\|" in text


def test_every_case_has_a_lesson_with_a_picture():
    cases = {folder.name for folder in (ROOT / "cases").iterdir() if (folder / f"{folder.name}.py").is_file()}
    assert cases <= {lesson.stem for lesson in LESSONS}
    for lesson in LESSONS:
        text = lesson.read_text(encoding="utf-8")
        assert 15 <= len(text.splitlines()) <= 60 and "picture(" in text, lesson.stem
        assert ast.get_docstring(ast.parse(text)).splitlines()[1].startswith("==="), lesson.stem
        for page in re.findall(r":doc:`[^<`]*<([^>]+)>`", text):
            assert (ROOT / f"{page}.md".lstrip("/")).is_file(), (lesson.stem, page)


def test_notebooks_are_kept_without_results():
    assert [path.stem for path in NOTEBOOKS] == ["first_contact", "nonlinear_rubber", "own_solver"]
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")]
        assert any("interactive(" in "".join(cell["source"]) for cell in cells)


def test_every_page_is_reached_from_the_first():
    """By the tables of contents, or on the page that gathers what they do not name; what they name is there."""
    found = reached.reached()
    assert {"first_steps", "formulation", "energy", "choose_a_solver", "own_solver"} <= {page.stem for page in found}
    gathered = {ROOT / f"{name}.md" for name in re.findall(r"^/(\S+)$", reached.page(), re.MULTILINE)}
    assert found | gathered == reached.all_pages() and len(gathered) < 10
    assert "_generated/more" in (DOCS / "index.md").read_text(encoding="utf-8")


def test_what_a_page_would_load_from_a_network_is_seen(tmp_path):
    (tmp_path / "a.html").write_text('<a href="https://x.org">a link</a><img src="own.png"><script src="_static/own.js"></script>')
    (tmp_path / "b.html").write_text('<script src="https://cdn.org/x.js"></script><link rel="stylesheet" href="//fonts.org/f.css">')
    (tmp_path / "c.css").write_text('@import "https://fonts.org/f.css"; p { background: url(own.png) }')
    assert [path.name for path, _ in offline.asked_elsewhere(tmp_path)] == ["b.html", "b.html", "c.css"]


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda path: path.stem)
def test_lessons_load_their_cases_by_name(lesson):
    """They run where a reader puts them."""
    loaded = re.findall(r'load_case\("([^"]*)"\)', lesson.read_text(encoding="utf-8"))
    assert set(loaded) <= {case.name for case in known_cases()}
