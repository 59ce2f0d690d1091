"""Errors that a user can act on: what, where, which rule, and the remedy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Integral


def printed(text: str, most: int = 2000) -> str:
    """One line as any screen may show it: an escape in place of what is not printed, cut where it is long."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:most])
    return shown if len(text) <= most and len(shown) <= most else shown[: most - 3] + "..."


def plural(name: str, count: int) -> str:
    """A noun as it stands behind a number."""
    return name if count == 1 else f"{name}s"


def counted(count: int, name: str) -> str:
    """So many of them: 1 cylinder, 4 cylinders."""
    return f"{count} {plural(name, count)}"


class LaufruheError(Exception):
    """Base of every error this package raises on purpose."""


class ModelError(LaufruheError, ValueError):
    """A machine that cannot exist or cannot run as described; `where` is the key to blame, if one is known."""

    def __init__(self, text: str, where: str = "") -> None:
        self.where = where
        super().__init__(text)


class KeyedError(ModelError):
    """A machine that cannot exist, the key of [engine] to blame, and what stands there; a rule, a remedy after '; '."""

    def __init__(self, key: str, text: str, value: str = "") -> None:
        self.key, self.text, self.value = key, text, value
        super().__init__(f"{key}: {text}", f"engine.{key}")

    def __reduce__(self) -> tuple[type[KeyedError], tuple[str, str, str]]:
        return KeyedError, (self.key, self.text, self.value)


@dataclass(frozen=True)
class Complaint:
    """One thing wrong with an input, in the order in which a user reads it; whatever it quotes can be printed."""

    where: str
    value: str
    rule: str
    remedy: str = ""

    def __str__(self) -> str:
        shown = f" = {printed(self.value, 300)}" if self.value else ""
        remedy = f"; {printed(self.remedy, 400)}" if self.remedy else ""
        return f"{printed(self.where, 120)}{shown}: {printed(self.rule, 300)}{remedy}"

    @classmethod
    def of(cls, error: Exception, where: str, value: str = "", remedy: str = "") -> Complaint:
        """Of an error whose text is a rule, and a remedy after '; '; `remedy` where it names none."""
        text = str(error)
        if isinstance(error, KeyedError):
            where, value, text = error.where, error.value, error.text
        rule, _, own = text.partition("; ")
        return cls(where, value, rule, own or remedy)


class InputError(LaufruheError, ValueError):
    """Bad input: one line a complaint, each led by the file it stands in."""

    def __init__(self, source: str, complaints: tuple[Complaint, ...]) -> None:
        self.source = source
        self.complaints = complaints
        super().__init__("\n".join(f"{printed(source, 400)}: {complaint}" for complaint in complaints))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, tuple[Complaint, ...]]]:
        # raised in a worker process, it has to reach the one that speaks to the user
        return InputError, (self.source, self.complaints)


class LaufruheWarning(UserWarning):
    """What a user should know of an answer that stands all the same."""


class UncarriedLoadError(ModelError):
    """The engine excites a direction that no mount carries."""

    def __init__(self, text: str) -> None:
        super().__init__(text, "mounts")


class SolverError(LaufruheError, RuntimeError):
    """A solver stopped without an answer that can be used."""


class BoundError(LaufruheError, RuntimeError):
    """A bound and a known design contradict each other, so that one of the two is wrong.

    Attributes
    ----------
    what
        Proof that the bound is part of, in words.
    bound, value
        In SI.
    """

    def __init__(self, what: str, bound: float, value: float) -> None:
        self.what, self.bound, self.value = what, float(bound), float(value)
        super().__init__(f"a bound of {self.bound!r} contradicts a known design of {self.value!r} ({what}) [SI]")

    def __reduce__(self) -> tuple[type[BoundError], tuple[str, float, float]]:
        # raised in a worker process, it has to reach the one that speaks to the user
        return BoundError, (self.what, self.bound, self.value)


def refused(where: str, value: str, rule: str, remedy: str, source: object = "laufruhe") -> InputError:
    """One line of complaint, led by the file it stands in."""
    return InputError(str(source), (Complaint(where, value, rule, remedy),))


def wrong_call(where: str, given: object, rule: str, remedy: str) -> InputError:
    """What a call in Python is refused with: an argument, as it was given, the rule and the remedy."""
    return refused(where, printed(repr(given), 60), rule, remedy)


def check_whole(where: str, given: object, least: int, most: float = math.inf) -> None:
    """Refuse an argument that is no whole number between two bounds."""
    if isinstance(given, bool) or not isinstance(given, Integral) or not least <= int(given) <= most:
        rule = (
            f"must be a whole number, {least} or more"
            if most == math.inf
            else f"must be a whole number, {least} to {most}"
        )
        raise wrong_call(where, given, rule, "give one")
