"""Balancer shafts of a problem: their names, and the problem without some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.files.study_parts import CaseTable
from laufruhe.machine import Role
from laufruhe.problem.decision import without_rotors
from laufruhe.problem.problem import Problem
from laufruhe.studies.scenes import Scenes


def shafts_of(problem: Problem) -> tuple[str, ...]:
    """Names of the balancer shafts, in the order of the engine."""
    return tuple(dict.fromkeys(r.shaft.name for r in problem.engine.rotors if r.role is Role.BALANCER))


def with_shafts(problem: Problem, kept: Sequence[str]) -> Problem:
    """The problem without the balancer shafts that are not named."""
    unknown = set(kept) - set(shafts_of(problem))
    if unknown:
        raise ModelError(f"'{min(unknown)}' is no balancer shaft of this engine; name one that is")
    rotors = tuple(r for r in problem.engine.rotors if r.role is not Role.BALANCER or r.shaft.name in kept)
    gone = {rotor.name for rotor in problem.engine.rotors} - {rotor.name for rotor in rotors}
    decisions = without_rotors(problem.decisions, gone)
    return replace(problem, engine=replace(problem.engine, rotors=rotors), decisions=decisions)


def refuse_open_phasing(problem: Problem, case: CaseTable, scenes: Scenes) -> None:
    """Of sets of shafts: an open star has a choice of its own.

    Raises
    ------
    InputError
        If something of the phasing is open.
    """
    if problem.phasing is not None:
        rule, remedy = "is open, and decides on shafts by itself", "use laufruhe solve, or fix it"
        raise scenes.refused(case, "phasing", rule, remedy)
