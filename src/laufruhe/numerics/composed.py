"""Signals that are sampled otherwise than by their own coefficients, which are worked out when they are asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.corners import Corners
from laufruhe.numerics.spectrum import Spectrum, T


class Composed(Spectrum):
    """A signal made of others, which are changed in its place."""

    @cached_property
    def whole(self) -> Spectrum:
        """The same by its own coefficients."""
        raise NotImplementedError

    @property
    def coefficients(self) -> NDArray[np.complex128]:
        """Of the whole."""
        return self.whole.coefficients

    @property
    def corners(self) -> Corners | None:
        """Of the whole."""
        return self.whole.corners

    def __reduce__(self) -> tuple[Any, ...]:
        return Spectrum, (self.base, self.coefficients, self.corners)


class Mapped(Composed):
    """A signal through a real linear map that gives it more components than it has: the few are sampled, then mapped.

    Attributes
    ----------
    source, linear
        The signal, and the map as a function of arrays (n, ...).
    """

    source: Spectrum
    linear: Callable[[NDArray[Any]], NDArray[Any]]

    def __init__(self, source: Spectrum, linear: Callable[[NDArray[Any]], NDArray[Any]]) -> None:
        vars(self).update(base=source.base, source=source, linear=linear)

    @cached_property
    def whole(self) -> Spectrum:
        """Each coefficient mapped."""
        return self.source.each(self.linear)

    @property
    def step(self) -> int:
        """That of its source: what a map leaves of it repeats as often."""
        return self.source.step

    def repeats(self, also: tuple[Fraction, ...] = ()) -> Fraction:
        """As its source."""
        return self.source.repeats(also)

    @property
    def series(self) -> Spectrum:
        """Its orders alone."""
        found = self.source.series
        return self if found is self.source else Mapped(found, self.linear)

    @property
    def without_mean(self) -> Spectrum:
        """The signal less its mean over the period."""
        return Mapped(self.source.without_mean, self.linear)

    def over(self, base: Fraction) -> Spectrum:
        """Its source over another period."""
        return Mapped(self.source.over(base), self.linear)

    def sample(self, samples: int, behind: float = 0.0) -> NDArray[np.float64]:
        """Return samples of its source, mapped."""
        return self.linear(self.source.sample(samples, behind))


_NEVER = object()


class Held(Spectrum):
    """A signal that many others have a part in."""

    @cached_property
    def _last(self) -> dict[str, tuple[Any, Any]]:
        return {}

    def once(self, what: str, asked: Any, made: Callable[[Spectrum], T]) -> T:
        """What is made of it; kept until something else is asked for by the same name."""
        known, found = self._last.get(what, (_NEVER, None))
        if known is not asked and known != asked:
            found = made(self)
            self._last[what] = asked, found
        return cast(T, found)

    @cached_property
    def series(self) -> Spectrum:
        """Its orders alone."""
        return self if self.corners is None else held(super().series)

    @cached_property
    def without_mean(self) -> Spectrum:
        """The signal less its mean over the period."""
        return held(super().without_mean)

    def over(self, base: Fraction) -> Spectrum:
        """The same over another period of its own."""
        if base is self.base or base == self.base:
            return self
        return self.once("over", base, lambda _: held(super(Held, self).over(base)))

    def sample(self, samples: int, behind: float = 0.0) -> NDArray[np.float64]:
        """Return values at equal steps, which nobody may change."""
        return self.once(
            f"sample {behind}", samples,
            lambda _: _fixed(np.ascontiguousarray(super(Held, self).sample(samples, behind))),
        )  # fmt: skip

    def __reduce__(self) -> tuple[Any, ...]:
        return Held, (self.base, self.coefficients, self.corners)


def held(signal: Spectrum) -> Held:
    """A signal that others will have a part in."""
    return Held(signal.base, _fixed(signal.coefficients), signal.corners)


def _fixed(values: NDArray[Any]) -> NDArray[Any]:
    values.setflags(write=False)
    return values


class Summed(Composed):
    """A signal that many others have a part in, and one of its own beside it, over one period.

    Attributes
    ----------
    held, own
        The two; of the first samples are kept.
    """

    held: Spectrum
    own: Spectrum

    def __init__(self, held: Spectrum, own: Spectrum) -> None:
        vars(self).update(base=held.base, held=held, own=own)

    @cached_property
    def whole(self) -> Spectrum:
        """Coefficients added up."""
        return self.held + self.own

    @property
    def parts(self) -> tuple[Spectrum, ...]:
        """The two."""
        return self.held, self.own

    @property
    def step(self) -> int:
        """Of both: what cancels in the sum repeats as often."""
        return math.gcd(self.held.step, self.own.step)

    def repeats(self, also: tuple[Fraction, ...] = ()) -> Fraction:
        """As of any other; most parts of one's own repeat as the one before did."""
        return self.held.once("repeats", (self.step, also), lambda _: super(Summed, self).repeats(also))

    @property
    def series(self) -> Spectrum:
        """Orders of both alone."""
        found = self.held.series, self.own.series
        return self if found == self.parts else Summed(*found)

    @property
    def without_mean(self) -> Spectrum:
        """Both less their means over the period."""
        return Summed(self.held.without_mean, self.own.without_mean)

    def over(self, base: Fraction) -> Spectrum:
        """Both over another period."""
        return Summed(self.held.over(base), self.own.over(base))

    def sample(self, samples: int, behind: float = 0.0) -> NDArray[np.float64]:
        """Return values of both."""
        return self.held.sample(samples, behind) + self.own.sample(samples, behind)
