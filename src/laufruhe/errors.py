"""Errors that a user can act on: what, where, which rule, and the remedy."""

from __future__ import annotations

from dataclasses import dataclass


class LaufruheError(Exception):
    """Base of every error this package raises on purpose."""


class ModelError(LaufruheError, ValueError):
    """A machine that cannot exist or cannot run as described."""


class KeyedError(ModelError):
    """A machine that cannot exist, the key of [engine] to blame, and what stands there; a rule, a remedy after '; '."""

    def __init__(self, key: str, text: str, value: str = "") -> None:
        self.key, self.text, self.value = key, text, value
        super().__init__(key, text, value)

    def __str__(self) -> str:
        return f"{self.key}: {self.text}"


@dataclass(frozen=True)
class Complaint:
    """One thing wrong with an input, in the order in which a user reads it."""

    where: str
    value: str
    rule: str
    remedy: str = ""

    def __str__(self) -> str:
        shown = f" = {self.value}" if self.value else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{self.where}{shown}: {self.rule}{remedy}"

    @classmethod
    def of(cls, error: Exception, where: str, value: str = "", remedy: str = "") -> Complaint:
        """Of an error whose text is a rule, and a remedy after '; '; `remedy` where it names none."""
        text = str(error)
        if isinstance(error, KeyedError):
            where, value, text = f"engine.{error.key}", error.value, error.text
        rule, _, own = text.partition("; ")
        return cls(where, value, rule, own or remedy)


class InputError(LaufruheError, ValueError):
    """Bad input: one line a complaint, each led by the file it stands in."""

    def __init__(self, source: str, complaints: tuple[Complaint, ...]) -> None:
        self.source = source
        self.complaints = complaints
        super().__init__("\n".join(f"{source}: {complaint}" for complaint in complaints))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, tuple[Complaint, ...]]]:
        # raised in a worker process, it has to reach the one that speaks to the user
        return InputError, (self.source, self.complaints)


class UncarriedLoadError(ModelError):
    """The engine excites a direction that no mount carries."""


class SolverError(LaufruheError, RuntimeError):
    """A solver stopped without an answer that can be used."""
