"""Shape of the source, measured on its syntax: imports, circles, chains of questions.

Every measure is a set of names that break a rule. `python tests/structure/source_shape.py` prints them; `--prune`
removes from `exceptions.toml` the names that no longer break their rule, and never adds one.
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src"
EXCEPTIONS = Path(__file__).with_name("exceptions.toml")
ROOT = "laufruhe"
# Libraries that cost tens of milliseconds to load, and modules that load one, may be imported where they are
# needed. The commands may import anything late, so that `--help` answers at once, and so may the package itself.
HEAVY = {
    "PIL",
    "casadi",
    "clarabel",
    "cvxpy",
    "distributed",
    "exudyn",
    "ezdxf",
    "jinja2",
    "matplotlib",
    "openpyxl",
    "opentorsion",
    "pandas",
    "pint",
    "scipy",
    "xarray",
    "xlsxwriter",
}
LATE_ROOMS = ("", "cli")
COMMAND = "command"
"""Module of an extension that has its command."""
# Modules whose objects answer for themselves: nobody outside asks which one it is.
NORMS, CHANNELS = "laufruhe.numerics.norms", "laufruhe.problem.channels"
LAYOUT_ROOM = "laufruhe.machine"
NAMED = re.compile(r'^    name = "([a-z-]+)"$', re.MULTILINE)
LAYOUTS = {
    name
    for path in (SOURCE / "laufruhe/machine/layouts").glob("*.py")
    for name in NAMED.findall(path.read_text(encoding="utf-8"))
}

Trees = dict[str, ast.Module]
Function = ast.FunctionDef | ast.AsyncFunctionDef


def module_name(path: Path) -> str:
    parts = path.relative_to(SOURCE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room(module: str) -> str:
    """Return the second part of a module's name: empty for the package itself."""
    return module.partition(".")[2].partition(".")[0]


def trees() -> Trees:
    return {module_name(path): ast.parse(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))}


def total_lines() -> int:
    return sum(path.read_text(encoding="utf-8").count("\n") for path in SOURCE.rglob("*.py"))


