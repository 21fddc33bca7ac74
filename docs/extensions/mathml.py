"""Formulas as MathML, made while the site is built: browsers draw it themselves, without a script and without a network."""

import re
from html import escape

from docutils import nodes
from latex2mathml.converter import convert


def inline(self, node):
    self.body.append(f'<span class="math">{convert(node.astext())}</span>')
    raise nodes.SkipNode


def block(self, node):
    anchor = f' id="{escape(node["ids"][0])}"' if node.get("ids") else ""
    self.body.append(f'<div class="math"{anchor}>{convert(_one_environment(node.astext()), display="block")}</div>')
    raise nodes.SkipNode


def _one_environment(latex):
    """amsmath's align and gather as the environments that latex2mathml knows; lines with \\\\ alone are aligned on nothing."""
    latex = re.sub(r"\\(begin|end)\{(aligned|align|gather|equation)\*?\}", lambda m: f"\\{m[1]}{{align*}}", latex.strip())
    return latex if "\\begin{" in latex or "\\\\" not in latex else f"\\begin{{align*}}{latex}\\end{{align*}}"


def setup(app):
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
