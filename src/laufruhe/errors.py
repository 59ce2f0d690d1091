"""Errors with a remedy for the user: place, value, broken rule and remedy in one line."""

from __future__ import annotations

import copyreg
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Integral
from typing import Any


def printed(text: str, maximum: int = 2000) -> str:
    """Return a text as one line, with escapes for characters that cannot be printed, cut after `maximum` characters."""
    escaped = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:maximum])
    return escaped if len(text) <= maximum and len(escaped) <= maximum else escaped[: maximum - 3] + "..."


def plural(name: str, count: int) -> str:
    """Return a noun in the singular for one and in the plural for other numbers."""
    return name if count == 1 else f"{name}{'es' if name.endswith('x') else 's'}"


def counted(count: int, name: str) -> str:
    """Return a number with its noun, such as 1 cylinder or 4 cylinders."""
    return f"{count} {plural(name, count)}"


class LaufruheError(Exception):
    """Base of all errors that this package raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        # an error of a worker process reaches its parent, whatever its class is made of
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]


class ModelError(LaufruheError, ValueError):
    """Machine that cannot exist or cannot run as described; `where` is the key at fault, empty if unknown."""

    def __init__(self, text: str, where: str = "") -> None:
        self.where = where
        super().__init__(text)


class KeyedError(ModelError):
    """Machine that cannot exist, with the key of [engine] at fault and its value.

    The text consists of rule and remedy, separated by '; '.
    """

    def __init__(self, key: str, text: str, value: str = "") -> None:
        self.key, self.text, self.value = key, text, value
        super().__init__(f"{key}: {text}", f"engine.{key}")


@dataclass(frozen=True)
class Complaint:
    """Fault of an input, with place, value (may be empty), rule and remedy."""

    where: str
    value: str
    rule: str
    remedy: str = ""

    def __str__(self) -> str:
        value = f" = {printed(self.value, 300)}" if self.value else ""
        remedy = f"; {printed(self.remedy, 400)}" if self.remedy else ""
        return f"{printed(self.where, 120)}{value}: {printed(self.rule, 300)}{remedy}"

    @classmethod
    def from_error(cls, error: Exception, where: str, value: str = "", remedy: str = "") -> Complaint:
        """Return the complaint for an error whose text is a rule, perhaps with a remedy after '; '.

        `where`, `value` and `remedy` are defaults for errors without them.
        """
        text = str(error)
        if isinstance(error, KeyedError):
            where, value, text = error.where, error.value, error.text
        rule, _, own_remedy = text.partition("; ")
        return cls(where, value, rule, own_remedy or remedy)


class InputError(LaufruheError, ValueError):
    """Faulty input; its text has one line for each complaint, with the name of the file."""

    def __init__(self, source: str, complaints: tuple[Complaint, ...]) -> None:
        self.source = source
        self.complaints = complaints
        super().__init__("\n".join(f"{printed(source, 400)}: {complaint}" for complaint in complaints))


class LaufruheWarning(UserWarning):
    """Warning about a valid result."""


class UncarriedLoadError(ModelError):
    """Load of the engine in a direction that no mount carries."""

    def __init__(self, text: str) -> None:
        super().__init__(text, "mounts")


class SolverError(LaufruheError, RuntimeError):
    """Solver that stopped without a usable result."""


OPTIONAL_LIBRARIES = {"casadi": "casadi", "cvxpy": "cvxpy-base"}
"""Libraries that only some problems need, and the names of their packages."""


@contextmanager
def optional_libraries() -> Iterator[None]:
    """Turn the import of a missing optional library in the block into a `SolverError` with the command of pip."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = OPTIONAL_LIBRARIES.get(error.name or "")
        if package is None:
            raise
        raise SolverError(f"the Python library {error.name} is missing; pip install {package}") from None


class BoundError(LaufruheError, RuntimeError):
    """Lower bound above the value of a known design; one of the two is wrong.

    Attributes
    ----------
    what
        Name of the proof.
    bound, value
        Bound and value of the known design [SI].
    """

    def __init__(self, what: str, bound: float, value: float) -> None:
        self.what, self.bound, self.value = what, float(bound), float(value)
        super().__init__(f"a bound of {self.bound!r} contradicts a known design of {self.value!r} ({what}) [SI]")


def refused(where: str, value: str, rule: str, remedy: str, source: object = "laufruhe") -> InputError:
    """Return an `InputError` with one complaint; `source` is the name of the file."""
    return InputError(str(source), (Complaint(where, value, rule, remedy),))


def wrong_call(where: str, argument: object, rule: str, remedy: str) -> InputError:
    """Return an `InputError` about a wrong argument of a Python call."""
    return refused(where, printed(repr(argument), 60), rule, remedy)


def check_names(kind: str, names: Iterable[str]) -> None:
    """Raise `ModelError` if two parts of a kind, a noun in the plural, have one name."""
    double = next((name for name, count in Counter(names).items() if count > 1), None)
    if double is not None:
        raise ModelError(f"two {kind} are called '{double}'; give each its own name")


def check_integer(where: str, argument: object, lower: int, upper: float = math.inf) -> None:
    """Raise `InputError` unless an argument is a whole number between two bounds."""
    if isinstance(argument, bool) or not isinstance(argument, Integral) or not lower <= int(argument) <= upper:
        span = f"{lower} or more" if upper == math.inf else f"{lower} to {upper}"
        raise wrong_call(where, argument, f"must be a whole number, {span}", "give one")