def inside(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements of a statement, arms of `try` and `match` too; expressions hold no functions or imports."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        result = getattr(node, field, None)
        if isinstance(result, list):
            yield from result


def functions(tree: ast.AST, prefix: str = "") -> Iterator[tuple[str, Function]]:
    """Yield every function of a tree with its dotted name, those of classes and functions included."""
    for node in inside(tree):
        if isinstance(node, Function | ast.ClassDef):
            name = f"{prefix}{node.name}"
            if isinstance(node, Function):
                yield name, node
            yield from functions(node, f"{name}.")
        else:
            yield from functions(node, prefix)


def imported(node: ast.AST, module: str, known: Trees) -> set[str]:
    """Return the modules that an import statement names; a name that is no module counts as its package."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.ImportFrom):
        assert node.level == 0, f"{module}: relative import"
        base = node.module or ""
        return {f"{base}.{alias.name}" if f"{base}.{alias.name}" in known else base for alias in node.names}
    return set()


def run_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield every statement except those that only a type checker reads."""
    for node in inside(tree):
        if not (isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"):
            yield node
            yield from run_nodes(node)


def statements(node: ast.AST) -> Iterator[ast.AST]:
    for part in inside(node):
        yield part
        yield from statements(part)


def own_imports(known: Trees) -> dict[str, set[str]]:
    """Return the modules of the project that each module imports when it runs, inside functions too."""
    return {
        module: {name for node in run_nodes(tree) for name in imported(node, module, known) if name in known} - {module}
        for module, tree in known.items()
    }


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Return the strongly connected sets of more than one module (Kosaraju)."""
    order: list[str] = []
    seen: set[str] = set()

    def visit(start: str, edges: dict[str, set[str]], found: list[str]) -> None:
        stack = [(start, iter(sorted(edges[start])))]
        seen.add(start)
        while stack:
            name, rest = stack[-1]
            following = next((other for other in rest if other not in seen), None)
            if following is None:
                found.append(name)
                stack.pop()
            else:
                seen.add(following)
                stack.append((following, iter(sorted(edges[following]))))

    for name in sorted(graph):
        if name not in seen:
            visit(name, graph, order)
    backward: dict[str, set[str]] = {name: set() for name in graph}
    for name, others in graph.items():
        for other in others:
            backward[other].add(name)
    seen.clear()
    sets: list[set[str]] = []
    for name in reversed(order):
        if name not in seen:
            component: list[str] = []
            visit(name, backward, component)
            sets.append(set(component))
    return [component for component in sets if len(component) > 1]


def loading(known: Trees) -> set[str]:
    """Return the modules that load a heavy library when they are imported, by themselves or by what they import."""
    top = {
        module: {name for node in tree.body for name in imported(node, module, known)} for module, tree in known.items()
    }
    found = {module for module, names in top.items() if any(name.partition(".")[0] in HEAVY for name in names)}
    while more := {module for module, names in top.items() if names & found} - found:
        found |= more
    return found


def is_lazy_call(function: Function) -> bool:
    """Return True if a function imports another one and ends with its call: the module of the caller stays light."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    if len(body) < 2:
        return False
    first, last = body[0], body[-1]
    call = last.value if isinstance(last, ast.Return | ast.Expr) else None
    if not (isinstance(first, ast.ImportFrom) and isinstance(call, ast.Call) and isinstance(call.func, ast.Name)):
        return False
    return [alias.asname or alias.name for alias in first.names] == [call.func.id]


def late_imports(known: Trees) -> set[str]:
    heavy = loading(known)
    return {
        f"{module} -> {name}"
        for module, tree in known.items()
        if room(module) not in LATE_ROOMS and module.rpartition(".")[2] != COMMAND
        for _, function in functions(tree)
        if not is_lazy_call(function)
        for node in statements(function)
        for name in imported(node, module, known)
        if name.partition(".")[0] not in HEAVY and name not in heavy
    }


@cache
def operands(tree: ast.Module) -> tuple[ast.expr, ...]:
    """Return the operands of comparisons, patterns and `isinstance`, each member of a tuple by itself."""
    found: list[ast.expr] = []
    for node in ast.walk(tree):
        compared: list[ast.expr] = []
        if isinstance(node, ast.Compare):
            compared = [node.left, *node.comparators]
        elif isinstance(node, ast.MatchValue):
            compared = [node.value]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            compared = node.args[1:]
        for expression in compared:
            found += expression.elts if isinstance(expression, ast.Tuple | ast.Set | ast.List) else [expression]
    return tuple(found)


def names_of(tree: ast.Module, home: str) -> set[str]:
    """Return the names that a module has from `home`, or from what is below it, and the name of `home` itself."""
    found: set[str] = set()
    for node in statements(tree):
        if isinstance(node, ast.ImportFrom):
            base = node.module or ""
            names = {alias.asname or alias.name: f"{base}.{alias.name}" for alias in node.names}
            found |= {name for name, whole in names.items() if whole == home or whole.startswith(f"{home}.")}
    return found


def questions_of(known: Trees, home: str) -> set[str]:
    """Return the modules outside `home` that ask which of its objects they hold, with how often they ask."""
    found: dict[str, int] = {}
    for module, tree in known.items():
        names = names_of(tree, home)
        for operand in operands(tree):
            # NORMS["rms"], channels.SAG and Mean are all asked for by their first name
            while isinstance(operand, ast.Attribute | ast.Subscript):
                operand = operand.value
            if isinstance(operand, ast.Name) and operand.id in names and not module.startswith(home):
                found[module] = found.get(module, 0) + 1
    return {f"{module}: {count}" for module, count in found.items()}


def questions_of_layout(known: Trees) -> set[str]:
    found: dict[str, int] = {}
    for module, tree in known.items():
        for operand in operands(tree):
            named = isinstance(operand, ast.Constant) and operand.value in LAYOUTS
            if named and not module.startswith(LAYOUT_ROOM):
                found[module] = found.get(module, 0) + 1
    return {f"{module}: {count}" for module, count in found.items()}


def measured() -> dict[str, set[str]]:
    """Return the names that break each rule."""
    known = trees()
    return {
        "late_imports": late_imports(known),
        "circles": {module for circle in circles(own_imports(known)) for module in circle},
        "questions_of_norm": questions_of(known, NORMS),
        "questions_of_channel": questions_of(known, CHANNELS),
        "questions_of_layout": questions_of_layout(known),
    }


def exceptions() -> dict[str, set[str]]:
    return {rule: set(names) for rule, names in tomllib.loads(EXCEPTIONS.read_text(encoding="utf-8")).items()}


def written(table: dict[str, set[str]]) -> str:
    head = "# What still breaks a rule of the structure. Names only go from here, none comes.\n"
    entries = {rule: "".join(f'    "{name}",\n' for name in sorted(names)) for rule, names in table.items()}
    return head + "".join(f"\n{rule} = [\n{names}]\n" for rule, names in entries.items())


def still_allowed(name: str, allowed: set[str]) -> bool:
    """Return whether an exception covers a name; a count may only fall."""
    module, _, count = name.partition(": ")
    if not count:
        return name in allowed
    limits = [int(other.rpartition(": ")[2]) for other in allowed if other.partition(": ")[0] == module]
    return bool(limits) and int(count) <= limits[0]


def main() -> None:
    result = measured()
    if "--prune" in sys.argv:
        allowed = exceptions()
        allowed_names = {
            rule: {name for name in names if still_allowed(name, allowed[rule])} for rule, names in result.items()
        }
        EXCEPTIONS.write_text(written(allowed_names), encoding="utf-8")
        return
    sys.stdout.write(written(result) + f"\n# {total_lines()} lines in all\n")


if __name__ == "__main__":
    main()
