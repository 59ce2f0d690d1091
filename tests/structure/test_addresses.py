"""Functions and objects that the source names by `module:name` exist, those of tables of extensions included."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name

import pytest

import laufruhe

SOURCE = Path(laufruhe.__file__).parent
ADDRESS = re.compile(r"laufruhe(\.\w+)*:\w+")
IN_SOURCE = re.compile(r"[\w}]:\w+\"")


def addresses_of(module: str, text: str) -> list[str]:
    """Return the addresses in a module's strings; names in braces are those of the module."""
    strings = [node for node in ast.walk(ast.parse(text)) if isinstance(node, (ast.Constant, ast.JoinedStr))]
    found = []
    for node in strings:
        if isinstance(node, ast.Constant):
            value = node.value
        elif IN_SOURCE.search(ast.unparse(node).replace("'", '"')):
            names = {"__name__": module, **vars(import_module(module))}
            try:
                value = eval(compile(ast.Expression(node), module, "eval"), names)
            except NameError:
                # an address that a function makes of its own names
                continue
        else:
            continue
        if isinstance(value, str) and ADDRESS.fullmatch(value):
            found.append(value)
    return found


def addresses() -> list[tuple[str, str]]:
    """Return (module, address) of every string of the source that is an address."""
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if IN_SOURCE.search(text):
            parts = path.relative_to(SOURCE.parent).with_suffix("").parts
            module = ".".join(parts).removesuffix(".__init__")
            found += [(module, address) for address in addresses_of(module, text)]
    return found


def is_found(address: str) -> bool:
    """Return True if the object of an address can be imported."""
    try:
        resolve_name(address)
    except (ImportError, AttributeError):
        return False
    return True


@pytest.mark.slow
def test_every_address_of_the_source_is_found() -> None:
    every = addresses()
    assert len({module for module, _ in every if ".extensions." in module}) > 15
    wrong = [f"{module} names {address}" for module, address in every if not is_found(address)]
    assert not wrong


@pytest.mark.parametrize(
    ("text", "is_right"),
    [
        ('imported("laufruhe.solvers.cones.unbalances:solve_unbalances")', True),
        ('imported(f"{_HERE}.cones.unbalances:solve_unbalances")', True),
        ('imported(f"{_HERE}.cones.unbalances:solve_all")', False),
        ('imported("laufruhe.solvers.no_module:solve")', False),
    ],
)
def test_an_address_of_a_changed_name_is_noticed(text: str, is_right: bool) -> None:
    (address,) = addresses_of("laufruhe.solvers.methods", text)
    assert is_found(address) is is_right
