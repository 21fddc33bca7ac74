"""docs/_build/html/index.html leads to the first page, which lies in docs/ as its source does."""

from pathlib import Path

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>fcsim</title><meta http-equiv="refresh" content="0; url=docs/index.html"></head>
<body><p><a href="docs/index.html">fcsim</a></p></body></html>
"""


def _write(app, exception):
    if exception is None and app.builder.format == "html":
        Path(app.outdir, "index.html").write_text(PAGE, encoding="utf-8")


def setup(app):
    app.connect("build-finished", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
