r"""Labels of equations as links: `(L7)` in a theory page leads to where L7 stands.

A label stands in the tag of a formula, `\tag{L7}`, or in bold at the beginning of a statement, `**L6** ...`.
"""

from __future__ import annotations

import re

from docutils import nodes
from mathml import anchor_of, label_of
from sphinx.application import Sphinx
from sphinx.util.nodes import make_refnode

PLACE = "theory/"
LABEL = re.compile(r"\b[A-Z]\d{1,2}[a-z]?\b")
NO_LINKS_IN = (
    nodes.title,
    nodes.reference,
    nodes.literal,
    nodes.literal_block,
    nodes.math,
    nodes.math_block,
    nodes.strong,
)


def mark(app: Sphinx, doctree: nodes.document) -> None:
    """Give every label of a theory page its anchor, and remember the page."""
    page, places = app.env.docname, _places(app)
    for label in [label for label, place in places.items() if place == page]:
        del places[label]
    if not page.startswith(PLACE):
        return
    for block in doctree.findall(nodes.math_block):
        if label := label_of(block.astext())[1]:
            places[label] = page
    for strong in doctree.findall(nodes.strong):
        found = LABEL.match(strong.astext())
        if found and found.group() not in places:
            places[found.group()] = page
            strong["ids"].append(anchor_of(found.group()))


def link(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Turn the labels in the text of a theory page into links."""
    places = _places(app)
    if not page.startswith(PLACE):
        return
    for text in list(doctree.findall(nodes.Text)):
        if not _stands_in(text, NO_LINKS_IN):
            text.parent.replace(text, _linked(app, page, text.astext(), places))


def _places(app: Sphinx) -> dict[str, str]:
    if not hasattr(app.env, "equation_labels"):
        app.env.equation_labels = {}  # type: ignore[attr-defined]
    return app.env.equation_labels  # type: ignore[attr-defined,no-any-return]


def _stands_in(node: nodes.Node, kinds: tuple[type, ...]) -> bool:
    while (node := node.parent) is not None:
        if isinstance(node, kinds):
            return True
    return False


def _linked(app: Sphinx, page: str, text: str, places: dict[str, str]) -> list[nodes.Node]:
    found: list[nodes.Node] = []
    end = 0
    for label in LABEL.finditer(text):
        if (place := places.get(label.group())) is not None:
            word = nodes.inline(text=label.group())
            found += [
                nodes.Text(text[end : label.start()]),
                make_refnode(app.builder, page, place, anchor_of(label.group()), word),
            ]
            end = label.end()
    return [*found, nodes.Text(text[end:])]


def setup(app: Sphinx) -> dict[str, bool]:
    """Find labels as pages are read, and links as they are written."""
    app.connect("doctree-read", mark)
    app.connect("doctree-resolved", link)
    return {"parallel_read_safe": False}
