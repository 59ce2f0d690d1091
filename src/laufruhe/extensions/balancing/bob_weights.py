"""Bob weights: masses that stand for rods and pistons while a crankshaft is balanced, and their card (U1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from laufruhe.errors import counted
from laufruhe.machine import Engine
from laufruhe.machine.extra import Extra
from laufruhe.present.numbers import aligned, number, share
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result
from laufruhe.units import readable, readable_unbalance

ROTATING = ("big_end", "bearing_shells")
RECIPROCATING = ("piston", "pin", "rings", "locks", "small_end")
ENGINE_MASS = "reciprocating_mass"
CARD = "bob-weights"


@dataclass(frozen=True)
class BobWeights(Extra):
    """Masses of the parts on the throws.

    Attributes
    ----------
    factor
        Balance factor: share of the reciprocating masses.
    oil
        Mass of the oil in a throw [kg].
    parts
        Names of the weighed parts, each with its mass at every cylinder [kg].
    throws
        Cylinders of each crank pin, as indices from zero.
    throw_masses
        Cylinders of each throw of the engine, and its rotating mass without rods [kg].
    """

    name: ClassVar[str] = "bob weights"
    factor: float
    oil: float
    parts: tuple[tuple[str, tuple[float, ...]], ...]
    throws: tuple[tuple[int, ...], ...]
    throw_masses: tuple[tuple[tuple[int, ...], float], ...]
    powers: ClassVar = {"oil": (1, 0), "parts": (1, 0)}

    def scaled(self, length: float, mass: float) -> Self:
        """Return the parts with their masses multiplied by a factor."""
        throws = tuple((cylinders, mass * one) for cylinders, one in self.throw_masses)
        return replace(super().scaled(length, mass), throw_masses=throws)

    def shares(self, engine: Engine | None, pin: int) -> Mapping[str, tuple[float, float]]:
        """Return the mass of each part on a crank pin [kg], and the share of it that the bob weight has (U1).

        Without weighed pistons the engine has the reciprocating mass.
        """
        masses = {name: sum(masses[k] for k in self.throws[pin]) for name, masses in self.parts}
        if engine is not None and not masses.keys() & set(RECIPROCATING):
            masses[ENGINE_MASS] = sum(engine.slider_cranks[k].reciprocating_mass for k in self.throws[pin])
        shares = {name: (mass, 1.0 if name in ROTATING else self.factor) for name, mass in masses.items()}
        return {**shares, "oil": (self.oil, 1.0)}

    def mass(self, engine: Engine | None, pin: int) -> float:
        """Return the bob weight of a crank pin [kg] (U1)."""
        return sum(mass * part for mass, part in self.shares(engine, pin).values())


def card(engine: Engine | None, weights: BobWeights) -> Table:
    """Return the card of bob weights, with a column for every crank pin, or one for all if they are equal.

    Without an engine it has no unbalance, because the crank radius is not known.
    """
    throws = [weights.shares(engine, k) for k in range(len(weights.throws))]
    radii = [engine.slider_cranks[on_pin[0]].crank_radius if engine else 0.0 for on_pin in weights.throws]
    names = [", ".join(_rods(engine, on_pin)) for on_pin in weights.throws]
    if engine and all(pair == (throws[0], radii[0]) for pair in zip(throws, radii, strict=True)):
        names, throws, radii = [f"each of {counted(len(throws), 'crank pin')}"], throws[:1], radii[:1]
    columns = {name: [shares[name] for shares in throws] for name in throws[0]}
    totals = [weights.mass(engine, k) for k in range(len(throws))]
    unit, grams = readable("kg", "g")
    largest = grams * max(totals)
    rows = [
        [name.replace("_", " "), share(cells[0][1]), *(aligned(grams * m * part, largest) for m, part in cells)]
        for name, cells in columns.items()
        if any(mass for mass, _ in cells)
    ]
    rows.append(["bob weight", "", *(aligned(grams * mass, largest) for mass in totals)])
    note = (
        "On a crank pin, all rods of the pin counted: rotating masses and oil in full, reciprocating masses with "
        "the balance factor."
    )
    if engine is None and len(weights.throws[0]) == 1:
        note += " One rod is on the pin; for two rods write a mass m of each as [m, m]."
    if engine:
        unbalances = [m * r for m, r in zip(totals, radii, strict=True)]
        unbalance, size = readable_unbalance(max(unbalances))
        cells = [number(size * one, 5) for one in unbalances]
        rows.append([f"unbalance [{unbalance}]", "", *cells])
        note += f" The unbalance is that at the crank radius.{_difference(engine, weights)}"
    return Table((f"part [{unit}]", "share", *names), rows, title="Bob weights", note=note, file=CARD)


def _rods(engine: Engine | None, on_pin: Sequence[int]) -> list[str]:
    return [engine.slider_cranks[k].name if engine else f"rod {k + 1}" for k in on_pin]


def _difference(engine: Engine, weights: BobWeights) -> str:
    """Return a sentence on weighed parts whose mass is not that of the engine; empty if it has none of its own.

    The rotating mass of the engine includes that of the crank pin, so the weighed parts may have less.
    """
    cranks = engine.slider_cranks
    groups: list[tuple[str, tuple[str, ...], tuple[int, ...], float]] = [
        *(("reciprocating", RECIPROCATING, (k,), part.reciprocating_mass) for k, part in enumerate(cranks)),
        *(("rotating", ROTATING, on_throw, mass + sum(cranks[k].rotating_mass for k in on_throw))
          for on_throw, mass in weights.throw_masses),
    ]  # fmt: skip
    rows = []
    for kind, names, cylinders, mass in groups:
        weighed = [sum(masses[k] for k in cylinders) for name, masses in weights.parts if name in names]
        if weighed:
            rows.append((kind, ", ".join(cranks[k].name for k in cylinders), sum(weighed), mass))
    wrong = [
        row for row in rows
        if row[2] - row[3] > 1e-4 * row[2] or (row[0] == "reciprocating" and row[3] - row[2] > 1e-4 * row[3])
    ]  # fmt: skip
    if not wrong:
        is_weighed = any(kind == "reciprocating" for kind, *_ in rows)
        return " The reciprocating parts have the mass of [engine]." * is_weighed
    unit, grams = readable("kg", "g")
    kind, where, total, mass = max(wrong, key=lambda row: abs(row[2] - row[3]))
    return (
        f" The {kind} parts of {where} have {number(grams * total, 5)} {unit}, but [engine] has "
        f"{number(grams * mass, 5)} {unit}: loads and weights follow [engine]."
    )


def record(engine: Engine | None, weights: BobWeights) -> Mapping[str, Any]:
    """Return the bob weights for JSON [kg]."""
    return {
        "balance_factor": weights.factor,
        "throws": [
            {"cylinders": _rods(engine, on_pin), "bob_weight": weights.mass(engine, k),
             "parts": {name: {"mass": mass, "share": part} for name, (mass, part) in weights.shares(engine, k).items()}}
            for k, on_pin in enumerate(weights.throws)
        ],
    }  # fmt: skip


def _weights(result: Result) -> BobWeights:
    weights = result.final.engine.extra(BobWeights)
    assert weights is not None
    return weights


SECTION = Section(
    "bob_weights",
    lambda result: result.final.engine.extra(BobWeights) is not None,
    lambda result: [card(result.final.engine, _weights(result))],
    lambda result: record(result.final.engine, _weights(result)),
    (CARD,),
)
