"""Pressures between the stages of a compressor at which each takes in what the stages before it deliver (G17c)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from laufruhe.extensions.chambers.gas import Chambers, Compressor, suction_point
from laufruhe.machine import GasModel
from laufruhe.present.numbers import share, trimmed
from laufruhe.problem.advice import Advice
from laufruhe.problem.problem import Problem

MAX_SWEEPS, CLOSE = 200, 1e-10
"""Largest number of sweeps over the pressures between stages, and relative change that ends them."""
_EXCESS = 0.005
"""Largest relative difference between delivery and intake of two stages that needs no sentence."""
SAME = 1e-6
"""Relative difference below which two pressures are equal."""


@dataclass(frozen=True)
class Stage:
    """Compressor stage: name, swept volume a turn [m3], absolute pressures [Pa], clearance and exponent."""

    name: str
    volume: float
    suction: float
    delivery: float
    clearance: float
    exponent: float

    @property
    def intake(self) -> float:
        """Volume taken in a turn, at suction pressure [m3]."""
        begin = suction_point(self.suction / self.delivery, self.clearance, self.exponent)
        return max(1.0 - begin, 0.0) * self.volume

    @property
    def amount(self) -> float:
        """Suction pressure times the volume taken in a turn [J]; at equal temperature it stands for the mass."""
        return self.suction * self.intake


@dataclass(frozen=True)
class Link:
    """Stages that deliver into a common pressure [Pa], and stages that take in from it."""

    pressure: float
    before: tuple[Stage, ...]
    after: tuple[Stage, ...]

    @property
    def excess(self) -> float:
        """Amount delivered over the amount taken in, less one."""
        return sum(stage.amount for stage in self.before) / sum(stage.amount for stage in self.after) - 1.0

    def at(self, pressure: float) -> Link:
        """Return the link at another pressure."""
        before = tuple(replace(stage, delivery=pressure) for stage in self.before)
        return Link(pressure, before, tuple(replace(stage, suction=pressure) for stage in self.after))


def links_of(stages: Sequence[Stage]) -> list[Link]:
    """Return the links between stages, in the order of their pressures."""
    links = list[Link]()
    for pressure in sorted(stage.suction for stage in stages):
        before = tuple(stage for stage in stages if math.isclose(stage.delivery, pressure, rel_tol=SAME))
        after = tuple(stage for stage in stages if math.isclose(stage.suction, pressure, rel_tol=SAME))
        if before and not any(after[0] in link.after for link in links):
            links.append(Link(pressure, before, after))
    return links


def matched_pressures(stages: Sequence[Stage]) -> list[float] | None:
    """Return the pressure of each link at which no link has an excess (G17c), None if there is none.

    A sweep solves one link after the other. A link delivers less and takes in more the higher its pressure is.
    """
    links = links_of(stages)
    for _ in range(MAX_SWEEPS):
        change = 0.0
        for k in range(len(links)):
            link = links[k]
            pressure = _matched(link)
            if pressure is None:
                return None
            change = max(change, abs(pressure / link.pressure - 1.0))
            moved = link.at(pressure)
            new = dict(zip((*link.before, *link.after), (*moved.before, *moved.after), strict=True))
            links = [
                Link(old.pressure, tuple(new.get(s, s) for s in old.before), tuple(new.get(s, s) for s in old.after))
                for old in links
            ]
            links[k] = moved
        if change <= CLOSE:
            return [link.pressure for link in links]
    return None


def _matched(link: Link) -> float | None:
    # imported late, as it takes longer than a check
    from scipy.optimize import brentq

    lower, upper = max(stage.suction for stage in link.before), min(stage.delivery for stage in link.after)

    def difference(pressure: float) -> float:
        moved = link.at(pressure)
        return sum(stage.amount for stage in moved.before) - sum(stage.amount for stage in moved.after)

    if not lower < upper or difference(lower) <= 0.0 or difference(upper) >= 0.0:
        return None
    return float(brentq(difference, lower, upper, xtol=1e-9 * lower))


def _sentences(problem: Problem) -> list[str]:
    gases = dict.fromkeys(problem.fidelity.gas_of(point) for point in problem.points)
    return [sentence for gas in gases if gas for sentence in _of_gas(problem, gas)]


def _of_gas(problem: Problem, gas: GasModel) -> list[str]:
    """Return what each stage takes in, and what one delivers more or less than the next takes in."""
    models = (model for model in gas.models if isinstance(model, Chambers))
    chambers = [(chamber, chamber.diagram) for model in models for chamber in model.chambers]
    stages = [
        Stage(
            chamber.name, chamber.swept_volume(problem.engine.slider_cranks), diagram.back_pressure, diagram.admission,
            diagram.clearance, diagram.exponent,
        )
        for chamber, diagram in chambers
        if isinstance(diagram, Compressor)
    ]  # fmt: skip
    sentences = [
        f"{stage.name} takes in {share(stage.intake / stage.volume)} of the volume of its stroke, "
        f"{trimmed(1e3 * stage.intake)} l a turn at {trimmed(1e-5 * stage.suction)} bar "
        f"(pressure times volume: {trimmed(1e-2 * stage.amount)} bar l)."
        for stage in stages
    ]
    links = links_of(stages)
    uneven = [k for k, link in enumerate(links) if abs(link.excess) > _EXCESS]
    matched = matched_pressures(stages) if uneven else None
    for k in uneven:
        link = links[k]
        more = "more" if link.excess > 0.0 else "less"
        remedy = "no pressure between the stages makes both equal" if matched is None else (
            f"at {trimmed(1e-5 * matched[k])} bar both are equal" + " with the others matched too" * (len(links) > 1)
        )  # fmt: skip
        sentences.append(
            f"{_names(link.before)} delivers {share(abs(link.excess))} {more} than {_names(link.after)} takes in at "
            f"{trimmed(1e-5 * link.pressure)} bar, if the gas is cooled to the inlet temperature; {remedy}."
        )
    return sentences


def _names(stages: Sequence[Stage]) -> str:
    return " with ".join(stage.name for stage in stages)


ADVICE = Advice("compressor stages", about_gas=_sentences)
