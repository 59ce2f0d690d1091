"""Mutants of the source: each changes one operator, number or choice on one line."""

from __future__ import annotations

import ast
import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src"
ROOMS = (
    "physics", "load_models", "prove", "solvers", "machine",
    "extensions/joint_mounts", "extensions/long_cranks", "extensions/mount_relaxation", "extensions/robust",
    "extensions/phase_leads", "extensions/run_ups", "extensions/sizes", "extensions/torsion",
)  # fmt: skip
"""Folders of physics, search and proof."""
TOLERANCE = 1e-3
COMPARISONS = {
    ast.Lt: ("<", ">"), ast.Gt: (">", "<"), ast.LtE: ("<=", ">="), ast.GtE: (">=", "<="), ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
}  # fmt: skip
ARITHMETIC = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*")}
LOGIC = {ast.And: ("and", "or"), ast.Or: ("or", "and")}
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax",
            "argmax": "argmin", "floor": "ceil", "ceil": "floor", "any": "all", "all": "any"}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """Changed line of a file below `src`.

    Attributes
    ----------
    file
        Path relative to `src`.
    function
        Qualified name of the innermost function that holds the line.
    line
        Number of the line, from 1.
    before, after
        The line without and with the change.
    repeat
        Count of equal changes above it in the function.
    """

    file: str
    function: str
    line: int
    before: str
    after: str
    repeat: int = 0

    @property
    def change(self) -> str:
        """Return what is changed where; lines above it that come or go leave it as it is."""
        return f"{self.file}:{self.function}: {self.before.strip()}  ->  {self.after.strip()} {self.repeat}"

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.before.strip()}  ->  {self.after.strip()}"


