"""Pieces of a self-contained HTML page: pictures as data URIs, tables, Markdown; nothing is loaded from outside."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING
from urllib.parse import unquote

from fcsim.errors import MissingDependency
from fcsim.files import resolved

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = {".png": "image/png", ".svg": "image/svg+xml", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".gif": "image/gif"}

PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:;
 worker-src blob:">
<title>$title</title>
<style>
:root { --ink: #1a1a1a; --grey: #595959; --rule: #d4d4d4; --shade: #f4f5f6; --accent: #005b94;
  --paper: #fff; --good: #00664a; --bad: #a33a00; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e9eaec; --grey: #b4b8bd; --rule: #3b4248; --shade: #20252a; --accent: #7cc4f5;
    --paper: #15181b; --good: #6fd3ae; --bad: #ffa071; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 64rem; padding: 2rem 1.5rem 4rem; color: var(--ink); background: var(--paper);
  font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .4rem; }
h2 { font-size: 1.35rem; margin: 2.6rem 0 .7rem; padding-top: .5rem; border-top: 2px solid var(--ink); }
h3 { font-size: 1.08rem; margin: 1.8rem 0 .5rem; }
p, li { max-width: 46rem; }
.lead { color: var(--grey); font-size: 1.08rem; margin: 0 0 1.2rem; }
.note { background: var(--shade); border-left: 4px solid var(--accent); padding: .6rem .9rem; max-width: 46rem; }
nav ul { columns: 2; padding-left: 1.2rem; max-width: 46rem; }
a { color: var(--accent); }
figure { margin: 1rem 0; }
figure img, .text img { background: #fff; display: block; max-width: 100%; height: auto; }
figcaption, .small { color: var(--grey); font-size: .88rem; max-width: 46rem; }
.wide { overflow-x: auto; margin: .8rem 0; max-width: 100%; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--grey); padding-bottom: .3rem; }
th, td { padding: .22rem .7rem; text-align: right; border-bottom: 1px solid var(--rule); vertical-align: top; }
th { border-bottom: 1.5px solid var(--ink); vertical-align: bottom; }
th:first-child, td:first-child, .facts th, .facts td, .text th, .text td { text-align: left; }
.facts th { border-bottom: 1px solid var(--rule); font-weight: 600; vertical-align: top; white-space: nowrap; }
td { white-space: nowrap; }
.facts td, .text td { white-space: normal; }
pre { background: var(--shade); padding: .7rem .9rem; overflow-x: auto; font-size: .86rem; white-space: pre-wrap; overflow-wrap: anywhere; }
code { font-family: ui-monospace, "DejaVu Sans Mono", Consolas, monospace; }
details summary { cursor: pointer; color: var(--accent); }
.text { border-left: 3px solid var(--rule); padding-left: 1rem; }
@media print {
  #explore { display: none; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  nav, .screen { display: none; }
  h2, h3 { break-after: avoid; }
  figure, tr, .note { break-inside: avoid; }
  table { font-size: 8pt; } th, td { padding: .15rem .35rem; } .wide { overflow: visible; }
  a { color: inherit; text-decoration: none; }
}
</style>
</head>
<body>
<main>
$body
</main>
</body>
</html>
""")


def page(title: str, body: Iterable[str]) -> str:
    """The whole page; `body` is HTML, `title` text."""
    return PAGE.substitute(title=escape(title), body="\n".join(body))


def data_uri(kind: str, content: bytes) -> str:
    """The content itself as an address."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def picture(content: bytes, kind: str, alt: str, caption: str = "") -> str:
    """A figure element with the picture in it; `alt` says what it shows to who cannot see it."""
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f'<figure><img src="{data_uri(kind, content)}" alt="{escape(alt)}">{below}</figure>'


def drawn(drawing: Figure, alt: str, caption: str = "") -> str:
    """A matplotlib figure as SVG with letters as outlines, which look the same without its fonts."""
    from fcsim.view.style import matplotlib

    file = io.BytesIO()
    with matplotlib().rc_context({"svg.fonttype": "path"}):
        drawing.savefig(file, format="svg", metadata={"Date": None})
    return picture(file.getvalue(), KINDS[".svg"], alt, caption)


def table(header: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> str:
    """A table of texts."""
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in header)
    lines = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    said = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f'<div class="wide" tabindex="0"><table>{said}<thead><tr>{head}</tr></thead><tbody>\n{lines}\n</tbody></table></div>'


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """A table of names and what they are."""
    rows = "\n".join(f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in pairs)
    return f'<div class="wide" tabindex="0"><table class="facts"><tbody>\n{rows}\n</tbody></table></div>'


def markdown_text(text: str, folder: Path) -> tuple[str, set[str]]:
    """HTML of Markdown whose pictures lie in `folder`; and the names of those pictures, which are embedded.

    Headings go two levels down, to fit below a section's. A picture from elsewhere stays as its description: nothing is loaded from
    outside. HTML in the text is shown as text.
    """
    try:
        from markdown_it import MarkdownIt
    except ImportError as error:
        raise MissingDependency(f"markdown_it cannot be imported ({error}), which comes with rich: pip install 'fcsim[view]'") from None
    shown = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    shown = re.sub(r"<(/?)h([1-4])>", lambda found: f"<{found[1]}h{int(found[2]) + 2}>", shown)
    embedded: set[str] = set()

    def replace(found: re.Match[str]) -> str:
        source, alt = found["source"], found["alt"]
        path = folder / unquote(source)
        inside = "://" not in source and resolved(path).is_relative_to(resolved(folder))
        if not inside or not path.is_file() or path.suffix.lower() not in KINDS:
            return f"[{alt or 'picture'}]"
        embedded.add(path.relative_to(folder).as_posix())
        return f'<img src="{data_uri(KINDS[path.suffix.lower()], path.read_bytes())}" alt="{alt or escape(path.stem)}">'

    shown = re.sub(r'<img src="(?P<source>[^"]*)" alt="(?P<alt>[^"]*)"[^>]*>', replace, shown)
    return f'<div class="text">{shown}</div>', embedded
