"""Kinds of channels: what keys narrow them, which sides of them may be limited, and what moves them (M1-M5, E6-E15)."""

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
    """A load inside the crankcase: of what moves, whatever the block stands on."""

    def found(loads: PointLoads) -> Spectrum:
        if loads.moving is None:
            raise ValueError(f"of a wrench alone there is no {name}")
        return signal(loads.moving, loads)

    return found


@dataclass(frozen=True, eq=False)
class Need:
    """A part that an engine must have before a channel means anything.

    Attributes
    ----------
    of
        Return this part of an engine; what is false is not there.
    what, remedy
        As a file without it is told.
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


def known(name: str) -> Channel:
    """Return the channel of a name; those of extensions are imported where they are not yet."""
    found: Channel = _KNOWN.get(name) or import_module("laufruhe.problem.channels").CHANNELS[name]
    return found


@dataclass(frozen=True, eq=False)
class Channel:
    """One thing that is measured.

    Attributes
    ----------
    name, unit
        As files and reports say it; SI.
    keys
        That narrow it in a file.
    needs
        What the engine must have.
    sides
        That a limit may have.
    minimised
        Whether it may be an objective.
    of_loads
        Whether a number may depend on what excites the block, as it does where nobody says that it does not.
    size
        Size of the parts of an engine that cancel if it is zero [SI]; zero if there are none.
    rises
        Whether it never falls where a number of the flywheel grows; else it never rises.
    of_wheel
        The value as a function of the flywheel of an engine, if it is of that.
    of_torque
        Whether the torque of the crank is in it, which other decisions than the flywheel move too.
    of_engine
        The value as a function of an engine, if it is of its sizes alone and goes one way with each of them.
    of_cases
        Of a block under a held load what it is the largest length of, shape (mounts, 3), if it is of that.
    simulation
        Module that simulates it, where no expression has it: `peaks` for searches of mounts, `boxes` for bounds.
    missed
        Share of its value that may stand between the steps of a simulation.
    of_axis
        What turning about the torque-roll axis lacks to be a mode, if it is of that.
    places
        Names of the places that it is measured at, by which a file may narrow it; none where that is the block.
    title, place
        Of a load: of the table in which every report shows it where the engine has what it needs and turns evenly, and
        of a place there; none where it is shown only if it is asked.
    span
        Least and largest of its numbers while shafts stand between their places in two engines, if it is of these.
    """

    name: str
    unit: str
    keys: tuple[str, ...] = ()
    needs: Need = Needs.NOTHING
    sides: tuple[str, ...] = ("max",)
    minimised: bool = True
    size: Callable[[Engine], float] = lambda _: 0.0
    of_loads: bool = True
    rises: bool = True
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
        return known, (self.name,)

    def __str__(self) -> str:
        return self.name

    @property
    def norms(self) -> Collection[str]:
        """Names of those that it may be asked in; none where it is a number."""
        return ()

    @property
    def is_flywheel(self) -> bool:
        """Whether it goes one way with every number of the flywheel."""
        return self.of_wheel is not None

    @property
    def of_inertia(self) -> bool:
        """True if it is monotone in the inertia of all that turns."""
        return self.is_flywheel and self.needs is Needs.FLYWHEEL

    def check_sizes(self, engine: Engine, _: OperatingPoint) -> None:
        """Ask for the sizes that are in it, if there are such.

        Raises
        ------
        ModelError
            If one of them is not given.
        """
        if self.of_engine is not None:
            self.of_engine(engine)


@dataclass(frozen=True, eq=False)
class LoadChannel(Channel):
    """A signal over the cycle, linear in the loads; it has a norm.

    Attributes
    ----------
    signal
        Coefficients of shape (n, places, d) from the loads at an operating point.
    part
        Components of the wrench where its one place is the block; None where its places are the mounts.
    feels_gas
        Whether the roll moment is in it: gas gives no force (eq. 1).
    lever
        Power of a throw's place that its load grows with; None where loads do not add up by places alone.
    of_wrench
        Whether it follows from the wrench on the block alone; what does not say so counts as a load inside.
    feels_unbalances
        Whether rotors load it, and the loads of each throw add up; else it is of cylinders and what they twist.
    adds_up
        Whether its places are added up, so that no norm but the mean over the cycle has a meaning.
    of_sizes
        Factors of sizes that it is a load inside the crankcase times, of each place or component (Z1).
    """

    keys: tuple[str, ...] = ON_BLOCK
    signal: Callable[[PointLoads], Spectrum] = field(kw_only=True)
    part: slice | None = None
    feels_gas: bool = True
    lever: int | None = None
    of_wrench: bool = False
    feels_unbalances: bool = True
    adds_up: bool = False
    of_sizes: Factor | None = None
    is_load: ClassVar[bool] = True

    def factors_of(self, engine: Engine, point: OperatingPoint) -> NDArray[np.float64] | None:
        """Its factors at every place and component; None where sizes move it by their masses alone."""
        if self.of_sizes is None:
            return None
        found = self.of_sizes(engine, point)
        return found if found.ndim > 1 else found[:, None]

    def check_sizes(self, engine: Engine, point: OperatingPoint) -> None:
        """Of its places, at an operating point."""
        self.factors_of(engine, point)

    @property
    def norms(self) -> Collection[str]:
        """All, or the mean where places are added up."""
        return (MEAN.name,) if self.adds_up else tuple(NORMS)


@dataclass(frozen=True, eq=False)
class MassChannel(Channel):
    """Masses of the rotors of some roles, added up."""

    keys: tuple[str, ...] = ("of",)
    roles: tuple[Role, ...] = field(kw_only=True)
    is_mass: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class NumberChannel(Channel):
    """Numbers of a design, and no signal.

    Attributes
    ----------
    values
        The first is the one that is shown, all of them keep a limit.
    """

    values: Callable[[MeasureQuery, EvaluatedDesign], Sequence[float]] = field(kw_only=True)
    is_number: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class SizeChannel(NumberChannel):
    """A number of sizes alone."""

    of_loads: bool = False


@dataclass(frozen=True, eq=False)
class MountChannel(NumberChannel):
    """A block on its mounts."""

    needs: Need = Needs.ELASTIC
    is_mounting: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class PlaceChannel(NumberChannel):
    """Where balancer shafts stand."""

    keys: tuple[str, ...] = ("of",)
    of_loads: bool = False
    minimised: bool = False
    is_placing: ClassVar[bool] = True
