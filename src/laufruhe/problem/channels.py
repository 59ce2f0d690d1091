"""Channels: quantities of a design, such as mount force, that measures evaluate (M1-M5, E6-E15).

The channel of a load returns a signal from the loads at an operating point. Other channels return numbers of the
design. Each channel lists the keys that may narrow it in a file, and the sides that a limit may have.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.extension import extended
from laufruhe.machine import Block, Engine, OperatingPoint, Role
from laufruhe.machine.block import LoadCase
from laufruhe.numerics.norms import MEAN, NORMS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics import mount_numbers
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.static_cases import settled
from laufruhe.physics.torque import crank_torque, excess_torque
from laufruhe.problem.decision import Kind
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery, PointLoads

Factor: TypeAlias = Callable[[Engine, OperatingPoint], NDArray[np.float64]]
"""Function that returns the factor on the load of each place, such as 1 / area, shape (places,) or (places, d)."""
OF_MOUNTS = frozenset({Kind.STIFFNESS, Kind.MOUNT})
# keys of a measure in a file that may narrow a load, by the place where the load acts
ON_BLOCK = ("operating_points", "orders", "alternating")
AT_WEBS = (*ON_BLOCK, "webs")
OF_VECTOR = (*ON_BLOCK, "direction_weights")
AT_MOUNTS, AT_CYLINDERS, IN_CYLINDERS = (*OF_VECTOR, "mounts"), (*OF_VECTOR, "cylinders"), (*ON_BLOCK, "cylinders")


def crankcase_signal(name: str, signal: Callable[[Engine, PointLoads], Spectrum]) -> Callable[[PointLoads], Spectrum]:
    """Return a function from loads at an operating point to a signal inside the crankcase, such as pin force.

    `signal` is a function of the engine with these parts and of the loads; an error without them gives the `name`.
    """

    def inside_load(loads: PointLoads) -> Spectrum:
        if loads.moving_parts is None:
            raise ValueError(f"{name} needs the moving parts, and only the wrench is known")
        return signal(loads.moving_parts, loads)

    return inside_load


@dataclass(frozen=True, eq=False)
class Need:
    """Part that an engine must have for a channel.

    Attributes
    ----------
    of
        Function that returns this part of an engine, or a false value if it is missing.
    what, remedy
        Name of the part and remedy, for the complaint about a file without it.
    """

    of: Callable[[Engine], object]
    what: str
    remedy: str


class Needs:
    """Parts of an engine that channels of the core need."""

    UNCONDITIONAL = Need(lambda _: True, "", "")
    MOUNTS = Need(lambda e: e.mounts, "mounts", "add [mounts], or ask for a shaking force")
    ELASTIC = Need(lambda e: e.block, "elastic mounts", 'add [mounts] with kind = "elastic", and [block]')
    CASES = Need(lambda e: e.load_cases, "load cases", "add [[load_cases]], and [mounts] of kind elastic")


@dataclass(frozen=True)
class Display:
    """Table and curves of a load at each of its places in results.

    Attributes
    ----------
    title, place
        Title of the table, empty without one, and name of a place in it and in datasets.
    key
        Key in `result.json`; by default the name of the channel.
    curve
        Words before a place in headings of curves, such as "force on"; empty without curves.
    applies
        Function of the engine that returns False if it is shown with a measure of it only.
    note
        Function of the problem that returns a note on it.
    """

    title: str = ""
    place: str = ""
    key: str = ""
    curve: str = ""
    applies: Callable[[Engine], object] = lambda _: True
    note: Callable[[Any], str] = lambda _: ""


_KNOWN: dict[str, Channel] = {}


def channel_named(name: str) -> Channel:
    """Return a channel by name, imported from its extension if needed."""
    return _KNOWN.get(name) or CHANNELS[name]


@dataclass(frozen=True, eq=False)
class Channel:
    """Quantity of a design. Optional attributes are None, empty or False unless they apply.

    Attributes
    ----------
    name, unit
        Name in files and reports; SI unit.
    keys
        Keys that may narrow it in a file.
    needs
        Part that the engine must have.
    sides
        Sides that a limit may have: "min", "max", "outside".
    minimised
        True if an objective may contain it.
    depends_on_loads
        False if it certainly does not depend on the loads that excite the block.
    depends_on_gas
        True if the gas contributes to it.
    inertia_value
        For channels that are monotone in the inertia of all that turns with the crank: function of measure and design
        that returns their value as a function of this inertia.
    depends_on_torque
        True if it depends on the torque of the crank and on the inertia of all that turns with it.
    size_value
        For channels of sizes alone: their value as a function of the engine, monotone in each size.
    case_vectors
        For channels of load cases: function of the static balance of a case that returns vectors, shape (mounts, 3);
        the value is their largest length.
    simulation
        Package that simulates a channel without a closed form: `peaks` for searches of mounts, `boxes` for bounds.
    peak_error
        Relative error of the peaks between the time steps of a simulation, as a function of the engine.
    axis_residual
        For channels of the torque-roll axis: function of block and frequency band that returns the residual of a
        rotation about the axis as a natural mode.
    places
        Function of the engine that returns the names of its places; empty for loads on the block.
    display
        Its table and curves, place by place.
    linear_in
        Load of which it is a linear function at each crank angle, so that it depends on decisions as that load does.
    """

    name: str
    unit: str
    keys: tuple[str, ...] = ()
    needs: Need = Needs.UNCONDITIONAL
    sides: tuple[str, ...] = ("max",)
    minimised: bool = True
    depends_on_loads: bool = True
    depends_on_gas: bool = False
    inertia_value: Callable[[MeasureQuery, EvaluatedDesign], Callable[[float], float]] | None = None
    size_value: Callable[[Engine], float] | None = None
    depends_on_torque: bool = False
    case_vectors: Callable[[Any], Any] | None = None
    axis_residual: Callable[[Block, mount_numbers.Band], mount_numbers.AxisResidual] | None = None
    simulation: str = ""
    peak_error: Callable[[Engine], float] = lambda _: 0.0
    places: Callable[[Engine], Sequence[str]] = lambda _: ()
    display: Display = Display()
    linear_in: Channel | None = None
    is_load: ClassVar[bool] = False
    is_mass: ClassVar[bool] = False
    is_number: ClassVar[bool] = False
    is_mounting: ClassVar[bool] = False

    def __post_init__(self) -> None:
        _KNOWN[self.name] = self

    def __reduce__(self) -> tuple[Callable[[str], Channel], tuple[str]]:
        # unpickling returns the one object of this channel in the process
        return channel_named, (self.name,)

    def __str__(self) -> str:
        return self.name

    @property
    def norms(self) -> Collection[str]:
        """Names of the norms that apply to it; empty for a number."""
        return ()

    def check_sizes(self, engine: Engine, _: OperatingPoint) -> None:
        """Raise `ModelError` if the engine lacks a size that the channel needs."""
        if self.size_value is not None:
            self.size_value(engine)


@dataclass(frozen=True, eq=False)
class LoadChannel(Channel):
    """Load as a signal over the cycle, linear in the loads; measures are norms of the signal.

    Attributes
    ----------
    signal
        Function of the loads at an operating point that returns the spectrum, shape (n, places, d).
    part
        Components of the wrench, for loads on the block; None for others.
    depends_on_gas
        True if gas contributes to it. On the block gas makes a roll moment but no force (eq. 1).
    is_block_load
        True if it follows from the wrench on the block alone; False for a load inside the crankcase.
    depends_on_unbalances
        True if rotors contribute and the loads of all throws are summed; False if it depends on single cylinders.
    sums_places
        True if the value is the sum over its places; then its norm is always the mean over the cycle.
    size_factors
        Function of engine and operating point that returns the factor of each place or component, such as 1 / area,
        for loads inside the crankcase (Z1); None without factors.
    """

    keys: tuple[str, ...] = ON_BLOCK
    signal: Callable[[PointLoads], Spectrum] = field(kw_only=True)
    part: slice | None = None
    depends_on_gas: bool = True
    is_block_load: bool = False
    depends_on_unbalances: bool = True
    sums_places: bool = False
    size_factors: Factor | None = None
    is_load: ClassVar[bool] = True

    def factors_of(self, engine: Engine, point: OperatingPoint) -> NDArray[np.float64] | None:
        """Return factors from load to stress by place at an operating point, (places, d or 1); None without factors."""
        if self.size_factors is None:
            return None
        factors = self.size_factors(engine, point)
        return factors if factors.ndim > 1 else factors[:, None]

    def check_sizes(self, engine: Engine, point: OperatingPoint) -> None:
        """Raise `ModelError` if the engine lacks a size of one of its places."""
        self.factors_of(engine, point)

    def is_displayed(self, engine: Engine, fidelity: Fidelity, requested: Collection[Channel] = ()) -> bool:
        """Return True if results of an engine, with measures of the `requested` channels, show it place by place."""
        is_known = self.is_block_load or not fidelity.has_uneven_speed
        has_places = is_known and self.needs.of(engine) and self.places(engine)
        return bool(has_places and (self in requested or self.display.applies(engine)))

    @property
    def key(self) -> str:
        """Key in `result.json`."""
        return self.display.key or self.name.replace(" ", "_")

    @property
    def norms(self) -> Collection[str]:
        """Names of the norms that apply to it."""
        return (MEAN.name,) if self.sums_places else tuple(NORMS)


@dataclass(frozen=True, eq=False)
class MassChannel(Channel):
    """Sum of the masses of rotors with certain roles, such as counterweights."""

    keys: tuple[str, ...] = ("of",)
    roles: tuple[Role, ...] = field(kw_only=True)
    is_mass: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class NumberChannel(Channel):
    """Number, or several numbers, of a design that are no norm of a signal.

    Attributes
    ----------
    values
        Function of measure and design that returns the numbers. Reports show the first one, limits apply to all.
    """

    values: Callable[[MeasureQuery, EvaluatedDesign], Sequence[float]] = field(kw_only=True)
    is_number: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class MountChannel(NumberChannel):
    """Number of a block on its mounts."""

    needs: Need = Needs.ELASTIC
    is_mounting: ClassVar[bool] = True


def _names_of_mounts(engine: Engine) -> Sequence[str]:
    return [mount.name for mount in engine.mounts]


def names_of_cylinders(engine: Engine) -> Sequence[str]:
    """Return the names of the cylinders, which are the places of their loads."""
    return [part.name for part in engine.slider_cranks]


PlaceSpec: TypeAlias = tuple[tuple[str, ...], Need, Callable[[Engine], Sequence[str]]]
"""Keys that narrow a load, part that it needs, and function that returns the names of its places."""
IN_EACH_CYLINDER: PlaceSpec = (IN_CYLINDERS, Needs.UNCONDITIONAL, names_of_cylinders)
Load: TypeAlias = Callable[[Engine, OperatingPoint, Fidelity], Spectrum]


def crankcase_channel(
    name: str, unit: str, where: PlaceSpec, load: Load, factor: Factor | None = None, display: Display = Display()
) -> LoadChannel:
    """Return the channel (a quantity that measures can use) of a load inside the crankcase (Z1).

    Parameters
    ----------
    where
        Keys, needed part and place names of the channel.
    load
        Function of engine, operating point and fidelity that returns the spectrum, shape (n, places, d).
    factor
        Size factors by which the load is multiplied; None for none.
    display
        Its table and curves.
    """

    def signal(moving_parts: Engine, loads: PointLoads) -> Spectrum:
        spectrum, factors = (
            load(moving_parts, loads.point, loads.fidelity),
            channel.factors_of(moving_parts, loads.point),
        )
        return spectrum if factors is None else spectrum.mapped(lambda values: values * factors)

    keys, needs, places = where
    channel = LoadChannel(
        name,
        unit,
        keys,
        needs,
        signal=crankcase_signal(name, signal),
        places=places,
        size_factors=factor,
        display=display,
    )
    return channel


def mounting_in(engine: Engine) -> ElasticMounting:
    """Return the elastic mounting of an engine with a block."""
    if engine.block is None:
        raise ValueError("the engine has rigid mounts; elastic ones need a block")
    return elastic_mounting(engine.block, engine.mounts)


def _of_mounting(number: Callable[[ElasticMounting, MeasureQuery], float | Sequence[float]]) -> Callable[
    [MeasureQuery, EvaluatedDesign], Sequence[float]
]:  # fmt: skip
    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        numbers = number(mounting_in(evaluation.engine), measure)
        return (numbers,) if isinstance(numbers, float) else numbers

    return values


def _transmissibility(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
    firm = rigid_mounting(evaluation.engine.mounts)
    ratios = [
        mount_numbers.transmitted(loads.mount_forces, firm.forces(loads.wrench), measure.orders)
        for loads in evaluation.loads
        if measure.includes_point(loads.point) and loads.mount_forces is not None
    ]
    return (max(ratios, default=0.0),)


def motion_indices(measure: MeasureQuery) -> tuple[int, ...]:
    """Return the indices of the motions that the modes should decouple; all by default."""
    return tuple(MOTIONS.index(name) for name in measure.motions or MOTIONS)


def _of_axis(
    name: str, unit: str, residual: Callable[[Block, mount_numbers.Band], mount_numbers.AxisResidual]
) -> MountChannel:
    # the residual is zero if rotation about the torque-roll axis is a natural mode
    def value(mounting: ElasticMounting, measure: MeasureQuery) -> float:
        return mount_numbers.residual_of(mounting, residual(mounting.block, measure.frequency))

    return MountChannel(
        name, unit, ("frequency",), values=_of_mounting(value), axis_residual=residual, depends_on_loads=False
    )


def counted_cases(measure: MeasureQuery, engine: Engine) -> list[LoadCase]:
    """Return the load cases of an engine that a measure counts."""
    return [case for case in engine.load_cases if measure.cases is None or case.name in measure.cases]


def _of_cases(name: str, unit: str, part: Callable[[Any], Any]) -> MountChannel:
    """Return the channel of the largest static force or travel, over the mounts and load cases of a measure."""

    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        mounting = mounting_in(evaluation.engine)
        counted = measure.places([mount.name for mount in mounting.mounts])
        weights = np.array(measure.direction_weights or (1.0, 1.0, 1.0))
        cases = counted_cases(measure, evaluation.engine)
        vectors = [part(settled(mounting, case))[counted] * weights for case in cases]
        return (max((float(np.linalg.norm(rows, axis=1).max()) for rows in vectors), default=0.0),)

    keys = ("load_cases", "mounts", "direction_weights")
    return MountChannel(
        name, unit, keys, Needs.CASES, values=values, case_vectors=part, depends_on_loads=False,
        places=_names_of_mounts,
    )  # fmt: skip


STATIC_TRAVEL = _of_cases("static travel", "m", lambda balance: balance.travel)
STATIC_FORCE = _of_cases("static mount force", "N", lambda balance: balance.force)
TRANSMISSIBILITY = MountChannel("transmissibility", "", ("operating_points", "orders"), values=_transmissibility)
SAG = MountChannel(
    "static sag",
    "m",
    sides=("min", "max"),
    depends_on_loads=False,
    values=_of_mounting(lambda mounting, _: mount_numbers.sag(mounting)),
)
FREQUENCIES = MountChannel(
    "natural frequencies", "Hz", sides=("min", "max", "outside"), minimised=False, depends_on_loads=False,
    values=_of_mounting(lambda mounting, _: [float(f) for f in mounting.modes.frequencies]),
)  # fmt: skip
MOTION_FREQUENCIES = MountChannel(
    "motion frequencies", "Hz", ("motions",), sides=("min", "max"), minimised=False, depends_on_loads=False,
    values=_of_mounting(lambda mounting, m: mount_numbers.motion_frequencies(mounting.modes, motion_indices(m))),
)  # fmt: skip
DECOUPLING = MountChannel(
    "kinetic-energy decoupling", "", ("motions",), sides=("min",), minimised=False, depends_on_loads=False,
    values=_of_mounting(lambda mounting, m: mount_numbers.decoupling(mounting.modes.energy, motion_indices(m))),
)  # fmt: skip
DECOUPLING_SHORTFALL = MountChannel(
    "decoupling shortfall", "", ("motions", "wanted"), depends_on_loads=False,
    values=_of_mounting(
        lambda mounting, m: mount_numbers.decoupling_shortfall(mounting.modes.energy, motion_indices(m), m.wanted)
    ),
)  # fmt: skip
TORQUE_ROLL = _of_axis("torque-roll residual", "", mount_numbers.relative_residual)
RAW_TORQUE_ROLL = _of_axis("raw torque-roll residual", "N m/rad", mount_numbers.raw_residual)
TOTAL_STIFFNESS = MountChannel(
    "total stiffness", "N/m", sides=("min", "max"), depends_on_loads=False,
    values=_of_mounting(lambda mounting, _: mount_numbers.total_stiffness(mounting.mounts)),
)  # fmt: skip
OF_MOUNTING = (
    TRANSMISSIBILITY, SAG, FREQUENCIES, MOTION_FREQUENCIES, DECOUPLING, DECOUPLING_SHORTFALL, TORQUE_ROLL,
    RAW_TORQUE_ROLL, TOTAL_STIFFNESS, STATIC_TRAVEL, STATIC_FORCE,
)  # fmt: skip


def _on_block(name: str, unit: str, part: slice, depends_on_gas: bool = False) -> LoadChannel:
    def signal(loads: PointLoads) -> Spectrum:
        return loads.wrench.mapped(lambda wrench: wrench[:, None, part])

    keys = OF_VECTOR if part == slice(0, 3) else ON_BLOCK
    return LoadChannel(name, unit, keys, signal=signal, part=part, depends_on_gas=depends_on_gas, is_block_load=True)


def _on_mounts(
    name: str, unit: str, needs: Need, display: Display, signal: Callable[[PointLoads], Spectrum | None]
) -> LoadChannel:
    def signal_of_mounts(loads: PointLoads) -> Spectrum:
        spectrum = signal(loads)
        if spectrum is None:
            raise ValueError(f"the mounts of this engine have no {name}, because they are rigid or missing")
        return spectrum

    return LoadChannel(
        name,
        unit,
        AT_MOUNTS,
        needs,
        signal=signal_of_mounts,
        places=_names_of_mounts,
        is_block_load=True,
        display=display,
    )


_ON_CRANK: PlaceSpec = (ON_BLOCK, Needs.UNCONDITIONAL, lambda _: ("crankshaft",))


def _crank_torque(moving_parts: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return crank_torque(moving_parts, point, fidelity).mapped(lambda values: values[:, None, None])


def _stored_work(moving_parts: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    return excess_torque(moving_parts, point, fidelity).integral.mapped(lambda values: values[:, None, None])


MOUNT_FORCE = _on_mounts(
    "mount force", "N", Needs.MOUNTS, Display("Mount forces", "mount", "mounts", "force on"),
    lambda loads: loads.mount_forces,
)  # fmt: skip
RESULTANT_MOUNT_FORCE = LoadChannel(
    "resultant mount force", "N", OF_VECTOR, Needs.MOUNTS, is_block_load=True,
    signal=lambda loads: MOUNT_FORCE.signal(loads).mapped(lambda values: values.sum(axis=1, keepdims=True)),
)  # fmt: skip
MOUNT_TRAVEL = _on_mounts(
    "mount travel", "m", Needs.ELASTIC, Display(place="mount", curve="travel at"), lambda loads: loads.mount_travel
)
AT_EACH_MOUNT = frozenset({MOUNT_FORCE, MOUNT_TRAVEL})
"""Loads at mounts for which bounds over boxes of mount numbers exist."""
SHAKING_FORCE = _on_block("shaking force", "N", slice(0, 3))
ROCKING_COUPLE = _on_block("rocking couple", "N m", slice(4, 6))
ROLL_MOMENT = _on_block("roll moment", "N m", slice(3, 4), depends_on_gas=True)
SURGING_FORCE = _on_block("surging force", "N", slice(1, 2))
SWAYING_COUPLE = _on_block("swaying couple", "N m", slice(5, 6))
OF_BLOCK = (SHAKING_FORCE, ROCKING_COUPLE, ROLL_MOMENT, SURGING_FORCE, SWAYING_COUPLE)
CRANK_TORQUE = crankcase_channel(
    "crank torque", "N m", _ON_CRANK, _crank_torque, display=Display(place="shaft", curve="torque of")
)
STORED_WORK = crankcase_channel("stored work", "J", _ON_CRANK, _stored_work)

COUNTERWEIGHT_MASS = MassChannel("counterweight mass", "kg", roles=(Role.COUNTERWEIGHT,))
BALANCER_MASS = MassChannel("balancer mass", "kg", roles=(Role.BALANCER,))
ADDED_MASS = MassChannel("added mass", "kg", roles=(Role.COUNTERWEIGHT, Role.BALANCER))


def is_at_mounts(channel: Channel) -> bool:
    """Return True for the channels of mount force and mount travel."""
    return channel in AT_EACH_MOUNT


CHANNELS: Mapping[str, Channel] = extended("channels", Channel, (
    MOUNT_FORCE, RESULTANT_MOUNT_FORCE, MOUNT_TRAVEL, *OF_BLOCK,
    CRANK_TORQUE, STORED_WORK, COUNTERWEIGHT_MASS, BALANCER_MASS, ADDED_MASS, *OF_MOUNTING,
))  # fmt: skip


def load_channels() -> list[LoadChannel]:
    """Return the channels of loads."""
    return [channel for channel in CHANNELS.values() if isinstance(channel, LoadChannel)]
