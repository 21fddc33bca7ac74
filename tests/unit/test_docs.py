"""The documents: their examples run, the files and pages that they name are there."""

import importlib
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
GUIDES = sorted((ROOT / "docs" / "guides").glob("*.md"))


OWN = ("add_a_case", "add_a_contact_rule", "add_a_material", "add_a_solver", "from_dolfinx")
"""Guides whose examples are one script, run here; those of the other pages are tried by test_code_blocks.py."""
EXAMPLES = [*(page for page in GUIDES if page.stem in OWN), ROOT / "docs" / "masonry.md"]


def blocks(page: Path) -> list[str]:
    """The Python examples of a page."""
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def test_there_are_guides() -> None:
    assert set(OWN) <= {page.stem for page in GUIDES} and len(EXAMPLES) == 6


@pytest.mark.parametrize("page", EXAMPLES, ids=lambda page: page.stem)
def test_the_examples_of_a_guide_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the script that a reader would make of them; their assertions hold. What adds to the table of solvers has a process of its own."""
    examples = blocks(page)
    assert examples and any("assert" in example for example in examples)
    script = tmp_path / "example.py"
    script.write_text("\n".join(examples), encoding="utf-8")
    if page.stem == "add_a_solver":
        done = subprocess.run(
            [sys.executable, script], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stderr
        return
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script), run_name="__main__")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    built = ("_gallery/", "_generated/")  # by make docs, which takes a link that leads nowhere as an error
    assert not [link for link in links if not any(part in link for part in built) and not (page.parent / link).exists()]


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and the site make them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#{1,4} (.*)$", text, re.MULTILINE)
    words = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower() for heading in headings)
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in words}


@pytest.mark.parametrize("page", [ROOT / "CHANGELOG.md", *PAGES], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_headings_that_links_name_are_there(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    links = re.findall(r"\]\((?!https?:)([^)#\s]*)#([^)\s]+)\)", text)
    pages = [(page.parent / target if target else page, anchor) for target, anchor in links]
    assert not [f"{target.name}#{anchor}" for target, anchor in pages if target.suffix == ".md" and anchor not in anchors(target)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_that_are_named_are_there(page: Path) -> None:
    """Paths in backticks, from the root, from fcsim/ or beside the page; those with capitals are placeholders."""
    named = re.findall(r"`((?:[a-z_0-9]+/)+[a-z_0-9]*(?:\.(?:py|md|toml))?)`", page.read_text(encoding="utf-8"))
    own = [name for name in named if name.split("/")[0] not in ("results", "dist", "vtk", "fclib", "global", "local", "plots", "pictures")]
    assert not [name for name in own if not any((base / name).exists() for base in (ROOT, ROOT / "fcsim", page.parent))]


def test_names_that_are_written_are_there() -> None:
    """`fcsim.x.y` of pages, docstrings and comments: rooms, files, and what is in them."""
    own = (path for path in (ROOT / "fcsim").rglob("*.py") if path.name != "moved.py")  # which names what was elsewhere before
    sources = [*PAGES, *own, *(ROOT / "cases").rglob("*.py")]
    names = {name for path in sources for name in re.findall(r"(?<![\w./@-])fcsim(?:\.[A-Za-z_]\w*)+", path.read_text(encoding="utf-8"))}
    assert len(names) > 300
    assert not sorted(name for name in names if not name.endswith((".py", ".md")) and not _is_there(name))


def _is_there(name: str) -> bool:
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        if _module(parts[:k]):
            found: object = importlib.import_module(".".join(parts[:k]))
            for part in parts[k:]:
                if not hasattr(found, part):
                    return part in getattr(found, "__dataclass_fields__", {})  # one without a default
                found = getattr(found, part)
            return True
    return False


def _module(parts: list[str]) -> bool:
    place = ROOT.joinpath(*parts)
    return place.is_dir() or place.with_suffix(".py").is_file()
