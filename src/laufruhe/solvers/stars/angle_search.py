"""Branch and bound over an open bank or split-pin angle of a crank with one throw (S30)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.angle_waves import AngleWaves
from laufruhe.load_models.uneven_model import rides_of, rotor_states
from laufruhe.machine.firing_windows import SLACK, FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.problem.sets import Sector
from laufruhe.solvers.stars.design import StarDesign
from laufruhe.solvers.throws.boxes import ThrowPrograms
from laufruhe.solvers.throws.riders import Riders
from laufruhe.solvers.throws.search import Improve, Programs, Searched, ThrowSearch, found_by, knows, loss_of
from laufruhe.solvers.throws.windows import firing_of


@dataclass(frozen=True)
class _Open:
    """Which of the two angles is open, and its bounds [rad]."""

    of_bank: bool
    lower: float
    upper: float
    other: float

    def geometry(self, angle: float) -> tuple[float, float]:
        """Bank angle and split pins."""
        return (angle, self.other) if self.of_bank else (self.other, angle)


def search_angle(
    problem: Problem, phasing: Phasing, best: StarDesign | None, floor: float, improve: Improve
) -> Searched | None:
    """What no angle goes under, and the best that was found on the way; None where boxes say nothing (S30).

    Parameters
    ----------
    best
        The best design known.
    floor
        A bound that holds.
    improve
        Told of angles that look good.
    """
    own = _open_angle(phasing)
    if own is None or not knows(problem):
        return None
    windows = list(_windows(phasing, own))
    if not windows:
        return None if best is not None else Searched(math.inf, None, 0, ())
    try:
        search = _AngleSearch(problem, phasing, windows, improve, best)
    except ModelError:
        return None
    return found_by(search, problem, best, floor, "boxes of angles")


def _open_angle(phasing: Phasing) -> _Open | None:
    """The one angle that is open of a crank with one throw, where all else turns with it."""
    if phasing.bank is None or phasing.throws is not None or phasing.throw_bounds is not None:
        return None
    split = phasing.split or (0.0, 0.0)
    is_open = phasing.bank[0] < phasing.bank[1], split[0] < split[1]
    layout = phasing.layout(*phasing.least_geometry)
    if is_open[0] == is_open[1] or len(layout.throw_positions) != 1:
        return None
    if phasing.shafts.optional or not _turns_freely(phasing):
        return None
    (low, high), other = (phasing.bank, split[0]) if is_open[0] else (split, phasing.bank[0])
    own = _Open(is_open[0], low, high, other)
    # a share of what turns on offset pins knows how far they are apart
    ends = [
        phasing.realise(Candidate((0.0,), None, *own.geometry(angle), without_gas=True))
        for angle in (low, 0.5 * (low + high), high)
    ]
    return own if all(rotor_states(end) == rotor_states(ends[0]) for end in ends) else None


def _turns_freely(phasing: Phasing) -> bool:
    """Whether no unbalance knows where the crank stands when cylinder 1 fires: it turns with it, or may turn freely."""
    candidate = Candidate((0.0,), None, *phasing.least_geometry)
    rides = rides_of(phasing, candidate)
    problem = phasing.realise(replace(candidate, without_gas=True))
    free = [rotor.name for rotor in problem.engine.rotors if rotor.name not in rides]
    if any(rotor.unbalance for rotor in problem.engine.rotors if rotor.name in free):
        return False
    for decision in problem.unbalances:
        theirs = [drive for drive in decision.rotor_drives if drive.rotor in free]
        if theirs and (len(decision.rotor_drives) > 1 or not _is_disc(decision.set)):
            return False
    return True


def _is_disc(own: object) -> bool:
    return isinstance(own, Sector) and own.free_angle


def _windows(phasing: Phasing, own: _Open) -> Iterator[FiringWindow]:
    """Half angles between bounds for every whole turn by which cylinder 2 fires later."""
    allowed, whole = phasing.intervals, phasing.cycle.angle
    least, most = max(allowed.least, whole - allowed.most), min(allowed.most, whole - allowed.least)
    for order, first, last in (((1, 2), 0.0, math.tau), ((2, 1), whole - math.tau, whole)):
        if phasing.firing_order not in (None, order):
            continue
        # who comes second fires at its next dead centre
        soonest, latest = max(least, first), min(most, last)
        for lap in range(phasing.cycle.turns + 1):
            # the interval from cylinder 1 to cylinder 2 is 2 pi l less both angles
            low = max(own.lower, math.tau * lap - own.other - latest - SLACK)
            high = min(own.upper, math.tau * lap - own.other - soonest + SLACK)
            if low <= high:
                paths = np.array([[0.0, -0.5 * low], [0.5 * high, 0.0]])
                yield FiringWindow((), (0, lap), paths)


class _AngleSearch(ThrowSearch):
    """Boxes of the angle, for every whole turn by which cylinder 2 fires later."""

    # few boxes of one angle, so that steps may be many
    most_samples, steps_cost = 6144, 2e-5

    def _programs(self, windows: Sequence[FiringWindow], _left_out: tuple[str, ...]) -> Iterator[Programs]:
        own = _open_angle(self._phasing)
        assert own is not None
        for window in windows:
            candidate = self.candidate(window, 0.5 * (window.box[0] + window.box[1]))
            problem = replace(self._phasing.realise(candidate), phasing=None)
            riders = Riders(problem, {}, candidate.throws)
            waves = AngleWaves(riders.problem, self._phasing.layout_of(candidate), window.laps, own.of_bank)
            # all laps are in the waves
            yield partial(ThrowPrograms, waves, riders, firing_of(self._phasing)), loss_of(waves, problem), [window]

    def candidate(self, window: FiringWindow, throws: Array) -> Candidate:
        """A design at half of this angle, cylinder 1 at its dead centre when phi = 0."""
        own = _open_angle(self._phasing)
        assert own is not None
        geometry = own.geometry(float(np.clip(2.0 * throws[0], own.lower, own.upper)))
        layout = self._phasing.layout(*geometry)
        # who comes second fires at its next dead centre
        soon = math.tau * window.laps[1] - sum(geometry) <= math.tau + SLACK
        order = self._phasing.firing_order or ((1, 2) if soon else (2, 1))
        return Candidate(((layout.banks[0] - layout.pin_offsets[0]) % math.tau,), order, *geometry)
