"""No bound is brought down to a value: what is proven is said raw, and compared with what is known."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import laufruhe

SOURCE = Path(laufruhe.__file__).parent
ROOMS = ("prove", "solvers")
LEAST, MOST = {"min", "minimum", "fmin", "clip"}, {"max", "maximum", "fmax"}
VALUES = {"value", "cutoff", "known", "best", "level", "maximum"}
"""Names of what is known of designs."""
BOUNDS = ("bound", "divide", "floor", "found", "minimum", "looked", "total")
"""Parts of names of bounds."""
ALLOWED = {
    # bounds of all designs up to a level hold below it, and cut-off parts are not below theirs
    "min(looked[0], first.level)",
    "min(best, self.level)",
    "min(self._minimum, child.level)",
    "min(queue[0].bound if queue else math.inf, self._minimum, self.level)",
    # the least of the bounds of several stars
    "min(incumbent, float(star_bounds(costs, stars[[np.argmin(bounds)]])[0]))",
    "min(incumbent, float(bounds.min(initial=math.inf)))",
    # least known value of an objective in ranks, when a walk finds a better design
    "min(rank.minimum, value)",
    # largest forces of springs, and the worth of further search
    "min(maximum, line.largest)",
    "min(firing.maximum, firing.cycle.angle - (len(constants) - 1) * firing.minimum)",
    "min(maximum, bounds[name].work(value / term.weight))",
    "min(first, cutoff)",
    "min(second, cutoff)",
}
"""Calls that look alike and bring no bound down."""


def names_of(node: ast.expr) -> set[str]:
    """Return the names in an expression."""
    found = {each.attr for each in ast.walk(node) if isinstance(each, ast.Attribute)}
    return found | {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


def is_value(node: ast.expr) -> bool:
    """Return whether an expression is a known value of a design, or a share of it."""
    if isinstance(node, ast.Call) and node.args:
        return is_value(node.args[-1])
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        return is_value(node.left)
    name = node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")
    return name.strip("_") in VALUES


def clips(text: str) -> Iterator[str]:
    """Yield calls of min and max that compare a bound with a known value of a design."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call) or len(node.args) < 2 or node.keywords:
            continue
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        values = [each for each in node.args if is_value(each)]
        bounds = [each for each in node.args if each not in values and is_bound(each)]
        # an upper bound is a lower one with the other sign
        raised = called in MOST and any(isinstance(each, ast.UnaryOp) for each in bounds)
        if values and bounds and (called in LEAST or raised):
            yield ast.unparse(node)


def is_bound(node: ast.expr) -> bool:
    """Return whether an expression has the name of a bound in it."""
    return any(part in name for name in names_of(node) for part in BOUNDS)


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_no_bound_is_brought_to_a_value(room: str) -> None:
    found = {
        (path.relative_to(SOURCE).as_posix(), clip)
        for path in sorted((SOURCE / room).rglob("*.py"))
        for clip in clips(path.read_text(encoding="utf-8"))
        if clip not in ALLOWED
    }
    assert not found


@pytest.mark.parametrize(
    "line",
    [
        "bound = float(min(max(bound, 0.0), value))",
        "return min(max(found, 0.0), maximum), pull, middle",
        "bound = max(min(bound + mean.constant, self.maximum), mean.floor)",
        "return min(total, self.value), pull",
        "found = ThrowBound(min(bound, search.cut(found.value)), found.design)",
        "shown = ProofData(bound=min(bound, design.value))",
        "return min(self.divide(root, 10), self._cutoff.value)",
        "return WorstCase(errors, value, max(value, -bound), seen)",
        "minimum = np.minimum(bounds, value)",
    ],
)
def test_clips_are_found(line: str) -> None:
    assert list(clips(line))
