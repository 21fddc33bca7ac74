"""The site loads nothing from a network: a page that would is a warning, which `make docs` takes as an error."""

import re
from pathlib import Path

ELSEWHERE = re.compile(
    r'<(?:script|img|iframe|source|video|embed|object)\b[^>]*?(?:src|data)=["\'](?:https?:)?//[^"\']+'
    r'|<link\b(?=[^>]*rel=["\'](?:stylesheet|preload|preconnect|icon|modulepreload))[^>]*href=["\'](?:https?:)?//[^"\']+'
)
IN_STYLES = re.compile(r'(?:@import\s+|url\()\s*["\']?(?:https?:)?//[^)"\'\s]+')


def asked_elsewhere(folder):
    """[(file, what it would load)] of the pages and styles below a folder."""
    found = []
    for path in sorted(Path(folder).rglob("*")):
        pattern = {".html": ELSEWHERE, ".css": IN_STYLES}.get(path.suffix)
        if pattern is not None:
            found += [(path, match[:160]) for match in pattern.findall(path.read_text(encoding="utf-8", errors="replace"))]
    return found


def _check(app, exception):
    from sphinx.util import logging

    if exception is None and app.builder.format == "html":
        for path, what in asked_elsewhere(app.outdir):
            logging.getLogger(__name__).warning("%s loads from a network: %s", path.relative_to(app.outdir), what)


def setup(app):
    app.connect("build-finished", _check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
