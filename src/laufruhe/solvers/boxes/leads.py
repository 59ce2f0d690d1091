"""Leads of geared shafts, and of machines coupled on one: boxes of leads, each bounded by its program (P13, P14).

What is affine stands in a cone program in the middle of every box, whose dual rows bound the whole of it. Where nothing
but leads is open, searches from the best points of a grid find a design first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import AffineProblem
from laufruhe.load_models.led_model import LedModel, LedNorm
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Decision
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import EMPTY, Box, Over, halves
from laufruhe.prove.boxes.leads import SLACK, LeadBound, LeadBoxes
from laufruhe.prove.certificate import Multipliers, best_bound
from laufruhe.prove.witness import thin
from laufruhe.solvers.boxes.held_designs import SHARE, HeldDesign, HeldDesigns, best_with
from laufruhe.solvers.boxes.search import searched
from laufruhe.solvers.conclusion import judged
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.equations import on_grid
from laufruhe.solvers.result import Result

MOST_BOXES, MOST_PROGRAMS = 20_000, 2_000
"""Boxes of leads alone, and of those with a cone program each."""
GRID, MOST_STARTS, MOST_STEPS = 24, 600, 300
"""Steps of a lead, and points in all, among which searches begin, and their own steps."""
COARSE, NEAR = 4, 10.0
"""Part of the angles at which the programs of boxes stand, and the tolerances from which these stand at all."""
LOOKS, SAME = (0.0, 0.31, 0.67), 1e-6
"""Places at which a lead is looked at for whether anything asked changes, and the share that is no change."""
EXACT = 0.02
"""Of the tolerance, by which parts of a box may still be better."""


def solve_leads(problem: Problem) -> Result:
    """The best leads, and the unbalances with them, proven as far as boxes go."""
    search = _Search(problem)
    search.check_acts()
    root, first = search.box(search.model.lower, search.model.upper), search.first()
    if search.model.domains:
        return search.solved(root, first, problem.search.boxes_or(MOST_PROGRAMS), "leads", "second-order cones over")
    return search.solved(root, first, problem.search.boxes_or(MOST_BOXES), "leads", "local searches; lower bound on")


@dataclass(frozen=True, eq=False)
class _Box:
    """Leads between bounds, and what bounds the objective there."""

    lower: Array
    upper: Array
    bound: float
    at_middle: float
    side: int
    is_exact: bool

    @property
    def middle(self) -> Array:
        """Of its sides."""
        return np.asarray(0.5 * (self.lower + self.upper))


class _Search(HeldDesigns[_Box]):
    """Boxes of the leads of a problem."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.model = LedModel(problem)
        self.boxes = LeadBoxes(self.model)
        self.samples = max(problem.fidelity.samples // COARSE, 24) * COARSE

    def parts(self, box: _Box, value: float) -> Iterator[tuple[_Box | Over, HeldDesign | None]]:
        """Halves of a box, each with the best design at its middle where that may be better than a value."""
        for low, high in halves(Box(box.lower, box.upper, box.side)):
            half = self.box(low, high, box.bound, value)
            level = value * (1.0 - SHARE * self.problem.tolerance)
            is_worth = not isinstance(half, Over) and half.bound < value and half.at_middle < level
            yield half, self.at(0.5 * (low + high)) if is_worth else None

    def box(self, lower: Array, upper: Array, floor: float = 0.0, value: float = math.inf) -> _Box | Over:
        """The bound of a box, or that no design is allowed in it. Near a value the program stands at all angles."""
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        found = self._bound(middle, half, COARSE)
        if self.model.domains and value * (1.0 - NEAR * self.problem.tolerance) < found.value < value:
            found = self._bound(middle, half, 1)
        if math.isinf(found.value):
            self.told(found.broken)
            return EMPTY
        side = int(np.argmax(found.pull + 1e-12 * half))
        bound, room = max(found.value, floor), EXACT * self.problem.tolerance * found.at_middle
        return _Box(lower, upper, bound, found.at_middle, side, found.at_middle - bound <= room < math.inf)

    def _bound(self, middle: Array, half: Array, part: int) -> LeadBound:
        fine, norms = self.model.at(middle, self.samples, averaged=True)
        if not self.model.domains:
            return self._alone(middle, half, fine, norms)
        coarse, rough = self.model.at(middle, self.samples // part, averaged=True)
        solution = solve_cones(coarse)
        if solution.x is None:
            limits = solution.multipliers.limits
            found = self._excluded(middle, half, coarse, rough[len(coarse.terms) :], limits)
            # nothing is known of its halves yet, nor that designs in its middle are allowed
            return found or LeadBound(0.0, math.inf, half)
        bound = best_bound(fine, solution.x, on_grid(coarse, fine, solution.multipliers))
        return self.boxes.bound(middle, half, fine, norms, bound.multipliers)

    def _alone(self, middle: Array, half: Array, program: AffineProblem, norms: tuple[LedNorm, ...]) -> LeadBound:
        """Where nothing but leads is open: by the rows themselves."""
        none = tuple(np.zeros_like(norm.constant) for _, norm in program.limits)
        for k, (most, norm) in enumerate(program.limits):
            if norm.value(np.zeros(0)) > most * (1.0 + SLACK):
                only = tuple(norm.subgradient(np.zeros(0)) if j == k else z for j, z in enumerate(none))
                found = self._excluded(middle, half, program, norms[len(program.terms) :], only)
                if found is not None:
                    return found
        rows = tuple(norm.subgradient(np.zeros(0)) for _, norm in program.terms)
        return self.boxes.bound(middle, half, program, norms, Multipliers(rows, none))

    def _excluded(
        self, middle: Array, half: Array, program: AffineProblem, norms: tuple[LedNorm, ...], limits: tuple[Array, ...]
    ) -> LeadBound | None:  # fmt: skip
        """That no design in a box is allowed; None where these dual rows do not show it."""
        stripped = replace(program, terms=())
        found = self.boxes.bound(middle, half, stripped, norms, Multipliers((), limits))
        if not math.isinf(found.value):
            return None
        self.told([x.name for x, z in zip(self.problem.load_limits, limits, strict=True) if z.any()])
        return found

    def around(self, found: HeldDesign) -> _Box | Over:
        """Return a thin box around the leads of a design, and its bound."""
        return self.box(*thin(self.place(found), self.model.lower, self.model.upper), 0.0, found.value)

    # designs

    def check_acts(self) -> None:
        """Refuse a lead that nothing asked hangs on: each of its loads is the same, a little earlier."""
        lower, upper = self.model.lower, self.model.upper
        for k, decision in enumerate(self.model.leads if not self.model.domains else ()):
            here = np.arange(len(lower)) == k
            places = [np.where(here, lower + share * (upper - lower), self.model.start) for share in LOOKS]
            found = [self._numbers(place) for place in places]
            if np.ptp(found, axis=0).max() <= SAME * np.abs(found).max():
                why = "is open, and nothing that is asked depends on it; fix it, or ask for what shafts share"
                raise ModelError(f"{decision.name} {why}")

    def _numbers(self, leads: Array) -> Array:
        program, _ = self.model.at(leads, self.samples)
        norms = [norm.value(np.zeros(0)) for _, norm in (*program.terms, *program.limits)]
        return np.array([*norms, *self.boxes.numbers(leads)])

    def first(self) -> HeldDesign:
        """The design as given, and the best that searches find where leads alone are open."""
        found = [HeldDesign(judged(self.problem, self.problem.start))]
        if self.model.domains:
            found += [self.at(self.model.start), self.at(0.5 * (self.model.lower + self.model.upper))]
        else:
            ends = searched(self._penalised, self.model.lower, self.model.upper, GRID, MOST_STARTS, MOST_STEPS)
            found += [HeldDesign(judged(self.problem, each.tolist())) for each in ends]
        return min(found, key=lambda each: each.design.rank)

    def at(self, leads: Array) -> HeldDesign:
        """The best design with its leads given."""
        where: dict[str, Value] = {d.name: float(x) for d, x in zip(self.model.leads, leads, strict=True)}
        return best_with(self.problem, self._held(leads), where)

    def _held(self, leads: Array) -> Problem:
        """The problem with its leads given: what turns with them has turned."""
        by = dict(zip(self.model.names, leads - self.model.start, strict=True))
        shafts = {rotor.name: rotor.shaft for rotor in self.problem.engine.rotors}

        def turned(decision: Decision) -> Decision:
            drives = []
            for drive in decision.rotor_drives:
                shaft = shafts[drive.rotor]
                drives.append(replace(drive, gain=drive.gain * np.exp(1j * shaft.ratio * by.get(shaft.name, 0.0))))
            return replace(decision, drives=tuple(drives))

        engine = self.problem.design([float(x) for x in leads], self.model.leads)
        return replace(self.problem, engine=engine, decisions=tuple(turned(d) for d in self.problem.unbalances))

    def _penalised(self, leads: Array) -> float:
        """The objective, and what limits are broken by, many times over."""
        inside = np.clip(leads, self.model.lower, self.model.upper)
        program, _ = self.model.at(inside, self.samples)
        (swing, broken), x = self.boxes.degrees(inside, np.zeros_like(inside)), np.zeros(0)
        total = program.objective(x) + swing
        over = sum(max(norm.value(x) / (most or 1.0) - 1.0, 0.0) for most, norm in program.limits)
        over += sum(broken.values())
        return float(total * (1.0 + 1e3 * over) + over)
