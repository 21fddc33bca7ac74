"""Docstrings of this package are plain text: prose, equations and aligned lists. Prose becomes paragraphs, the rest stays as it is set."""

import re

SPECIAL = re.compile(r"([\\*|_])")
CODE = re.compile(r"`([^`]+)`")


def _prose(line):
    """A line of prose as reStructuredText: what stands in backticks is code, all else stands for itself."""
    parts = CODE.split(line)
    return "".join(f"\\ ``{part.strip()}``\\ " if k % 2 else SPECIAL.sub(r"\\\1", part).replace("`", "\\`") for k, part in enumerate(parts))


def is_set(paragraph):
    """Whether the breaks and spaces of a paragraph mean something: equations, lists of names, tables."""
    return any(line.startswith((" ", "- ", "* ", "| ")) or re.search(r"\S {2,}\S", line) for line in paragraph)


def converted(lines):
    """Return the lines of a docstring as reStructuredText."""
    paragraphs, current = [], []
    for line in [*lines, ""]:
        if line.strip():
            current.append(line.rstrip())
        elif current:
            paragraphs.append(current)
            current = []
    result = []
    for paragraph in paragraphs:
        if is_set(paragraph):
            result += [".. code-block:: none", "", *(f"   {line}" for line in paragraph), ""]
        else:
            joined = " ".join(line.strip() for line in paragraph)
            text = _prose(joined)
            first = re.match(r"([0-9A-Za-z#]+[.)]|\(\w+\)|[-+•])(?=\s)", text)  # no enumeration, no bullet
            result += [("\\" if first else "") + text, ""]
    return result


def _process(app, what, name, obj, options, lines):
    if what == "module":
        lines.clear()  # the generated page says it
        return
    if (lines and lines[0].startswith("Alias for field number")) or lines[:1] == ["partial(func, *args, **keywords) - new function with"]:
        lines.clear()
    lines[:] = converted(lines)


def setup(app):
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
