"""Sphinx extension: mathematics as SVG, drawn when the book is built; pages need no script."""

from __future__ import annotations

import html
from typing import Any

import ziamath
from docutils import nodes
from sphinx.application import Sphinx

SIZE = 17.0
"""Font size [px]; text has 16."""


def draw(latex: str, inline: bool) -> str:
    """A formula as an SVG element in the colour of the text around it, and as text for readers."""
    formula = ziamath.Latex(latex, size=SIZE, color="currentColor", inline=inline)
    drop = "" if not inline else f' style="vertical-align:{formula.getyofst():.1f}px"'
    label = html.escape(" ".join(latex.split()), quote=True)
    return formula.svg().replace("<svg ", f'<svg role="img" aria-label="{label}"{drop} ', 1)


def visit_inline(translator: Any, node: nodes.math) -> None:
    """A formula within a line."""
    translator.body.append(f'<span class="math">{draw(node.astext(), inline=True)}</span>')
    raise nodes.SkipNode


def visit_block(translator: Any, node: nodes.math_block) -> None:
    """A formula that stands alone."""
    drawn = draw(node.astext(), inline=False)
    translator.body.append(translator.starttag(node, "div", CLASS="math"))
    translator.body.append(f"{drawn}</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer as "svg"."""
    app.add_html_math_renderer("svg", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
