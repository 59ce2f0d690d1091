"""Natural modes of the crankshaft's twist, the speeds at which orders meet them, and speeds that are barred."""

from __future__ import annotations

from laufruhe.errors import counted
from laufruhe.physics.torsion import chain_of
from laufruhe.present.measures import changed
from laufruhe.present.numbers import DASH, RPM, number
from laufruhe.present.torsion import TorsionFacts, barred_ranges, facts_of, is_twisted, speed_range
from laufruhe.report.grid import Grid
from laufruhe.solvers.result import Result

MOST_MODES, MOST_CRITICALS = 4, 8


def tables(result: Result) -> list[Grid]:
    """Modes, the critical speeds that twist it most, before and after, and barred ranges."""
    if not is_twisted(result):
        return []
    reach = speed_range(result)
    before, after = facts_of(result.initial, *reach), facts_of(result.final, *reach)
    criticals = [_criticals(before, "as given"), *([_criticals(after, "as decided")] if changed(result) else [])]
    return [_modes(result, after), *criticals, _barred(result)]


def _modes(result: Result, facts: TorsionFacts) -> Grid:
    names = [disc.name for disc in chain_of(result.final.engine).discs]
    shown = range(min(MOST_MODES, len(facts.modes.frequencies)))
    swings = [[f"{swing:+.3f}" for swing in shape] for shape in facts.modes.shapes.T]
    rows = tuple((f"{m + 1}", number(float(facts.modes.frequencies[m])), *swings[m]) for m in shown)
    rest = len(facts.modes.frequencies) - len(shown)
    more = f" {counted(rest, 'higher mode')} in result.json." if rest else ""
    note = f"Undamped. Angle of every disc, the largest of each mode one.{more}"
    return Grid("Natural modes of the crankshaft", ("mode", "Hz", *names), rows, note=note, sheet="crankshaft-modes")


def _criticals(facts: TorsionFacts, which: str) -> Grid:
    rows = tuple(
        (number(each.speed * RPM), f"{each.order:g}" + (" main" if each.is_main else ""), f"{each.mode}",
         number(each.vector_sum, 3, 1.0), DASH if each.torque is None else number(each.torque))
        for each in facts.criticals[:MOST_CRITICALS]
    )  # fmt: skip
    main = ", ".join(f"{order:g}" for order in facts.main)
    note = (
        f"The {len(rows)} that twist it most of {len(facts.criticals)} in the range looked at. Vector sum: swings "
        f"of the throws, each when its cylinder fires, added up. Main orders ({main}) have the same for every firing "
        "order. Torque: amplitude of that order in the section that it loads most."
    )
    head = ("rpm", "order", "mode", "vector sum", "torque [N m]")
    sheet = f"strongest-critical-speeds-{which.replace(' ', '-')}"
    return Grid(f"Critical speeds of the crankshaft {which}", head, rows, note=note, sheet=sheet)


def _barred(result: Result) -> Grid:
    rows = tuple(
        (each.limit, f"{number(each.lowest * RPM)} to {number(each.highest * RPM)}")
        for each in barred_ranges(result, result.final)
    )
    low, high = (number(speed * RPM) for speed in speed_range(result))
    note = f"Between {low} and {high} rpm, with the load of the operating points: where the limit would be exceeded."
    return Grid("Barred speed ranges", ("limit", "rpm"), rows, note=note, sheet="barred-speeds")
