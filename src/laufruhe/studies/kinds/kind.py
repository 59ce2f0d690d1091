"""What every kind of study part says of itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from laufruhe.studies.scenes import Point, Scenes

if TYPE_CHECKING:
    import xarray as xr

Record = dict[str, Any]


@dataclass(frozen=True)
class Kind:
    """How one kind of part is computed. Its table of keys is the first argument of all three.

    Attributes
    ----------
    points
        The pieces of work of a part. What is wrong with it is refused here, before any is done.
    answer
        One piece of work as a record that JSON can hold; it depends on the part's settings
        and the point alone, never on other points.
    dataset
        Records, in the order of the points, as one labelled dataset.
    """

    points: Callable[[Any, Scenes], list[Point]]
    answer: Callable[[Any, Point, Scenes], Record]
    dataset: Callable[[Any, Sequence[Point], Sequence[Mapping[str, Any]]], xr.Dataset]
