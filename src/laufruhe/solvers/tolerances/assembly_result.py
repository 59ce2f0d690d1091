"""Which measured part goes into which cylinder, and what choosing buys."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from laufruhe.solvers.result import Details


@dataclass(frozen=True)
class Place:
    """One cylinder.

    Attributes
    ----------
    parts
        Of every lot the number of the part in the order of its file, from one.
    masses
        Of each what goes to and fro, and what turns with the pin [kg].
    """

    cylinder: str
    parts: tuple[int, ...]
    masses: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class AssemblyResult(Details):
    """The best assembly beside others [SI].

    Attributes
    ----------
    kinds
        Of the lots.
    assemblies
        That there are in all.
    looked_at
        Parts of them that were bounded.
    quantiles
        Of assemblies at random.
    worst
        Of these.
    mean_parts
        The objective if every part had the mean mass of its lot.
    """

    kinds: tuple[str, ...]
    places: tuple[Place, ...]
    assemblies: float
    looked_at: int
    quantiles: tuple[float, ...]
    worst: float
    mean_parts: float
    random: int

    def record(self) -> dict[str, Any]:
        """Return `assembly`: the part of every lot in each cylinder, counted from one."""
        told = {name: getattr(self, name) for name in ["assemblies", "looked_at", "random", "worst", "mean_parts"]}
        places = [{"cylinder": one.cylinder, **dict(zip(self.kinds, one.parts, strict=True))} for one in self.places]
        return {"assembly": {**told, "quantiles": list(self.quantiles), "places": places}}
