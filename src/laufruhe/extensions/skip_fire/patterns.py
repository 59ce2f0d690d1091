"""Firing patterns up to rotation: words of firings (1) and skips (0)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from math import comb, gcd


def count_patterns(length: int, firings: int, step: int) -> int:
    """Return the number of patterns up to rotations by multiples of `step`, a divisor of `length` (Burnside)."""
    periods = [gcd(shift, length) for shift in range(0, length, step)]
    unchanged = (comb(n, firings * n // length) for n in periods if firings * n % length == 0)
    return sum(unchanged) * step // length


def rotations(pattern: str, step: int = 1) -> set[str]:
    """Return the different rotations of a pattern by multiples of `step`."""
    return {pattern[shift:] + pattern[:shift] for shift in range(0, len(pattern), step)}


def patterns(length: int, firings: int, step: int) -> Iterator[str]:
    """Yield the largest word of each class of patterns that are equal up to rotations by multiples of `step`."""
    for places in combinations(range(length), firings):
        pattern = "".join("01"[place in places] for place in range(length))
        if pattern == max(rotations(pattern, step)):
            yield pattern


def is_even(pattern: str) -> bool:
    """Return True if firings are spread as evenly as their number allows (a balanced word)."""
    ends = [place * pattern.count("1") // len(pattern) for place in range(len(pattern) + 1)]
    return "".join(str(after - end) for end, after in pairwise(ends)) in rotations(pattern)
