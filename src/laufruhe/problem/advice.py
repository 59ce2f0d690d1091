"""Advice of extensions about problems and their files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from laufruhe.errors import Complaint
from laufruhe.extension import extended

if TYPE_CHECKING:
    from laufruhe.problem.problem import Problem


@dataclass(frozen=True)
class Advice:
    """Warnings, which stop nothing, and remedies for refused files.

    Attributes
    ----------
    name
        Subject of the advice.
    about_problem
        Function that returns warnings about a problem.
    about_gas
        Function that returns sentences about the gas of a problem.
    about_file
        Function of [engine] of a file and of its problem that returns warnings.
    remedied
        Function of [engine] and of the complaint about a refused file that returns a better complaint, or the same.
    """

    name: str
    about_problem: Callable[[Problem], Iterable[Complaint]] = lambda _: ()
    about_gas: Callable[[Problem], Iterable[str]] = lambda _: ()
    about_file: Callable[[Any, Problem], Iterable[Complaint]] = lambda _, __: ()
    remedied: Callable[[Any, Complaint], Complaint] = lambda _, complaint: complaint


ADVICE: Mapping[str, Advice] = extended("advice", Advice, ())
