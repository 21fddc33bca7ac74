"""Every code block of README and of the site's pages: Python runs, shell commands are those that the program knows."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from sybil import Document
from sybil.parsers.markdown import PythonCodeBlockParser

from fcsim import SOLVERS, LocalProblem, write_fclib
from fcsim.command_line.main import _parser

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("[a-z]*/*.md")])
EVERYWHERE = sorted([*PAGES, *(ROOT / "cases").glob("*/README.md")])
CHEAP = ("auto", "formulation", "schemes", "choose_a_solver", "collections_and_benches", "add_a_contact_law")
"""Pages of solvers alone, or of a few steps of a rigid box: a second together."""
IN_A_PROCESS_OF_THEIR_OWN = ("add_a_case", "add_a_contact_rule", "add_a_material", "add_a_solver", "from_dolfinx", "masonry")
"""`tests/unit/test_docs.py` runs these."""


def python_of(page):
    return list(Document.parse(str(page), PythonCodeBlockParser()).examples())


WITH_PYTHON = [page for page in PAGES if "```python" in page.read_text(encoding="utf-8")]


def runs(page):
    return pytest.param(page, id=page.stem, marks=[] if page.stem in CHEAP else pytest.mark.slow)


@pytest.mark.parametrize("page", [runs(page) for page in WITH_PYTHON if page.stem not in IN_A_PROCESS_OF_THEIR_OWN])
def test_the_python_of_a_page_runs(page, tmp_path, monkeypatch):
    """Block after block in one namespace, in an empty folder that holds what README calls problem.hdf5; assertions hold."""
    if page.stem == "compas":
        pytest.importorskip("compas_dem", reason="compas_dem is not installed: pip install 'fcsim[compas]'")
    monkeypatch.chdir(tmp_path)
    write_fclib("problem.hdf5", LocalProblem(W=np.diag([2.0, 1.0, 1.0]), q=np.array([-1.0, 0.3, 0.0]), mu=np.array([0.5])))
    known = dict(SOLVERS)
    try:
        examples = python_of(page)
        assert len(examples) == page.read_text(encoding="utf-8").count("```python")
        for example in examples:
            example.evaluate()
    finally:
        SOLVERS.clear()
        SOLVERS.update(known)


def test_every_page_with_python_is_run():
    named = {*CHEAP, *IN_A_PROCESS_OF_THEIR_OWN}
    assert named <= {page.stem for page in WITH_PYTHON}
    assert len(WITH_PYTHON) >= 15


def commands(page):
    """The commands of a page's blocks, fenced as console or set in by four spaces, with continued lines joined."""
    text = re.sub(r" *\\\n\s+", " ", page.read_text(encoding="utf-8"))
    fenced = [
        line
        for block in re.findall(r"^```(?:console|sh|bash|shell)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        for line in block.splitlines()
    ]
    unnamed = re.findall(r"^```\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    fenced += [line for block in unnamed for line in block.splitlines() if line.startswith("fcsim ")]
    indented = re.findall(r"^    ((?:fcsim|make) .*)$", text, re.MULTILINE)
    return [part.strip() for line in [*fenced, *indented] for part in line.removeprefix("$ ").split("  #")[0].split("&&")]


@pytest.mark.parametrize("page", [page for page in EVERYWHERE if commands(page)], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_commands_of_a_page_are_known(page):
    """Each `fcsim ...` is taken by the real parser (a line with [OPTIONS] or ... is a form), each `make TARGET` is there."""
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for command in commands(page):
        words = shlex.split(command, comments=True)
        if "[" in command or "..." in words or not words or words[0] in (".", "pip", "python", "cd", "apt-get"):
            continue
        assert words[0] in ("fcsim", "make"), command
        if words[0] == "make":
            assert words[1] in targets, command
        elif "--version" not in words:
            try:
                _parser().parse_args(words[1:])
            except SystemExit as left:
                pytest.fail(f"{command}: the parser left with {left.code}")


def test_cases_that_commands_run_are_there():
    named = {name for page in EVERYWHERE for command in commands(page) for name in re.findall(r"\bcases/(\w+)", command)}
    assert len(named) > 15
    assert not [name for name in named if not (ROOT / "cases" / name).exists() and not (ROOT / "cases" / f"{name}.json").exists()]
