"""Price of the parts of an engine, a number that may be minimised or limited."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from laufruhe.machine import Engine
from laufruhe.machine.extra import Extra
from laufruhe.problem.channels import Need, NumberChannel


@dataclass(frozen=True)
class PartsPrice(Extra):
    """Price of the parts, in the currency of the lists."""

    total: float
    name: ClassVar[str] = "parts_price"

    def scaled(self, _length: float, _mass: float) -> Self:
        """Return the same price, which does not follow the size of the engine."""
        return self


def price_of(engine: Engine) -> float:
    """Return the price of the parts of an engine; zero if none is known."""
    price = engine.extra(PartsPrice)
    return price.total if price is not None else 0.0


PARTS_PRICE = NumberChannel(
    "parts price", "", (),
    Need(lambda engine: engine.extra(PartsPrice), "the price of its parts", "add [parts_price] with total"),
    ("max",), True, depends_on_loads=False, values=lambda _, design: (price_of(design.engine),), size_value=price_of,
)  # fmt: skip
