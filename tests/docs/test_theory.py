"""Theory pages: figures are what their script draws, and every label of an equation is on one page."""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.append(str(DOCS / "extensions"))

from figures import FIGURES, PICTURES  # noqa: E402
from mathml import mathml  # noqa: E402

PAGES = sorted(DOCS.glob("theory/*.md"))
LABEL = re.compile(r"\*\*([A-Z]\d+[a-z]?)\b|\\tag\{([A-Z]\d+[a-z]?)\}")


def labels() -> Counter[str]:
    """Labels, each with the number of pages that define it."""
    found = [LABEL.findall(page.read_text(encoding="utf-8")) for page in PAGES]
    return Counter(label for page in found for label in {bold or tag for bold, tag in page})


@pytest.mark.parametrize("name", FIGURES)
def test_figures_are_up_to_date(name: str) -> None:
    """`python docs/extensions/figures.py` draws them."""
    assert (PICTURES / f"{name}.svg").read_text(encoding="utf-8") == FIGURES[name]()


def test_every_label_stands_on_one_page() -> None:
    assert [label for label, count in labels().items() if count > 1] == []


def test_labels_that_the_code_cites_are_there() -> None:
    """A citation is one label, or several with commas, alone in parentheses: `(K4)`, `(L3, L7)`.

    Labels N are those of steps in `laufruhe.solvers.smooth.nonlinear`, which explains them itself.
    """
    cited = {
        label
        for path in (ROOT / "src").rglob("*.py")
        for group in re.findall(r"\(((?:[A-Z]\d+[a-z]?(?:, )?)+)\)", path.read_text(encoding="utf-8"))
        for label in re.findall(r"[A-MO-Z]\d+[a-z]?", group)
    }
    assert len(cited) > 100
    assert sorted(cited - set(labels())) == []


@pytest.mark.parametrize(
    ("formula", "within"),
    [
        (r"\begin{aligned} a &= b \\ c &= d \end{aligned}", 'text-align: right; padding-right: 0"><mi>c</mi>'),
        (r"\sin\alpha", '<mi>sin</mi><mspace width="0.167em" /><mi>\u03b1</mi>'),
        (r"\psi'^2", "<msup><mrow><mi>\u03c8</mi><mi>\u2032</mi></mrow><mrow><mn>2</mn></mrow></msup>"),
        (r"s''", "<mrow><mi>s</mi><mi>\u2033</mi></mrow>"),
        (r"\operatorname{Re} u", '<mi>Re</mi><mspace width="0.167em" /><mi>u</mi>'),
    ],
)
def test_formulas_are_set_as_in_books(formula: str, within: str) -> None:
    assert within in mathml(formula)
