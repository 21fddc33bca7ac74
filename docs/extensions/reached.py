"""Which pages the tables of contents lead to from the first one; those that none names yet are gathered on a page of their own."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def all_pages():
    """Pages that people write: of docs/, its notebooks, the cases, README."""
    notebooks = (DOCS / "notebooks").glob("*.ipynb")
    return {*DOCS.glob("*.md"), *DOCS.glob("[a-z]*/*.md"), *notebooks, *ROOT.glob("cases/*/README.md"), ROOT / "README.md"}


def reached():
    """Those among them that the tables of contents name, followed from docs/index.md."""
    seen, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        if page in seen or not page.is_file():
            continue
        seen.add(page)
        text = page.read_text(encoding="utf-8") if page.suffix == ".md" else ""
        for block in re.findall(r"```\{toctree\}\n(.*?)```", text, re.DOTALL):
            for line in block.splitlines():
                name = (re.search(r"<(.+)>", line) or [None, line.strip()])[1]
                if name and not name.startswith(":"):
                    waiting += [(page.parent / f"{name}{suffix}").resolve() for suffix in (".md", ".ipynb")]
                    waiting += list(ROOT.glob("cases/*/README.md")) if "*" in name else []
    return seen & all_pages()


def page():
    """The page that gathers the rest, as Markdown; docs/index.md names it."""
    rest = sorted(path.relative_to(ROOT).with_suffix("").as_posix() for path in all_pages() - reached())
    names = "\n".join(f"/{name}" for name in rest)
    return f"# More pages\n\n```{{toctree}}\n:maxdepth: 1\n\n{names}\n```\n"
