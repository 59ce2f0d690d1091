"""A problem whose shafts come earlier by angles that are open: what stands, and what each of them brings (P13).

Every load that adds up over parts is the sum of what stands and of what each shaft carries; that comes earlier by as
much as its shaft leads, also where gas makes it. Unbalances are columns beside it, as everywhere (P1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum, common_base
from laufruhe.problem.decision import Kind
from laufruhe.problem.measure import Measure, kinks_of, load_rows, narrow_signal
from laufruhe.problem.problem import Problem

FINE = 1440
"""Angles between which a mean is averaged where no program stands at them."""


@dataclass(frozen=True, eq=False)
class Share:
    """The spectra of one shaft, or of the fixed rest: per operating point, and per unit of every column."""

    own: list[Spectrum]
    columns: list[list[Spectrum]]


@dataclass(frozen=True, eq=False)
class PhaseLeadNorm:
    """A norm at some leads, and what each lead changes of its rows there.

    Attributes
    ----------
    norm
        Its rows at these leads.
    moved
        Of every lead the same rows differentiated by it, (k, d) and (k, d, n), and the slope that its shaft brings.
    angles
        Of the rows of one signal, shape (points, steps) [rad]; None where leads change nothing.
    """

    norm: AffineNorm
    moved: tuple[tuple[Array, Array, Array], ...]
    angles: Array | None = None


class PhaseLeadModel:
    """Loads at any leads.

    Parameters
    ----------
    problem
        Whose decisions are leads and unbalances.

    Attributes
    ----------
    lower, upper, start
        Of the leads [rad].
    names
        Of their shafts.
    whole
        Of the engine with its leads at their start.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.leads = tuple(d for d in problem.decisions if d.kind is Kind.LEAD)
        self.lower, self.upper = (np.array([getattr(d, side) for d in self.leads]) for side in ("lower", "upper"))
        self.start = np.array([d.real_start for d in self.leads])
        self.names = [shaft for d in self.leads for shaft in d.keys(Kind.LEAD)]
        self.whole = AffineModel(replace(problem, decisions=problem.unbalances), True, True)
        self.domains = self.whole.domains
        self._shafts = [AffineModel(carried(problem, name.__eq__), True, True) for name in self.names]
        self._still = AffineModel(carried(problem, lambda name: name not in self.names), True, True)
        self._known: dict[Measure, tuple[Share, list[Share]]] = {}

    def shares(self, measure: Measure) -> tuple[Share, list[Share]]:
        """Return the spectra of a load from the fixed rest and from each shaft, over a common period."""
        if measure not in self._known:
            engine = self.problem.engine
            found = [_share(model.spectra(measure.load)) for model in (self._still, *self._shafts)]
            each = [signal for share in found for by in (share.own, *share.columns) for signal in by]
            base = common_base([engine.cycle.base_order, *(signal.base for signal in each)])
            count = max(len(signal.with_finer_base(base).coefficients) for signal in each)
            still, *shafts = (_each(share, lambda own: own.with_finer_base(base).padded(count)) for share in found)
            self._known[measure] = still, shafts
        return self._known[measure]

    def norm(self, measure: Measure, leads: Array, samples: int, averaged: bool) -> PhaseLeadNorm:
        """A measure at some leads, its means averaged about their angles where asked (P7)."""
        if not measure.is_load:
            norm = self.whole.norm(measure, samples)
            none = np.zeros_like(norm.constant), np.zeros_like(norm.slope), np.zeros_like(norm.slope)
            return PhaseLeadNorm(norm, (none,) * len(self.names))
        still, shafts = self.shares(measure)
        by = leads - self.start
        led = [_moved(share, float(d)) for share, d in zip(shafts, by, strict=True)]
        total = _sum(still, led)
        bends = kinks_of(measure, total.own, self.problem.engine)
        averaged = averaged and measure.norm.averages

        def rows(signals: Sequence[Spectrum]) -> tuple[Grid, Array]:
            step = signals[0].period / samples
            signals = [signal.averaged(step) for signal in signals] if averaged else signals
            found = load_rows(measure, self.problem.points, signals, self.problem.engine, samples, bends)
            return found.grid, found.vectors

        grid, constant = rows(total.own)
        slope = _stacked([rows(own)[1] for own in total.columns], constant)
        moved = []
        for share in led:
            steep = _derived(share)
            own = rows(steep.own)[1]
            rising, flat = (_stacked([rows(each)[1] for each in by.columns], constant) for by in (steep, share))
            moved.append((own, rising, flat))
        steps = total.own[0].period * np.arange(samples) / samples
        angles = np.array([np.concatenate([steps, own]) for own in bends])
        return PhaseLeadNorm(AffineNorm(measure.norm, constant, slope, grid), tuple(moved), angles)

    def at(self, leads: Array, samples: int, averaged: bool = False) -> tuple[AffineProblem, tuple[PhaseLeadNorm, ...]]:
        """Terms and limits that are loads or masses at some leads, and all of these norms in their order."""

        def norm(measure: Measure) -> PhaseLeadNorm:
            # without a program peaks are sought as finely as results are measured (M6), and means hardly averaged
            times = 1 if self.domains or not measure.is_load else measure.norm.refinement
            if times == 1 and averaged and not self.domains:
                times = max(round(FINE / samples), 1)
            return self.norm(measure, leads, times * samples, averaged)

        terms = [(term.weight, norm(term.measure)) for term in self.problem.load_terms]
        limits = [(limit.maximum, norm(limit.measure)) for limit in self.problem.load_limits]
        program = AffineProblem(
            tuple((weight, led.norm) for weight, led in terms), tuple((maximum, led.norm) for maximum, led in limits),
            self.domains, samples,
        )  # fmt: skip
        return program, tuple(led for _, led in (*terms, *limits))

    def counted(self, measure: Measure, shaft: int) -> list[Spectrum]:
        """Return the counted spectra of a shaft at its starting lead, one per operating point with a weight."""
        shares = measure.shares(self.problem.points)
        own = self.shares(measure)[1][shaft].own
        return [
            narrow_signal(measure, each, self.problem.engine) for each, share in zip(own, shares, strict=True) if share
        ]


