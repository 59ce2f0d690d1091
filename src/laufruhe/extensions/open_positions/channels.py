"""Channels of distances between shafts, and of radii that shafts sweep, also for shafts that move in boxes.

Only limits may contain them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from laufruhe.machine import CRANKSHAFT, Engine, Role, Shaft
from laufruhe.problem.channels import Display, Need, NumberChannel
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery

Span = tuple[float, float]
SpanFunction = Callable[[MeasureQuery, Engine, Engine], Sequence[Span]]


@dataclass(frozen=True)
class _Swept:
    """A shaft, the radius that its weights or throws sweep [m], and whether it is a balancer shaft."""

    shaft: Shaft
    radius: float = 0.0
    balances: bool = False


def _shafts(engine: Engine) -> dict[str, _Swept]:
    turning = [(part.shaft, part.crank_radius, False) for part in engine.slider_cranks]
    turning += [(r.shaft, r.reach or r.radius or 0.0, r.role is Role.BALANCER) for r in engine.rotors]
    swept: dict[str, _Swept] = {}
    for shaft, radius, balances in turning:
        known = swept.get(shaft.name, _Swept(shaft))
        swept[shaft.name] = _Swept(shaft, max(radius, known.radius), balances or known.balances)
    return swept


def shafts_of(engine: Engine) -> tuple[str, ...]:
    """Return the names of all shafts; none without a balancer shaft."""
    shafts = _shafts(engine)
    return tuple(shafts) if any(shaft.balances for shaft in shafts.values()) else ()


def distances(names: Sequence[str] | None, lower: Engine, upper: Engine, swept: bool) -> list[Span]:
    """Return the smallest and largest distance of every two shaft axes, for positions between two engines [m].

    `names` selects shafts; a single one is paired with the crankshaft, and None selects all. At least one shaft of a
    pair is a balancer shaft. Optional shafts that the engines lack are left out. If `swept` is True, the radii that
    both shafts sweep are subtracted.
    """
    low, high = _shafts(lower), _shafts(upper)
    counted = low if names is None else (*names, CRANKSHAFT.name) if len(names) == 1 else names
    out = []
    for a, b in itertools.combinations((name for name in counted if name in low), 2):
        if low[a].balances or low[b].balances:
            taken = low[a].radius + low[b].radius if swept else 0.0
            minimum, maximum = _separation((low[a].shaft, low[b].shaft), (high[a].shaft, high[b].shaft))
            out.append((minimum - taken, maximum - taken))
    return out


def reaches(names: Sequence[str] | None, lower: Engine, upper: Engine) -> list[Span]:
    """Return the distance from the crank axis that each balancer shaft sweeps to [m], between two engines.

    Every item has the smallest and the largest distance for shaft positions between those of the engines. `names`
    selects shafts; None selects all.
    """
    low, high, origin = _shafts(lower), _shafts(upper), Shaft("origin")
    out = []
    for name in low if names is None else names:
        if name in low and low[name].balances:
            minimum, maximum = _separation((low[name].shaft, origin), (high[name].shaft, origin))
            out.append((minimum + low[name].radius, maximum + low[name].radius))
    return out


def _separation(lower: tuple[Shaft, Shaft], upper: tuple[Shaft, Shaft]) -> Span:
    (a, b), (c, d) = lower, upper
    spans = []
    for first_pair, second_pair in (((a.y, c.y), (b.y, d.y)), ((a.z, c.z), (b.z, d.z))):
        minimum, maximum = min(first_pair) - max(second_pair), max(first_pair) - min(second_pair)
        spans.append((max(minimum, -maximum, 0.0), max(abs(minimum), abs(maximum))))
    return math.hypot(spans[0][0], spans[1][0]), math.hypot(spans[0][1], spans[1][1])


_SHAFTS = Need(shafts_of, "balancer shafts, and this engine has none", "add one, or leave it out")


@dataclass(frozen=True, eq=False)
class ShaftChannel(NumberChannel):
    """Distance of shafts.

    Attributes
    ----------
    span
        Function of measure and two engines that returns (smallest, largest) values while the shafts move between their
        places in the two engines.
    """

    span: SpanFunction = field(kw_only=True)


def _channel(name: str, sides: tuple[str, ...], span: SpanFunction) -> ShaftChannel:
    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        return [lower for lower, _ in span(measure, evaluation.engine, evaluation.engine)]

    return ShaftChannel(
        name, "m", ("of",), _SHAFTS, sides, minimised=False, depends_on_loads=False, values=values, span=span,
        places=shafts_of, display=Display(place="shaft"),
    )  # fmt: skip


SHAFT_DISTANCE = _channel("shaft distance", ("min", "max"), lambda m, a, b: distances(m.rotors, a, b, False))
SHAFT_CLEARANCE = _channel("shaft clearance", ("min",), lambda m, a, b: distances(m.rotors, a, b, True))
ENVELOPE_RADIUS = _channel("envelope radius", ("max",), lambda m, a, b: reaches(m.rotors, a, b))
