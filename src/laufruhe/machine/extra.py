"""Parts that extensions add to an engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

from laufruhe.machine.scaling import scale_part
from laufruhe.machine.slider_crank import SliderCrank


class Extra:
    """A part that an extension adds to an engine; parts with equal numbers compare equal and have equal hashes.

    Attributes
    ----------
    name
        Name of the kind of decision that moves its numbers.
    """

    name: ClassVar[str]

    def moved(self, _: Mapping[Any, float], __: Sequence[SliderCrank], ___: Sequence[SliderCrank]) -> Self:
        """Return the part with changes of its numbers.

        The second and third arguments are the slider-cranks before and after the change.
        """
        return self

    def move(self, engine: Any, changes: Mapping[Any, float], before: Sequence[SliderCrank]) -> Any:
        """Return an engine in which its numbers have changed; `before` has the slider-cranks of the initial engine."""
        moved = self.moved(changes, before, engine.slider_cranks)
        return engine if moved is self else engine.with_extra(moved)

    def scaled(self, length: float, mass: float) -> Self:
        """Return the part of an engine whose lengths and masses are multiplied by these factors."""
        return scale_part(self, length, mass)

    def turning_inertia(self, _parts: Sequence[SliderCrank], /) -> float | None:
        """Return the inertia of all rotating parts except pistons and rods [kg m2]; None if it has none."""
        return None

    @property
    def labels(self) -> Sequence[str]:
        """Return the names that pictures may show."""
        return ()