def carried(problem: Problem, belongs: Callable[[str], bool]) -> Problem:
    """The problem of what the shafts of some names carry alone, nothing else of the engine in it."""
    engine = problem.engine
    parts = tuple(part for part in engine.slider_cranks if belongs(part.shaft.name))
    # the others stay as places without an unbalance, so that every decision keeps its column
    rotors = tuple(r if belongs(r.shaft.name) else replace(r, unbalance=0.0) for r in engine.rotors)
    own = {rotor.name for rotor in rotors if belongs(rotor.shaft.name)}
    decisions = [
        replace(d, drives=tuple(v if v.rotor in own else replace(v, gain=0.0) for v in d.rotor_drives))
        for d in problem.unbalances
    ]
    return replace(problem, engine=replace(engine, slider_cranks=parts, rotors=rotors), decisions=tuple(decisions))


def _share(spectra: Sequence[tuple[Spectrum, tuple[Spectrum, ...]]]) -> Share:
    return Share([own for own, _ in spectra], [list(each) for each in zip(*(by for _, by in spectra), strict=True)])


def _moved(share: Share, lead: float) -> Share:
    return _each(share, lambda signal: signal.shift(-lead / signal.period, -lead)) if lead else share


def _derived(share: Share) -> Share:
    return _each(share, lambda signal: signal.derivative)


def _each(share: Share, change: Callable[[Spectrum], Spectrum]) -> Share:
    return Share([change(own) for own in share.own], [[change(own) for own in by] for by in share.columns])


def _sum(still: Share, led: Sequence[Share]) -> Share:
    own = [reduce(add, each) for each in zip(still.own, *(share.own for share in led), strict=True)]
    columns = [
        [reduce(add, each) for each in zip(*by, strict=True)]
        for by in zip(still.columns, *(share.columns for share in led), strict=True)
    ]
    return Share(own, columns)


def _stacked(columns: Sequence[Array], constant: Array) -> Array:
    return np.stack(columns, axis=-1) if columns else np.zeros((*constant.shape, 0))
