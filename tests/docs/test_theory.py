"""Theory pages: figures are what their script draws, and every label of an equation is on one page."""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from laufruhe.extensions.bearing_loads.physics import beam_shares, lever_shares
from laufruhe.extensions.flywheel.torque import swing_of, torque_facts
from laufruhe.extensions.torsion.machine import Disc, ShaftSection, Torsion
from laufruhe.extensions.torsion.physics import critical_speed, natural_modes
from laufruhe.machine import Cycle, Engine, OperatingPoint, Seiliger, SliderCrank
from laufruhe.physics.order_coefficients import piston_acceleration_orders
from laufruhe.physics.shaking_loads import shaking_loads

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.append(str(DOCS / "extensions"))

from figures import FIGURES, PICTURES  # noqa: E402
from mathml import mathml  # noqa: E402

SPEED, KP_CM2 = 2500.0 * math.pi / 30.0, 98066.5
PAGES = sorted(DOCS.glob("theory/*.md"))
LABEL = re.compile(r"\*\*([A-Z]\d+[a-z]?)\b|\\tag\{([A-Z]\d+[a-z]?)\}")


def labels() -> Counter[str]:
    """Return the labels, each with the number of pages that define it."""
    text = [LABEL.findall(page.read_text(encoding="utf-8")) for page in PAGES]
    return Counter(label for page in text for label in {bold or tag for bold, tag in page})


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


def piston(mass: float) -> Engine:
    part = SliderCrank("cylinder", 0.0, 0.06, 0.06 / 0.26, mass, bore=0.1)
    return Engine("one cylinder", Cycle.FOUR_STROKE, (part,))


def size_of_orders() -> list[str]:
    sizes = np.abs(piston_acceleration_orders(0.26, 0.0, 6))
    return [f"| size | {sizes[1]:.0f} | {sizes[2]:.5f} | {sizes[4]:.7f} | {sizes[6]:.7f} |",
            f"is {100.0 * (sizes[2] / 0.26 - 1.0):.1f} % low"]  # fmt: skip


def loads_of_a_piston() -> list[str]:
    wrench = shaking_loads(piston(2.0), OperatingPoint("run", SPEED))
    return [
        f"| {name} | " + " | ".join(f"{abs(wrench.at(order)[row]):.0f}" for order in (1, 2, 3, 4)) + " |"
        for name, row in (("force along the axis [N]", 2), ("roll moment [N m]", 3))
    ]


def torque_of_a_cylinder() -> list[str]:
    gas = Seiliger(peak_pressure=80.0 * KP_CM2, imep=5.5 * KP_CM2)
    point = OperatingPoint("run", SPEED, gas)
    facts, swing = torque_facts(piston(2.0), point), swing_of(piston(2.0), point)
    return [f"{facts.mean:.1f} N m", f"{1e-3 * facts.power:.1f} kW", f"{facts.largest:.0f} N m",
            f"{facts.excursion:.0f} J", f"{swing.irregularity(1.0):.5f}", f"{facts.excursion / SPEED**2:.5f}",
            f"{swing.irregularity(2.0):.5f}"]  # fmt: skip


def mode_of_two_discs() -> list[str]:
    chain = Torsion(discs=(Disc("crank", 0.05), Disc("flywheel", 0.5)), sections=(ShaftSection("shaft", 1e5),))
    modes = natural_modes(chain)
    assert modes.shapes[:, 0] == pytest.approx([1.0, -0.1])
    (frequency,) = modes.frequencies
    return [f"{frequency:.1f} Hz", f"{critical_speed(frequency, 4.0) * 30.0 / math.pi:.0f} rpm"]


def shares_of_bearings() -> list[str]:
    cut, beam = (100.0 * rule([0.0, 0.1, 0.2], [0.04])[:, 0] for rule in (lever_shares, beam_shares))
    return [f"{abs(share):.1f} %" for share in (*cut[:2], *beam)]


@pytest.mark.parametrize(
    ("page", "numbers"),
    [("kinematics", size_of_orders), ("loads", loads_of_a_piston), ("torque", torque_of_a_cylinder),
     ("torsion", mode_of_two_discs), ("bearings", shares_of_bearings)],
)  # fmt: skip
def test_small_examples_are_what_the_package_computes(page: str, numbers: Callable[[], list[str]]) -> None:
    text = (DOCS / "theory" / f"{page}.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"\*A small example\.\*.*?\n(?=## |\*\*)", text, flags=re.DOTALL)
    assert [number for number in numbers() if number not in example] == []


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
