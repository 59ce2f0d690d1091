"""Firing orders that do not fit their crank: the cylinders at fault, and the numbering that is probably meant."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeAlias

from laufruhe.errors import Complaint
from laufruhe.files.complaints import Refused, value_text
from laufruhe.files.engine import EngineTable, cycle_of, idle_cylinders, layout_of, moving_parts
from laufruhe.files.numbering import ALTERNATING, BY_BANK, KEYS, USUAL, place_order
from laufruhe.files.toml_text import toml_value
from laufruhe.machine import Cycle, SliderCrank
from laufruhe.machine.crank_names import name_of_crank
from laufruhe.machine.firing import from_one, intervals_of
from laufruhe.numerics.exact_angles import Turn, as_turn, reduced_turn
from laufruhe.problem.advice import Advice
from laufruhe.problem.problem import Problem

Pair: TypeAlias = tuple[int, int]
_WHERE = "engine.firing_order"
# smallest difference of intervals that counts [rad], and largest difference of typed angles that does not [turns]
_CLEAR, _SAME = math.radians(1.0), 1e-4
_NUMBERINGS: tuple[Mapping[str, Any], ...] = tuple(
    {key: value for key, value in zip(KEYS, (scheme, bank, end), strict=False) if value is not None}
    for end in (None, "flywheel")
    for scheme, bank in ((ALTERNATING, None), (None, "right"), (ALTERNATING, "right"), (None, None))
)


@dataclass(frozen=True)
class _Fit:
    """Order of a table that its crank allows, with the slider-cranks of its cylinders."""

    table: EngineTable
    parts: Sequence[SliderCrank]

    @cached_property
    def intervals(self) -> tuple[float, ...]:
        """Firing intervals from cylinder 1 [rad]."""
        cycle, start = cycle_of(self.table), as_turn(self.parts[0].firing_angle)
        turns = (reduced_turn(as_turn(part.firing_angle) - start, cycle.turns) for part in self.parts)
        return intervals_of(cycle, sorted(map(float, turns)))

    @cached_property
    def spread(self) -> float:
        """Difference between the longest and the shortest interval [rad]."""
        return max(self.intervals) - min(self.intervals)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """Pairs of cylinders that should be in step but are not: opposed ones, or those at equal ends of a row."""
        kind, parts = self.table.kind, self.parts
        if kind.cylinders_per_throw > 1 or kind.banks > 2:
            return ()
        from_front = sorted(range(len(parts)), key=lambda k: -parts[k].x)
        sides = [[k for k in from_front if parts[k].bank == bank] for bank in dict.fromkeys(p.bank for p in parts)]
        if len(sides) == kind.banks == 2:
            due = sorted(zip(*sides, strict=True))
        elif len(sides) == 1 and self.table.throws is None and cycle_of(self.table) is Cycle.FOUR_STROKE:
            row = sides[0] if len(parts) % 2 == 0 else []
            due = list(zip(row[: len(row) // 2], row[::-1], strict=False))
        else:
            return ()
        return tuple((a, b) for a, b in due if not _is_whole(parts[a].star_turn - parts[b].star_turn))


def _remedied(table: EngineTable, complaint: Complaint) -> Complaint:
    order = table.listed_order
    is_order = complaint.where == _WHERE and table.kind.takes("numbering") and not table.firing_intervals
    if order is None or not is_order or sorted(order) != list(range(1, len(order) + 1)):
        return complaint
    fault = _fault(table, order)
    return Complaint(_WHERE, value_text(order), fault, _remedy(table, order)) if fault else complaint


def _warnings(table: EngineTable, problem: Problem) -> tuple[Complaint, ...]:
    """Return a warning about a firing order that its crank allows, but that other numbers of the cylinders explain."""
    if problem.phasing is not None:
        return ()
    order, parts = table.listed_order, problem.engine.slider_cranks
    is_usual = order is not None and len(order) >= 3 and table.kind.takes("numbering") and not idle_cylinders(table)
    if order is None or not is_usual or table.firing_intervals:
        return ()
    fit = _Fit(table, parts[: len(order)])
    if fit.pairs and table.kind.banks > 1:
        rule = f"moves opposed pistons in one direction, not against each other: cylinders {_pairs(fit.pairs)}"
        return (Complaint(_WHERE, _text(order), rule, _remedy(table, order)),)
    if fit.pairs:
        rule = f"makes a crank that differs from its mirror image: cylinders {_pairs(fit.pairs)} are not in step"
        return (Complaint(_WHERE, _text(order), rule, _exchange(table, order)),)
    is_stated = any(table.value_of(key) is not None for key in KEYS if table.kind.takes(key))
    # nothing is more even than even firing
    reading = None if is_stated or table.throws is None or fit.spread < _CLEAR else _reading(table)
    if reading is None or reading[1].spread > fit.spread - _CLEAR:
        return ()
    now, then = _degrees(fit.intervals), _degrees(reading[1].intervals)
    rule = f"fires after {now} deg, and in another numbering after {then} deg"
    keep = f'if the numbers are meant as they are, write numbering = "{BY_BANK}"'
    return (Complaint(_WHERE, _text(order), rule, f"{_advice(table, order, reading[0])}; {keep}"),)


def _fault(table: EngineTable, order: Sequence[int]) -> str:
    """Return the rule that a refused order breaks, with the cylinders at fault; empty if it is off by rounding."""
    layout, cycle = layout_of(table), cycle_of(table)
    step = Fraction(cycle.turns, len(order))
    fires = {number: place * step for place, number in enumerate(order)}
    throws = table.listed_throws or layout.throws
    if throws is not None:
        first = layout.dead_centre(throws, order[0] - 1)
        late = {n: _turned(layout.dead_centre(throws, n - 1) - first - turn) for n, turn in fires.items()}
        far = {n: turn for n, turn in late.items() if 2.0 * abs(turn) > step} or late
        named = ", ".join(f"{n} ({360.0 * turn:+.4g} deg)" for n, turn in far.items() if abs(turn) > _SAME)
        return f"does not fit the throws: if it is to fire evenly, cylinders {named} are out of place" if named else ""
    faults = []
    for pin in range(len(layout.throw_positions)):
        first_one, *others = (k for k, own_pin in enumerate(layout.pins) if own_pin == pin)
        for k in others:
            due = layout.dead_centre_turn(k) - layout.dead_centre_turn(first_one)
            distance = fires[k + 1] - fires[first_one + 1]
            if not _is_whole(distance - due):
                faults.append(f"{first_one + 1} and {k + 1} ({_degree(distance % 1)}, not {_degree(due % 1)} deg)")
    return f"cannot be even: cylinders {', '.join(faults)} are out of place for their common throw" if faults else ""


def _remedy(table: EngineTable, order: Sequence[int]) -> str:
    reading = _reading(table)
    return _exchange(table, order) if reading is None else _advice(table, order, reading[0])


def _advice(table: EngineTable, order: Sequence[int], keys: Mapping[str, Any]) -> str:
    """Return the keys of a numbering that fits, and the order in the present numbers."""
    degrees = [round(math.degrees(angle), 6) % 360.0 for angle in keys.get("throws", ())]
    angles = [int(angle) if angle.is_integer() else angle for angle in degrees]
    is_list = isinstance(keys.get("numbering"), list)
    written = [f"{key} = {toml_value(value)}" for key, value in _changed_keys(table, keys).items()]
    written += [f"throws = {toml_value(angles)}"] if angles else []
    if "split_pin_angle" in keys:
        written.append(f"split_pin_angle = {math.degrees(keys['split_pin_angle']):.6g}")
        if len(written) == 1:
            return f"if its pins are split, write {written[0]}; if it fires unevenly, list firing_intervals"
    if keys.keys() == {"throws"}:
        return f"if the angles of the throws count against the rotation, write {written[-1]}"
    gone = [key for key in ("first_bank", "first_end") if is_list and table.value_of(key)]
    written_text = ", ".join(written) + (f" without {' and '.join(gone)}" if gone else "")
    now, then = (place_order(t, t.kind, len(order)) for t in (table, _renumbered(table, keys)))
    here = from_one([1 + now.index(then[number - 1]) for number in order])
    return f"if these are its maker's numbers, write {written_text}; in the present numbers the order is {_text(here)}"


def _changed_keys(table: EngineTable, keys: Mapping[str, Any]) -> dict[str, Any]:
    # keys of numbers that differ from those of the table; a list of numbers replaces the others
    names = keys if isinstance(keys.get("numbering"), list) else filter(table.kind.takes, USUAL)
    numbers = {key: keys.get(key, USUAL[key]) for key in names if key in USUAL}
    return {key: value for key, value in numbers.items() if value != (table.value_of(key) or USUAL[key])}


def _exchange(table: EngineTable, order: Sequence[int]) -> str:
    # an exchange of two cylinders may make it fit
    for a, b in itertools.combinations(order[1:], 2):
        changed = [b if n == a else a if n == b else n for n in order]
        fit = _fit(table.model_copy(update={"firing_order": changed}))
        if fit is not None and not fit.pairs and fit.spread < _CLEAR:
            return f"check the order; with {a} and {b} exchanged it fits: {_text(changed)}"
    crank = _other_crank(table)
    other = f"; it fits a {crank} crank: if that is meant, leave out throws" if crank else ""
    return f"check the order, which no usual numbering makes fit{other}"


def _other_crank(table: EngineTable) -> str:
    # name of the crank on which the order fires evenly; empty if it has none
    free = table.model_copy(update={"throws": None})
    if table.throws is None or (fit := _fit(free)) is None or fit.pairs:
        return ""
    layout = layout_of(free)
    return name_of_crank([fit.parts[layout.pins.index(pin)].throw for pin in range(len(layout.throw_positions))])


def _reading(table: EngineTable) -> tuple[Mapping[str, Any], _Fit] | None:
    # keys of [engine] with which the order fires most evenly
    fits = [(keys, _fit(_renumbered(table, keys))) for keys in _readings(table)]
    fitting = [(keys, fit) for keys, fit in fits if fit is not None and not fit.pairs]
    return min(fitting, key=lambda pair: round(pair[1].spread, 6), default=None)


def _readings(table: EngineTable) -> Iterator[Mapping[str, Any]]:
    """Yield the keys of usual numberings, smallest change first, also with throws that count the other way."""
    kind, count = table.kind, len(table.listed_order or [])
    possible = {key for key in KEYS if kind.takes(key) and (key != "numbering" or kind.banks > 1)}
    numberings = [keys for keys in _NUMBERINGS if keys.keys() <= possible]
    numberings.sort(key=lambda keys: len(_changed_keys(table, keys)))
    if kind.banks == kind.cylinders_per_throw == 2:
        near, far = list(range(1, count // 2 + 1)), list(range(count, count // 2, -1))
        numberings += [{"numbering": numbers} for numbers in (near + far, far + near)]
    if table.listed_throws is None:
        yield from numberings
        # pins split by a small angle against the bank angle are the most usual
        splits = [{**keys, **_split(_renumbered(table, keys))} for keys in ({}, *numberings)]
        angles = [round(keys.get("split_pin_angle", math.pi), 9) for keys in splits]
        order = sorted(range(len(splits)), key=lambda k: (abs(angles[k]), -angles[k]))
        yield from (splits[k] for k in order if "split_pin_angle" in splits[k])
        return
    reversed_throws = {"throws": [-angle % math.tau for angle in table.listed_throws]}
    # of engines with one bank the sense of the throws is less certain than the numbers
    yield from (reversed_throws, *numberings) if kind.banks == 1 else (*numberings, reversed_throws)
    yield from ({**keys, **reversed_throws} for keys in numberings)


def _split(table: EngineTable) -> Mapping[str, float]:
    # the pins let the first two cylinders on one throw fire in their turn
    if not table.kind.takes("split_pin_angle") or table.value_of("split_pin_angle"):
        return {}
    layout, cycle, order = layout_of(table), cycle_of(table), table.listed_order or []
    left, right = sorted(layout.on_throw(0), key=lambda k: -layout.side(k))
    later = Fraction((order.index(right + 1) - order.index(left + 1)) * cycle.turns, len(order))
    return {
        "split_pin_angle": math.tau * _turned(layout.dead_centre_turn(right) - layout.dead_centre_turn(left) - later)
    }


def _renumbered(table: EngineTable, keys: Mapping[str, Any]) -> EngineTable:
    return table.model_copy(update={**dict.fromkeys(key for key in KEYS[:-1] if table.kind.takes(key)), **keys})


def _fit(table: EngineTable) -> _Fit | None:
    # none if the crank does not allow the order
    try:
        return _Fit(table, moving_parts(table, gas=False)[0][: len(table.listed_order or ())])
    except Refused:
        return None


def _is_whole(turn: Turn) -> bool:
    return abs(_turned(turn)) < _SAME


def _turned(turn: Turn) -> float:
    # between -1/2 and 1/2
    return math.remainder(float(turn), 1.0)


def _degree(turn: Turn) -> str:
    return f"{360.0 * float(turn):.5g}"


def _degrees(angles: Iterable[float]) -> str:
    return ", ".join(f"{math.degrees(angle):.5g}" for angle in angles)


def _pairs(pairs: Iterable[Pair]) -> str:
    return ", ".join(f"{a + 1} and {b + 1}" for a, b in pairs)


def _text(order: Iterable[int]) -> str:
    return "-".join(map(str, order))


ADVICE = Advice("firing orders", about_file=_warnings, remedied=_remedied)