def mutants_of(path: Path) -> list[Mutant]:
    """Return every mutant of a file."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    found, tree = [], ast.parse(text)
    placeholders = {id(node) for parent in ast.walk(tree) for node in _placeholders(parent)}
    for function, node in _nodes(tree):
        if id(node) in placeholders:
            continue
        for line, start, end, new in _changes(node, lines):
            old = lines[line - 1]
            found.append(Mutant(str(path.relative_to(SOURCE)), function, line, old, f"{old[:start]}{new}{old[end:]}"))
    seen: Counter[str] = Counter()
    numbered = []
    for mutant in dict.fromkeys(found):
        numbered.append(replace(mutant, repeat=seen[mutant.change]))
        seen[mutant.change] += 1
    return numbered


@cache
def code_of(file: str) -> str:
    """Return a hash of what Python runs of a file: comments, docstrings and places of lines do not count."""
    tree = ast.parse((SOURCE / file).read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [each for each in node.body if not _is_text(each)]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


@cache
def all_mutants() -> tuple[Mutant, ...]:
    """Return every mutant of the rooms, in the order of files and lines."""
    folders = [SOURCE / "laufruhe" / room for room in ROOMS]
    if gone := [str(folder) for folder in folders if not folder.is_dir()]:
        raise FileNotFoundError(f"no such rooms: {gone}; change ROOMS in {Path(__file__).name}")
    files = [file for folder in folders for file in sorted(folder.rglob("*.py"))]
    return tuple(mutant for file in files for mutant in mutants_of(file))


def drawn(number: int, seed: int) -> list[Mutant]:
    """Return a random sample of all mutants, the same for the same seed and source.

    Each mutant draws its own place from a hash of its change, so an edit of the source leaves all others in the sample.
    """
    places = [(hashlib.sha256(f"{seed} {mutant.change}".encode()).digest(), mutant) for mutant in all_mutants()]
    return [mutant for _, mutant in sorted(places, key=lambda pair: pair[0])[:number]]


def _nodes(tree: ast.AST, scope: str = "", function: str | None = None) -> Iterator[tuple[str, ast.AST]]:
    """Yield expressions inside functions that are no annotation, message or docstring."""
    for field, value in ast.iter_fields(tree):
        if field in ("annotation", "returns", "decorator_list") or isinstance(tree, ast.Raise | ast.JoinedStr):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.Raise | ast.JoinedStr):
                continue
            inner, inside = function, scope
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                inner = f"{scope}{child.name}"
                inside = f"{inner}.<locals>."
            elif isinstance(child, ast.ClassDef):
                inside = f"{scope}{child.name}."
            if inner is not None:
                yield inner, child
            yield from _nodes(child, inside, inner)


def _placeholders(node: ast.AST) -> Iterator[ast.AST]:
    """Yield numbers that change nothing: in place of a size of zero, of a length that reshaping works out, seeds."""
    match node:
        case ast.BoolOp(op=ast.Or(), values=[*_, ast.Constant(value=float(1.0)) as last]):
            yield last
        case ast.BinOp(
            op=ast.Div(), right=ast.Call(func=ast.Attribute(attr="where"), args=[_, _, ast.Constant() as last])
        ):
            yield last
        case ast.Call(func=ast.Attribute(attr="default_rng"), args=[seed]):
            yield seed
        case ast.Call(func=ast.Attribute(attr="reshape"), args=args):
            sizes = [size for arg in args for size in ast.walk(arg)]
            yield from (s.operand for s in sizes if isinstance(s, ast.UnaryOp) and isinstance(s.op, ast.USub))


def _changes(node: ast.AST, lines: Sequence[str]) -> Iterator[tuple[int, int, int, str]]:
    """Yield line, first and last column and the new text of each change of one node."""
    match node:
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARISONS:
            yield from _between(left, right, *COMPARISONS[type(op)], lines)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC and not _is_neutral(op, left, right):
            yield from _between(left, right, *ARITHMETIC[type(op)], lines)
        case ast.BoolOp(op=op, values=[left, right, *_]):
            yield from _between(left, right, *LOGIC[type(op)], lines)
        case ast.UnaryOp(op=ast.USub(), operand=operand) if not isinstance(operand, ast.Constant):
            yield from _prefix(node, operand, "-")
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield from _prefix(node, operand, "not ")
        case ast.Call(func=ast.Name(id=name) as func) if name in EXTREMES:
            yield func.lineno, func.col_offset, func.col_offset + len(name), EXTREMES[name]
        case ast.Call(func=ast.Attribute(attr=name) as func) if name in EXTREMES and func.end_col_offset is not None:
            if func.end_lineno is not None:
                yield func.end_lineno, func.end_col_offset - len(name), func.end_col_offset, EXTREMES[name]
        case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
            # a tolerance twice as large is none that a test has to see
            if node.end_col_offset is not None and not 0.0 < value < TOLERANCE:
                new = repr(value + 1) if isinstance(value, int) else repr(2.0 * value if value else 1.0)
                yield node.lineno, node.col_offset, node.end_col_offset, new


def _is_neutral(op: ast.operator, *operands: ast.expr) -> bool:
    """Return whether another operator joins texts, or changes nothing beside a factor of one."""
    values = [operand.value for operand in operands if isinstance(operand, ast.Constant)]
    texts = any(isinstance(value, str) for value in values) or any(isinstance(o, ast.JoinedStr) for o in operands)
    return texts or (isinstance(op, ast.Mult | ast.Div) and 1 in values[-1:])


def _prefix(node: ast.expr, operand: ast.expr, old: str) -> Iterator[tuple[int, int, int, str]]:
    if node.lineno == operand.lineno:
        yield node.lineno, node.col_offset, node.col_offset + len(old), ""


def _between(
    left: ast.expr, right: ast.expr, old: str, new: str, lines: Sequence[str]
) -> Iterator[tuple[int, int, int, str]]:
    """Yield the operator's place between two operands on one line."""
    if left.end_lineno != right.lineno or left.end_col_offset is None or not lines[right.lineno - 1].isascii():
        return
    start = lines[right.lineno - 1].find(old, left.end_col_offset, right.col_offset)
    if start >= 0:
        yield right.lineno, start, start + len(old), new
