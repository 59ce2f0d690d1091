"""Channels that lower bounds of designs on open mounts support; the bounds ignore all other terms and limits."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.problem.channels import AT_EACH_MOUNT, CHANNELS, OF_MOUNTING
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

NAMED = AT_EACH_MOUNT | {*OF_MOUNTING, *(channel for channel in CHANNELS.values() if channel.simulation)}
"""Channels that have formulas over boxes of mounts."""


def named_part(problem: Problem) -> Problem:
    """Return a problem without the objective terms and limits that the bounds over boxes of mounts cannot compute.

    Its bound holds for the whole problem: no term is negative, and fewer limits allow more designs.
    """
    terms = tuple(term for term in problem.objective if is_named(term.measure, problem))
    limits = tuple(limit for limit in problem.limits if is_named(limit.measure, problem))
    if len(terms) == len(problem.objective) and len(limits) == len(problem.limits):
        return problem
    return replace(problem, objective=terms, limits=limits)


def is_named(measure: Measure, problem: Problem) -> bool:
    """Return True if a measure has a bound: it is constant, affine in unbalances, or has a formula for boxes."""
    norm = measure.norm
    is_bounded = norm.is_euclidean or norm.sums_lengths or norm.is_largest or norm.is_largest_mean or norm.is_diameter
    if measure.is_load and not (measure in problem.known_rows or is_bounded):
        return False
    for kind in {decision.kind for decision in problem.decisions}:
        depends = dependence(measure.channel, kind, problem)
        affine = kind.is_affine and depends is Dependence.AFFINE
        has_formula = measure.channel in NAMED and depends is not Dependence.UNKNOWN
        if not (depends is Dependence.NONE or affine or has_formula):
            return False
    return True
