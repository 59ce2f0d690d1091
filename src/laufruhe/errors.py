"""Errors that a user can act on: what, where, which rule, and the remedy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Integral


def printed(text: str, maximum: int = 2000) -> str:
    """Return one line with escapes for characters that are not printed, cut if it is long."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:maximum])
    return shown if len(text) <= maximum and len(shown) <= maximum else shown[: maximum - 3] + "..."


def plural(name: str, count: int) -> str:
    """Return a noun in the form that follows a number."""
    return name if count == 1 else f"{name}s"


def counted(count: int, name: str) -> str:
    """Return a number with its noun: 1 cylinder, 4 cylinders."""
    return f"{count} {plural(name, count)}"


class LaufruheError(Exception):
    """Base of every error this package raises on purpose."""


class ModelError(LaufruheError, ValueError):
    """Machine that cannot exist or cannot run as described; `where` is the key to blame, if known."""

    def __init__(self, text: str, where: str = "") -> None:
        self.where = where
        super().__init__(text)


class KeyedError(ModelError):
    """Machine that cannot exist, with the key of [engine] to blame and its value; rule, and remedy after '; '."""

    def __init__(self, key: str, text: str, value: str = "") -> None:
        self.key, self.text, self.value = key, text, value
        super().__init__(f"{key}: {text}", f"engine.{key}")

    def __reduce__(self) -> tuple[type[KeyedError], tuple[str, str, str]]:
        return KeyedError, (self.key, self.text, self.value)


@dataclass(frozen=True)
class Complaint:
    """Fault of an input: place, value, rule and remedy; all text can be printed."""

    where: str
    value: str
    rule: str
    remedy: str = ""

    def __str__(self) -> str:
        shown = f" = {printed(self.value, 300)}" if self.value else ""
        remedy = f"; {printed(self.remedy, 400)}" if self.remedy else ""
        return f"{printed(self.where, 120)}{shown}: {printed(self.rule, 300)}{remedy}"

    @classmethod
    def from_error(cls, error: Exception, where: str, value: str = "", remedy: str = "") -> Complaint:
        """Return the complaint of an error, whose text is a rule and a remedy after '; '; `remedy` is the default."""
        text = str(error)
        if isinstance(error, KeyedError):
            where, value, text = error.where, error.value, error.text
        rule, _, own = text.partition("; ")
        return cls(where, value, rule, own or remedy)


class InputError(LaufruheError, ValueError):
    """Bad input: one line a complaint, each with the name of its file."""

    def __init__(self, source: str, complaints: tuple[Complaint, ...]) -> None:
        self.source = source
        self.complaints = complaints
        super().__init__("\n".join(f"{printed(source, 400)}: {complaint}" for complaint in complaints))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, tuple[Complaint, ...]]]:
        # an error of a worker process has to reach its parent
        return InputError, (self.source, self.complaints)


class LaufruheWarning(UserWarning):
    """Warning about a valid result."""


class UncarriedLoadError(ModelError):
    """The engine excites a direction that no mount carries."""

    def __init__(self, text: str) -> None:
        super().__init__(text, "mounts")


class SolverError(LaufruheError, RuntimeError):
    """Solver that stopped without a usable result."""


class BoundError(LaufruheError, RuntimeError):
    """Contradiction of a bound and a known design, one of which is wrong.

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

    def __reduce__(self) -> tuple[type[BoundError], tuple[str, float, float]]:
        # an error of a worker process has to reach its parent
        return BoundError, (self.what, self.bound, self.value)


def refused(where: str, value: str, rule: str, remedy: str, source: object = "laufruhe") -> InputError:
    """Return an error with one complaint about a file."""
    return InputError(str(source), (Complaint(where, value, rule, remedy),))


def wrong_call(where: str, argument: object, rule: str, remedy: str) -> InputError:
    """Return the error of a wrong argument of a Python call."""
    return refused(where, printed(repr(argument), 60), rule, remedy)


def check_integer(where: str, argument: object, lower: int, upper: float = math.inf) -> None:
    """Refuse an argument that is no whole number between two bounds."""
    if isinstance(argument, bool) or not isinstance(argument, Integral) or not lower <= int(argument) <= upper:
        span = f"{lower} or more" if upper == math.inf else f"{lower} to {upper}"
        raise wrong_call(where, argument, f"must be a whole number, {span}", "give one")
