"""Parts that extensions add to an engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Self

from laufruhe.machine.scaling import scale_part
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.spectrum import Spectrum


@dataclass(frozen=True, eq=False)
class MachineTorque:
    """Torque of a machine that is coupled to the crank, over the crank angle (T16).

    Attributes
    ----------
    on_crank
        Torque reduced to the crank, positive if it drives, shape (n,) [N m].
    on_block
        Roll moment on the block, shape (n,) [N m].
    disc
        Disc of the crankshaft on which it acts; empty for the disc of the load.
    """

    on_crank: Spectrum
    on_block: Spectrum
    disc: str = ""


class Extra:
    """A part that an extension adds to an engine; parts with equal numbers compare equal and have equal hashes.

    Attributes
    ----------
    name
        Name of the kind of decision that moves its numbers.
    """

    name: ClassVar[str]

    def moved(self, _: Mapping[Any, Any], __: Sequence[SliderCrank], ___: Sequence[SliderCrank]) -> Self:
        """Return the part with changes of its numbers.

        The second and third arguments are the slider-cranks before and after the change.
        """
        return self

    def move(self, engine: Any, changes: Mapping[Any, Any], before: Sequence[SliderCrank]) -> Any:
        """Return an engine in which its numbers have changed; `before` has the slider-cranks of the initial engine."""
        moved = self.moved(changes, before, engine.slider_cranks)
        return engine if moved is self else engine.with_extra(moved)

    def scaled(self, length: float, mass: float) -> Self:
        """Return the part of an engine whose lengths and masses are multiplied by these factors."""
        return scale_part(self, length, mass)

    def turning_inertia(self, _parts: Sequence[SliderCrank], /) -> float | None:
        """Return the inertia of all rotating parts except pistons and rods [kg m2]; None if it has none."""
        return None

    def torques(self, _point: str, _base: Fraction, /) -> Sequence[MachineTorque]:
        """Return the torques of its machines at an operating point, by its name and the lowest order of loads."""
        return ()

    def only(self, _: Mapping[Any, complex], /) -> Self:
        """Return the part whose loads are these changes of its numbers alone."""
        return self

    def critical_frequencies(self, _engine: Any, /) -> Mapping[str, Sequence[float]]:
        """Return the frequencies at which its response may have a peak or a jump [Hz], by what they are."""
        return {}

    @property
    def supports(self) -> Mapping[str, Sequence[float]]:
        """Positions along x at which it supports shafts of the engine [m], in order, by the name of the shaft."""
        return {}

    @property
    def labels(self) -> Sequence[str]:
        """Return the names that pictures may show."""
        return ()
