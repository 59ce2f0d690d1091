"""Kinds of channels: their keys, sides that may be limited, and dependences (M1-M5, E6-E15)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Block, Engine, Flywheel, OperatingPoint, Role
from laufruhe.machine.clearances import Span
from laufruhe.numerics.norms import MEAN, NORMS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.mount_numbers import AxisResidual, Band
from laufruhe.problem.decision import Kind
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery, PointLoads

Factor: TypeAlias = Callable[[Engine, OperatingPoint], NDArray[np.float64]]
"""One over the sizes that bear a load, shape (places,) or (places, d)."""
OfWheel: TypeAlias = Callable[[Flywheel], float]
OF_MOUNTS = frozenset({Kind.STIFFNESS, Kind.MOUNT})
ON_BLOCK = ("operating_points", "orders", "alternating")
AT_WEBS = (*ON_BLOCK, "webs")
AT_MOUNTS, AT_BEARINGS, AT_CYLINDERS = (
    (*ON_BLOCK, "direction_weights", at) for at in ("mounts", "bearings", "cylinders")
)
OF_BEARINGS, IN_CYLINDERS = (*ON_BLOCK, "bearings"), (*ON_BLOCK, "cylinders")


def of_what_moves(name: str, signal: Callable[[Engine, PointLoads], Spectrum]) -> Callable[[PointLoads], Spectrum]:
    """Return the function of a load inside the crankcase, which depends on the moving parts alone."""

    def inside_load(loads: PointLoads) -> Spectrum:
        if loads.moving is None:
            raise ValueError(f"of a wrench alone there is no {name}")
        return signal(loads.moving, loads)

    return inside_load


@dataclass(frozen=True, eq=False)
class Need:
    """Part that an engine must have for a channel.

    Attributes
    ----------
    of
        Function that returns this part of an engine, false if it is missing.
    what, remedy
        Texts of the complaint about a file without it.
    """

    of: Callable[[Engine], object]
    what: str
    remedy: str


class Needs:
    """Needs of the channels of the core."""

    NOTHING = Need(lambda _: True, "", "")
    MOUNTS = Need(lambda e: e.mounts, "mounts", "add [mounts], or ask for a shaking force")
    ELASTIC = Need(lambda e: e.block, "elastic mounts", 'add [mounts] with kind = "elastic", and [block]')
    BEARINGS = Need(lambda e: e.bearings, "main bearings", "list them in [[main_bearings]]")
    FLYWHEEL = Need(
        lambda e: e.flywheel or any(extra.turning_inertia(e.slider_cranks) is not None for extra in e.extras),
        "a flywheel",
        "add [flywheel] with an inertia or a rim, [torsion], or fidelity.crank_inertia",
    )
    RIM = Need(lambda e: e.flywheel and e.flywheel.rim, "the rim of a flywheel", "add [flywheel.rim]")
    ARMS = Need(
        lambda e: e.flywheel and e.flywheel.rim and e.flywheel.rim.arms,
        "the arms of a flywheel",
        "add [flywheel.rim.arms]",
    )
    CASES = Need(lambda e: e.load_cases, "load cases", "add [[load_cases]], and [mounts] of kind elastic")


_KNOWN: dict[str, Channel] = {}


def channel_named(name: str) -> Channel:
    """Return a channel by name, imported from its extension if needed."""
    channel: Channel = _KNOWN.get(name) or import_module("laufruhe.problem.channels").CHANNELS[name]
    return channel


@dataclass(frozen=True, eq=False)
class Channel:
    """Quantity of a design.

    Attributes
    ----------
    name, unit
        Name in files and reports; SI unit.
    keys
        Keys that narrow it in a file.
    needs
        Part that the engine must have.
    sides
        Sides that a limit may have.
    minimised
        True if it may be an objective.
    of_loads
        True unless a number is known not to depend on the excitation of the block.
    of_wheel
        Function of measure and design that returns the value as a function of the flywheel, for channels of it.
    of_torque
        True if it contains the torque of the crank, which depends on other decisions than the flywheel too.
    of_engine
        Value as a function of an engine, for channels of its sizes alone, monotone in each size.
    of_cases
        Function of a block in static balance, shape (mounts, 3), whose largest length is a channel of load cases.
    simulation
        Module that simulates it if there is no expression: `peaks` for searches of mounts, `boxes` for bounds.
    missed
        Relative error of peaks between the steps of a simulation, as a function of the engine.
    of_axis
        Residual of turning about the torque-roll axis as a mode, for channels of it.
    places
        Function that returns the names of its places, by which a file may narrow it; empty for the block.
    title, place
        Titles of the table and its column of places that every report shows for a load at even speed; empty if it is
        shown on request only.
    span
        Function that returns the smallest and largest values while shafts move between their places in two engines.
    """

    name: str
    unit: str
    keys: tuple[str, ...] = ()
    needs: Need = Needs.NOTHING
    sides: tuple[str, ...] = ("max",)
    minimised: bool = True
    of_loads: bool = True
    of_wheel: Callable[[MeasureQuery, EvaluatedDesign], OfWheel] | None = None
    of_engine: Callable[[Engine], float] | None = None
    of_torque: bool = False
    of_cases: Callable[[Any], Any] | None = None
    of_axis: Callable[[Block, Band], AxisResidual] | None = None
    simulation: str = ""
    missed: Callable[[Engine], float] = lambda _: 0.0
    places: Callable[[Engine], Sequence[str]] = lambda _: ()
    title: str = ""
    place: str = ""
    span: Callable[[MeasureQuery, Engine, Engine], Sequence[Span]] = lambda *_: ()
    is_load: ClassVar[bool] = False
    is_mass: ClassVar[bool] = False
    is_number: ClassVar[bool] = False
    is_mounting: ClassVar[bool] = False
    is_placing: ClassVar[bool] = False

    def __post_init__(self) -> None:
        _KNOWN[self.name] = self

    def __reduce__(self) -> tuple[Callable[[str], Channel], tuple[str]]:
        # a channel is one and the same in every process
        return channel_named, (self.name,)

    def __str__(self) -> str:
        return self.name

    @property
    def norms(self) -> Collection[str]:
        """Names of the norms that apply to it; empty for a number."""
        return ()

    @property
    def is_flywheel(self) -> bool:
        """True if it is monotone in every number of the flywheel."""
        return self.of_wheel is not None

    @property
    def of_inertia(self) -> bool:
        """True if it is monotone in the inertia of all that turns."""
        return self.is_flywheel and self.needs is Needs.FLYWHEEL

    def check_sizes(self, engine: Engine, _: OperatingPoint) -> None:
        """Raise `ModelError` if a size that it needs is missing."""
        if self.of_engine is not None:
            self.of_engine(engine)


@dataclass(frozen=True, eq=False)
class LoadChannel(Channel):
    """Signal over the cycle, linear in the loads; measures are norms of it.

    Attributes
    ----------
    signal
        Function that returns its spectrum, shape (n, places, d), from the loads at an operating point.
    part
        Components of the wrench for a load of the block; None for loads at mounts.
    feels_gas
        True if it contains the roll moment: gas gives no force (eq. 1).
    of_wrench
        True if it follows from the wrench on the block alone; else it is a load inside the crankcase.
    feels_unbalances
        True if rotors load it and the loads of the throws add up; else it depends on cylinders and their twist.
    adds_up
        True if its places add up, so that only the mean over the cycle has a meaning.
    of_sizes
        Factors of sizes of each place or component, by which a load inside the crankcase is multiplied (Z1).
    """

    keys: tuple[str, ...] = ON_BLOCK
    signal: Callable[[PointLoads], Spectrum] = field(kw_only=True)
    part: slice | None = None
    feels_gas: bool = True
    of_wrench: bool = False
    feels_unbalances: bool = True
    adds_up: bool = False
    of_sizes: Factor | None = None
    is_load: ClassVar[bool] = True

    def factors_of(self, engine: Engine, point: OperatingPoint) -> NDArray[np.float64] | None:
        """Return its factors of sizes, shape (places, d or 1); None without such factors."""
        if self.of_sizes is None:
            return None
        factors = self.of_sizes(engine, point)
        return factors if factors.ndim > 1 else factors[:, None]

    def check_sizes(self, engine: Engine, point: OperatingPoint) -> None:
        """Raise `ModelError` if a size of its places is missing."""
        self.factors_of(engine, point)

    @property
    def norms(self) -> Collection[str]:
        """Names of the norms that apply to it."""
        return (MEAN.name,) if self.adds_up else tuple(NORMS)


@dataclass(frozen=True, eq=False)
class MassChannel(Channel):
    """Sum of the masses of rotors with some roles."""

    keys: tuple[str, ...] = ("of",)
    roles: tuple[Role, ...] = field(kw_only=True)
    is_mass: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class NumberChannel(Channel):
    """Numbers of a design without a signal.

    Attributes
    ----------
    values
        Function that returns its numbers: the first is shown, limits apply to all.
    """

    values: Callable[[MeasureQuery, EvaluatedDesign], Sequence[float]] = field(kw_only=True)
    is_number: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class SizeChannel(NumberChannel):
    """Number that depends on sizes alone."""

    of_loads: bool = False


@dataclass(frozen=True, eq=False)
class MountChannel(NumberChannel):
    """Number of a block on its mounts."""

    needs: Need = Needs.ELASTIC
    is_mounting: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class PlaceChannel(NumberChannel):
    """Distance between places of balancer shafts."""

    keys: tuple[str, ...] = ("of",)
    of_loads: bool = False
    minimised: bool = False
    is_placing: ClassVar[bool] = True
