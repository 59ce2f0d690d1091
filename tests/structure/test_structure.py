"""Imports only point down and stand at the top; kinds answer for themselves.

What breaks a rule today stands in `exceptions.toml`. Whoever mends one takes it out:
`python tests/structure/source_shape.py --prune`.
"""

import ast
import pickle

import pytest

from shared import once
from structure import source_shape

# all share what takes seconds to measure; `make test` and the hook before a commit look at it
pytestmark = pytest.mark.slow

RULES = {
    "late_imports": "imports inside a function, of no heavy library, for no command, and not to hand over",
    "circles": "modules in a circle of imports, those inside functions included",
    "questions_of_norm": "modules that ask which norm they hold, with how often",
    "questions_of_channel": "modules that ask which channel they measure, with how often",
    "questions_of_layout": "modules that ask for a layout by its name, with how often",
}


@pytest.fixture(scope="module")
def rule_breaks() -> dict[str, set[str]]:
    cache = once("source-shape", lambda folder: (folder / "found").write_bytes(pickle.dumps(source_shape.measured())))
    return pickle.loads((cache / "found").read_bytes())


@pytest.mark.parametrize("rule", RULES)
def test_nothing_new_breaks_a_rule_of_the_structure(rule, rule_breaks):
    allowed = source_shape.exceptions()[rule]
    new = {name for name in rule_breaks[rule] if not source_shape.still_allowed(name, allowed)}
    assert not new, f"{RULES[rule]}: {sorted(new)} ({source_shape.total_lines()} lines of source in all)"


@pytest.mark.parametrize("rule", RULES)
def test_an_exception_that_is_mended_is_taken_out(rule, rule_breaks):
    mended = source_shape.exceptions()[rule] - rule_breaks[rule]
    assert not mended, (
        f"no longer {RULES[rule]}: {sorted(mended)}; run `python tests/structure/source_shape.py --prune` "
        f"({source_shape.total_lines()} lines of source in all)"
    )


def test_the_rules_are_those_that_are_measured(rule_breaks):
    assert set(RULES) == set(rule_breaks) == set(source_shape.exceptions())


def test_every_room_has_its_tests():
    package, tests = source_shape.SOURCE / source_shape.ROOT, source_shape.EXCEPTIONS.parents[1]
    rooms = {path.parent.name for path in package.glob("*/__init__.py")}
    tested = {path.parent.name for path in tests.glob("*/test_*.py")}
    assert rooms <= tested


def test_a_circle_is_found_also_through_a_third_module():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set(), "e": {"a"}}
    assert source_shape.circles(graph) == [{"a", "b", "c"}]


def test_a_function_that_hands_over_may_import_late():
    def shape(text):
        return source_shape.is_lazy_call(ast.parse(text).body[0])

    assert shape("def f(x):\n    from m import g\n    return g(x)")
    assert shape("def f(x):\n    'Docstring.'\n    from m import g\n    y = x + 1\n    g(y)")
    assert not shape("def f(x):\n    from m import g\n    return 1 + g(x)")
    assert not shape("def f(x):\n    from m import g, h\n    return g(h(x))")
    assert not shape("def f(x):\n    return g(x)")
