"""Formulas as MathML, which browsers show by themselves: nothing is fetched."""

from __future__ import annotations

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def displayed(writer: HTML5Translator, node: nodes.math_block) -> None:
    r"""A formula of its own; `\tag{G1}` is its label beside it."""
    text, _, tag = node.astext().partition(r"\tag{")
    label = f'<span class="eqno">({tag.rstrip().removesuffix("}")})</span>' if tag else ""
    writer.body.append(f'<div class="math">{label}{convert(text, display="block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the renderer known."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True}
