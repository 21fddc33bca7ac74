"""Writes the pages that come from the code into docs/_generated before the build looks for pages; those that are unchanged stay."""

from pathlib import Path

import api_pages
import command_pages
import reached
import solver_pages

FOLDER = Path(__file__).resolve().parents[1] / "_generated"


def generated():
    """{path below docs/_generated: text}"""
    pages = {f"api/{name}": text for name, text in api_pages.pages().items()}
    return pages | {"solvers.md": solver_pages.page(), "command_line.md": command_pages.page(), "more.md": reached.page()}


def _write(app, config):
    pages = generated()
    for name, text in pages.items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for path in FOLDER.rglob("*.*"):
        if path.relative_to(FOLDER).as_posix() not in pages:
            path.unlink()


def setup(app):
    app.connect("config-inited", _write, priority=10)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
