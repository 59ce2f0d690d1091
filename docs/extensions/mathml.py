r"""Render formulas as MathML, which browsers show by themselves: nothing is fetched.

The LaTeX is that of `latex2mathml`, and besides it the environment `aligned`. A formula on a line of its own may end
with `\tag{K1}`, its label.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import zip_longest

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

MATHML = "http://www.w3.org/1998/Math/MathML"
NAMES = {"sin", "cos", "tan", "arcsin", "arccos", "arctan", "ln", "log", "exp", "Re", "Im", "max", "min", "asinh"}
"""Functions that are written upright, with a space before and after."""
PRIMES = {"\u2032", "\u2033", "\u2034"}
ET.register_namespace("", MATHML)


def mathml(text: str, display: str = "inline") -> str:
    """Return a LaTeX formula as MathML, for browsers that know MathML Core."""
    # the environment that lines up relations is known by one name only
    tree = ET.fromstring(convert(text.replace("{aligned}", "{align*}"), display=display))
    for parent in list(tree.iter()):
        _set_primes(parent)
        _space_names(parent)
    for bar in tree.iter(_tag("mo")):
        if bar.text == "|":
            # a length and no relation
            bar.attrib |= {"lspace": "0", "rspace": "0"}
    for table in tree.iter(_tag("mtable")):
        _align(table, between="displaystyle" in table.attrib)
    if display == "block":
        # centred by the style of the page, which knows the label beside it
        tree.attrib |= {"display": "inline", "displaystyle": "true"}
    return ET.tostring(tree, encoding="unicode")


def label_of(text: str) -> tuple[str, str]:
    r"""Return a formula without its `\tag`, and its label, which is empty without one."""
    formula, _, tag = text.partition(r"\tag{")
    return formula, tag.strip().removesuffix("}")


def anchor_of(label: str) -> str:
    """Return the anchor of a label on its page."""
    return f"eq-{label.lower()}"


def _tag(name: str) -> str:
    return f"{{{MATHML}}}{name}"


def _set_primes(node: ET.Element) -> None:
    """Set the primes of a letter beside it: most fonts raise them as they are, and once more is too high."""
    scripts = node.tag in map(_tag, ("msup", "msubsup"))
    above = node[-1] if scripts else None
    if above is None:
        return
    prime, rest = (above, None) if above.text in PRIMES else (above[0], above[1:]) if len(above) > 1 else (None, None)
    if prime is None or prime.text not in PRIMES:
        return
    base = node[0]
    if node.tag == _tag("msubsup"):
        base = ET.Element(_tag("msub"))
        base.extend(node[:2])
    letter = ET.Element(_tag("mrow"))
    letter.extend([base, prime])
    node.clear()
    node.tag = _tag("msup" if rest else "mrow")
    if rest:
        exponent = ET.Element(_tag("mrow"))
        exponent.extend(rest)
        node.extend([letter, exponent])
    else:
        node.extend(letter)


def _is_name(node: ET.Element) -> bool:
    head = node[0] if node.tag in map(_tag, ("msub", "msup", "munder", "msubsup")) else node
    return head.tag in map(_tag, ("mi", "mo")) and head.text in NAMES


def _space_names(parent: ET.Element) -> None:
    """Put a thin space between a function and its argument, and before it."""
    if parent.tag not in map(_tag, ("mrow", "math", "mtd", "mstyle", "msqrt")):
        return
    children = list(parent)
    for child, after in zip_longest(children, children[1:]):
        if _is_name(child):
            head = child[0] if len(child) else child
            head.tag = _tag("mi")
            if after is not None and (after.tag not in (_tag("mo"), _tag("mspace")) or after.text == "|"):
                _insert(parent, list(parent).index(child) + 1)
        elif after is not None and _is_name(after) and child.tag not in (_tag("mo"), _tag("mspace")):
            _insert(parent, list(parent).index(after))


def _insert(parent: ET.Element, place: int) -> None:
    parent.insert(place, ET.Element(_tag("mspace"), {"width": "0.167em"}))


def _align(table: ET.Element, between: bool) -> None:
    """Align cells by style, the one way that browsers know; where relations line up, pairs of cells touch."""
    for row in table:
        for k, cell in enumerate(row):
            side = cell.attrib.pop("columnalign", None)
            if side is not None:
                touching = f"; padding-{side}: 0" if between else ""
                apart = "; padding-left: 2em" if between and k % 2 == 0 and k else ""
                cell.set("style", f"text-align: {side}{touching}{apart}")


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def displayed(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula on a line of its own, with its label beside it."""
    formula, label = label_of(node.astext())
    mark = f'<span class="label">({label})</span>' if label else ""
    anchor = f' id="{anchor_of(label)}"' if label else ""
    parts = f'<div class="formula">{mathml(formula, "block")}</div>{mark}'
    writer.body.append(f'<div class="math" tabindex="0"{anchor}>{parts}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the renderer known."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True}
