"""Loads of an engine with geared shafts whose lead angles are open, with derivatives by the leads (P13).

A load is the sum of the load of the fixed parts and of the loads of each shaft with an open lead. The load of a shaft,
gas included, comes earlier by the lead of the shaft. Loads are affine in the unbalances (P1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.machine import CRANKSHAFT
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum, common_base
from laufruhe.problem.decision import Kind, real_bounds
from laufruhe.problem.measure import Measure, kinks_of, load_rows, narrow_signal
from laufruhe.problem.problem import Problem

FINE = 1440
"""Number of averages over the cycle in the rows of a mean, if no unbalances are open and rows are cheap."""


@dataclass(frozen=True, eq=False)
class LoadPart:
    """Part of a load that one shaft with an open lead angle causes, or all parts with a fixed phase together.

    Attributes
    ----------
    bare
        Spectrum with every unbalance decision at zero, for each operating point.
    columns
        For each column of the decision vector, the spectrum of one unit for each operating point.
    """

    bare: list[Spectrum]
    columns: list[list[Spectrum]]

    def earlier(self, lead: float) -> LoadPart:
        """Return the part of the load if its shaft runs ahead by another lead angle [rad]."""
        return self.mapped(lambda signal: earlier(signal, lead)) if lead else self

    def mapped(self, change: Callable[[Spectrum], Spectrum]) -> LoadPart:
        """Return the part of the load with the function `change` applied to every spectrum."""
        return LoadPart(
            [change(signal) for signal in self.bare], [[change(signal) for signal in column] for column in self.columns]
        )


def earlier(signal: Spectrum, lead: float) -> Spectrum:
    """Return a signal that comes earlier by a lead angle [rad]."""
    return signal.shift(-lead / signal.period, -lead) if lead else signal


@dataclass(frozen=True, eq=False)
class PhaseLeadNorm:
    """Norm of affine load rows at given leads, and the derivatives of the rows by each lead.

    Attributes
    ----------
    derivatives
        For each lead: derivative of the constant rows, shape (k, d), derivative of the slope, shape (k, d, n), and
        the part of the slope that its shaft causes, shape (k, d, n).
    angles
        Crank angles of the rows of one signal [rad], shape (points, steps); None if leads change nothing.
    """

    norm: AffineNorm
    derivatives: tuple[tuple[Array, Array, Array], ...]
    angles: Array | None = None


class PhaseLeadModel:
    """Loads of an engine for any lead angles of its geared shafts; only lead angles and unbalances are open.

    Attributes
    ----------
    lower, upper, start
        Bounds and initial values of the lead angles [rad], shape (leads,).
    names
        Names of the shafts with an open lead angle.
    base_model
        Loads of the whole engine with the lead angles at their initial values.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.leads = tuple(d for d in problem.decisions if d.kind is Kind.LEAD)
        self.lower, self.upper = real_bounds(self.leads)
        self.start = np.array([d.real_start for d in self.leads])
        self.names = [shaft for d in self.leads for shaft in d.keys(Kind.LEAD)]
        self.base_model = AffineModel(replace(problem, decisions=problem.unbalances), True, True)
        self.domains = self.base_model.domains
        self._shafts = [AffineModel(problem_of_shafts(problem, name.__eq__), True, True) for name in self.names]
        self._fixed = AffineModel(problem_of_shafts(problem, lambda name: name not in self.names), True, True)
        self._cache: dict[Measure, tuple[LoadPart, list[LoadPart]]] = {}

    def shares(self, measure: Measure) -> tuple[LoadPart, list[LoadPart]]:
        """Return the parts of a load: from all parts with a fixed phase, and from each shaft with an open lead angle.

        Their spectra have a common period, so that they can be added.
        """
        if measure not in self._cache:
            shares = []
            for model in (self._fixed, *self._shafts):
                bare, columns = zip(*model.spectra(measure.load), strict=True)
                shares.append(LoadPart(list(bare), [list(column) for column in zip(*columns, strict=True)]))
            signals = [signal for share in shares for column in (share.bare, *share.columns) for signal in column]
            base = common_base([self.problem.engine.cycle.base_order, *(signal.base for signal in signals)])
            count = max(len(signal.with_finer_base(base).coefficients) for signal in signals)
            fixed, *shafts = (
                share.mapped(lambda signal: signal.with_finer_base(base).padded(count)) for share in shares
            )
            self._cache[measure] = fixed, shafts
        return self._cache[measure]

    def norm(self, measure: Measure, leads: Array, samples: int, averaged: bool) -> PhaseLeadNorm:
        """Return a measure at fixed lead angles as a norm of the unbalances, with derivatives by the lead angles.

        See `at` for the parameters.
        """
        if not measure.is_load:
            norm = self.base_model.norm(measure, samples)
            zeros = np.zeros_like(norm.constant), np.zeros_like(norm.slope), np.zeros_like(norm.slope)
            return PhaseLeadNorm(norm, (zeros,) * len(self.names))
        fixed, shafts = self.shares(measure)
        shifted = [share.earlier(lead) for share, lead in zip(shafts, (leads - self.start).tolist(), strict=True)]
        bare = [reduce(add, signals) for signals in zip(fixed.bare, *(share.bare for share in shifted), strict=True)]
        columns = [
            [reduce(add, signals) for signals in zip(*parts, strict=True)]
            for parts in zip(fixed.columns, *(share.columns for share in shifted), strict=True)
        ]
        kinks = kinks_of(measure, bare, self.problem.engine)
        averaged = averaged and measure.norm.averages

        def rows(signals: Sequence[Spectrum]) -> tuple[Grid, Array]:
            step = signals[0].period / samples
            signals = [signal.averaged(step) for signal in signals] if averaged else signals
            sampled = load_rows(measure, self.problem.points, signals, self.problem.engine, samples, kinks)
            return sampled.grid, sampled.vectors

        grid, constant = rows(bare)

        def slope(columns: Sequence[Sequence[Spectrum]]) -> Array:
            slopes = [rows(column)[1] for column in columns]
            return np.stack(slopes, axis=-1) if slopes else np.zeros((*constant.shape, 0))

        derivatives = []
        for share in shifted:
            derivative = share.mapped(lambda signal: signal.derivative)
            derivatives.append((rows(derivative.bare)[1], slope(derivative.columns), slope(share.columns)))
        steps = bare[0].period * np.arange(samples) / samples
        angles = np.array([np.concatenate([steps, kinks_of_signal]) for kinks_of_signal in kinks])
        return PhaseLeadNorm(AffineNorm(measure.norm, constant, slope(columns), grid), tuple(derivatives), angles)

    def at(self, leads: Array, samples: int, averaged: bool = False) -> tuple[AffineProblem, tuple[PhaseLeadNorm, ...]]:
        """Return the problem of the unbalances at fixed lead angles [rad], and its norms with derivatives by them.

        The norms of the terms stand before those of the limits.

        Parameters
        ----------
        samples
            Number of samples over the common period.
        averaged
            Whether the rows of means are averages over the step about each sample (P7).
        """

        def norm(measure: Measure) -> PhaseLeadNorm:
            # without open unbalances samples are cheap: peaks have those of results (M6), and means have short averages
            times = 1 if self.domains or not measure.is_load else measure.norm.refinement
            if times == 1 and averaged and not self.domains:
                times = max(round(FINE / samples), 1)
            return self.norm(measure, leads, times * samples, averaged)

        terms = [(term.weight, norm(term.measure)) for term in self.problem.load_terms]
        limits = [(limit.maximum, norm(limit.measure)) for limit in self.problem.load_limits]
        program = AffineProblem(
            tuple((weight, term.norm) for weight, term in terms),
            tuple((maximum, limit.norm) for maximum, limit in limits),
            self.domains, samples,
        )  # fmt: skip
        return program, tuple(norm for _, norm in (*terms, *limits))

    def counted(self, measure: Measure, shaft: int) -> list[Spectrum]:
        """Return the load of a shaft at its initial lead angle in the orders of a measure, per operating point."""
        shares = measure.shares(self.problem.points)
        signals = self.shares(measure)[1][shaft].bare
        engine = self.problem.engine
        return [narrow_signal(measure, signal, engine) for signal, share in zip(signals, shares, strict=True) if share]


def problem_of_shafts(problem: Problem, is_included: Callable[[str], bool]) -> Problem:
    """Return the problem with only those parts of the engine that are on shafts whose name `is_included` accepts.

    The load is on the crankshaft.
    """
    engine = problem.engine
    parts = tuple(part for part in engine.slider_cranks if is_included(part.shaft.name))
    # other rotors stay without unbalance, so that every decision keeps its column
    rotors = tuple(r if is_included(r.shaft.name) else replace(r, unbalance=0.0) for r in engine.rotors)
    included = {rotor.name for rotor in rotors if is_included(rotor.shaft.name)}
    decisions = [
        replace(d, drives=tuple(v if v.rotor in included else replace(v, gain=0.0) for v in d.rotor_drives))
        for d in problem.unbalances
    ]
    loaded = engine if is_included(CRANKSHAFT.name) else engine.unloaded
    reduced = replace(loaded, slider_cranks=parts, rotors=rotors)
    return replace(problem, engine=reduced, decisions=tuple(decisions))
