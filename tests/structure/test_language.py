"""Names are terms of the field, and docstrings begin with a verb or a noun."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import laufruhe

SOURCE = Path(laufruhe.__file__).parent
PRO_WORDS = {
    "found", "own", "told", "tell", "tells", "given", "asked", "asks", "kept", "held", "shown", "felt", "each",
    "beside", "apart", "least", "most", "few", "nothing", "among", "enough", "judged", "concluded", "reachable",
    "lone", "finely", "foresight", "looks", "withheld", "opened", "lightest",
}  # fmt: skip
"""Pronouns, participles and adverbs that say nothing of what a name holds."""
PARTS = {
    "told", "tell", "tells", "asked", "asks", "felt", "judged", "concluded", "finely", "beside", "apart",
    "nothing", "foresight", "lone",
}  # fmt: skip
"""Words that no part of the name of a function, class or module may be."""
RIDDLES = {
    "Of", "What", "Whether", "Where", "As", "With", "By", "From", "That", "Those", "How", "Under", "At", "None",
    "One", "All", "Every", "If", "Unless", "Such", "Who", "Whose", "Which",
}  # fmt: skip
PAGE_KEYS = {"extensions/served_page/live/parts.py": {"shown"}}
"""Fields that pages read by their name."""
SHORT = 10
"""Lines of a private function from which it may have a docstring."""
TESTS = Path(__file__).parents[1]
PARTICIPLES = {"told", "asked", "felt", "heard", "kept", "wanted"}
"""Names that no value, function or class of tests may have."""
SUSPECTS = re.compile(
    rf'''"""(?:{"|".join(RIDDLES)})\b|(?<![\w."'])_?(?i:{"|".join(PARTICIPLES)})\b(?= *(?:[=,:)(\]]|in\b|for\b))'''
)
"""Text without which a file of tests needs no closer look, which takes ten times as long."""


def words_of(name: str) -> set[str]:
    """Return the words of a name in snake case or camel case."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def names_of(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and name of every parameter, variable and field that code defines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id if isinstance(node, ast.Name) else node.attr


def faults_of(text: str) -> list[str]:
    """Return the faults of a module, each with its line."""
    tree = ast.parse(text)
    faults = [f"{line}: name {name}" for line, name in names_of(tree) if name.strip("_").lower() in PRO_WORDS]
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if words_of(node.name) & PARTS or node.name.strip("_").lower() in PRO_WORDS:
                faults.append(f"{node.lineno}: name {node.name}")
            doc = ast.get_docstring(node) or ""
            if doc.partition(" ")[0] in RIDDLES:
                faults.append(f"{node.lineno}: docstring {doc.splitlines()[0]}")
            lines = (node.end_lineno or 0) - node.lineno + 1 - len(doc.splitlines())
            private = node.name.startswith("_") and not node.name.startswith("__")
            if isinstance(node, ast.FunctionDef) and private and doc and lines < SHORT:
                faults.append(f"{node.lineno}: docstring on {node.name} of {lines} lines")
    return faults


@pytest.mark.parametrize("room", sorted(path.name for path in SOURCE.iterdir() if path.suffix in ("", ".py")))
def test_names_and_docstrings_are_plain(room: str) -> None:
    path = SOURCE / room
    files = [path] if path.is_file() else sorted(path.rglob("*.py"))
    faults = {}
    for file in files:
        words = {word for part in file.relative_to(SOURCE).with_suffix("").parts for word in words_of(part)}
        faults[file.relative_to(SOURCE).as_posix()] = [
            *([f"module name {file.stem}"] if words & PARTS else []),
            *(
                fault
                for fault in faults_of(file.read_text(encoding="utf-8"))
                if fault.rpartition(" ")[2] not in PAGE_KEYS.get(file.relative_to(SOURCE).as_posix(), ())
            ),
        ]
    assert not {name: found for name, found in faults.items() if found}


@pytest.mark.parametrize("folder", ["attack", "benchmarks"])
def test_names_and_docstrings_of_tools_are_plain(folder: str) -> None:
    faults = {}
    for file in sorted((TESTS / folder).glob("*.py")):
        # short private functions of tools may have a docstring
        faults[file.name] = [fault for fault in faults_of(file.read_text("utf-8")) if "docstring on" not in fault]
    assert not {name: found for name, found in faults.items() if found}


def faults_of_tests(text: str) -> list[str]:
    """Return the names and first words of docstrings that tests may not have, each with its line."""
    if not SUSPECTS.search(text):
        return []
    tree = ast.parse(text)
    names = [*names_of(tree)]
    faults = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append((node.lineno, node.name))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            doc = node.value.value
            if re.split(r"\W", doc, maxsplit=1)[0] in RIDDLES:
                faults.append(f"{node.lineno}: docstring {doc.splitlines()[0]}")
    return faults + [f"{line}: name {name}" for line, name in names if name.strip("_").lower() in PARTICIPLES]


def test_names_and_docstrings_of_tests_are_plain() -> None:
    faults = {}
    for file in sorted(TESTS.rglob("*.py")):
        faults[file.relative_to(TESTS).as_posix()] = faults_of_tests(file.read_text("utf-8"))
    assert not {name: lines for name, lines in faults.items() if lines}


@pytest.mark.parametrize(
    "text",
    [
        "def told(x): ...",
        "class Felt: ...",
        "KEPT = 3",
        "for wanted in (): ...",
        "f = lambda asked: 0",
        "(x, heard) = (1, 2)",
        'def f():\n    """Of a rod."""',
        '"""What holds."""',
        'X = 1\n"""Of a rod [m]."""',
    ],
)
def test_faults_of_tests_are_found(text: str) -> None:
    assert len(faults_of_tests(text)) == 1


@pytest.mark.parametrize(
    "text",
    [
        "def told(x): ...",
        "def f(asked): ...",
        "x = own = 1",
        'def f():\n    """Of a rod."""',
        "class BeSide:\n    felt: int",
    ],
)
def test_faults_are_found(text: str) -> None:
    assert faults_of(text.replace("BeSide", "Beside"))
