"""Base of all models of the working gas: what loads, key figures and error bounds ask of each."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.arrays import Array

if TYPE_CHECKING:
    from laufruhe.machine.engine import Cycle, Engine

AMBIENT_PRESSURE = units.ATMOSPHERE
_STEPS, _ROUNDING = 7200, 1e-9
"""Number of crank angles at which the pressure of a cycle is compared, and relative rounding error of a plateau."""


class GasModel(ABC):
    """Gas in the cylinders of an engine; a new model is a subclass, with the table of its keys in `GAS_MODELS`.

    Crank angles are those of the engine after the firing of a cylinder [rad].

    Attributes
    ----------
    crankcase_pressure
        Absolute pressure on the underside of the piston [Pa].
    recording
        Sentences about how a measured pressure was read; empty for computed gas.
    fires
        False for gas without combustion, such as steam.
    is_measured
        True for a measured pressure, which includes what combustion and valves did.
    loads
        Names of the pressures that operating points may change.
    motored_remedy
        Remedy if the pressure without combustion is not known; empty for a gas that never has it.
    """

    crankcase_pressure: float
    recording: tuple[str, ...] = ()
    fires: ClassVar[bool] = True
    is_measured: ClassVar[bool] = False
    loads: ClassVar[tuple[str, ...]] = ()
    motored_remedy: ClassVar[str] = ""

    @property
    def models(self) -> tuple[GasModel, ...]:
        """Models of all cylinders, each once."""
        return (self,)

    def of_cylinder(self, _name: str, /) -> GasModel:
        """Return the model of a cylinder."""
        return self

    def only(self, _name: str, /) -> GasModel | None:
        """Return the gas of an engine whose other cylinders have no piston area; None if the cylinder has no gas."""
        return self

    def mapped(self, change: Callable[[GasModel], GasModel]) -> GasModel:
        """Return the gas with the model of every cylinder changed."""
        return change(self)

    def shares(self, engine: Engine) -> Sequence[tuple[str, GasModel, Sequence[SliderCrank]]]:
        """Return parts of the gas with key figures of their own: name, gas, slider-cranks; the whole has no name."""
        return [("", self, engine.slider_cranks)]

    def check(self, _part: SliderCrank, /) -> None:
        """Raise `ModelError` if the gas does not fit a slider-crank."""
        return

    @abstractmethod
    def pressure(self, part: SliderCrank, cycle: Cycle, angles: Array, /) -> Array:
        """Return the absolute cylinder pressure [Pa], shape of `angles`.

        Raises
        ------
        ModelError
            If the model cannot meet its indicated mean pressure, or measured points do not cover the cycle.
        """

    def thrust(self, part: SliderCrank, cycle: Cycle, angles: Array, /) -> Array:
        """Return the gas force on a piston rod along the axis, away from the crank [N], as `pressure` (B1)."""
        over = self.pressure(part, cycle, angles) - self.crankcase_pressure
        return np.asarray(-part.swept.piston.piston_area * over)

    @abstractmethod
    def breaks(self, part: SliderCrank, cycle: Cycle) -> Array:
        """Return the angles at which a derivative of the thrust jumps [rad] (G13)."""

    def alike(self, part: SliderCrank) -> Hashable:
        """Return a key that is equal for cylinders with equal gas forces over their own angle."""
        return part.path, part.facing, part.bore, self

    def swept_volume(self, part: SliderCrank) -> float:
        """Return the volume that the gas of a slider-crank sweeps [m3]."""
        return part.swept.piston.piston_area * part.swept.piston.stroke

    def extremes(self, part: SliderCrank, cycle: Cycle, /) -> tuple[float, float, float]:
        """Return the largest pressure [Pa], its angle [rad], and the least pressure [Pa]."""
        cycle, pace = chamber_cycle_of(part, cycle)
        angles = cycle.angle / pace * np.arange(_STEPS) / _STEPS
        # at a dead centre the pressure is that after ignition
        pressures = self.pressure(part, cycle, angles + _ROUNDING)
        peak = int(np.argmax(pressures > (1.0 - _ROUNDING) * pressures.max()))
        return float(pressures[peak]), float(angles[peak]), float(pressures.min())

    def loaded(self, _pressures: Mapping[str, float], /) -> GasModel:
        """Return the gas with other pressures, whose names are in `loads` [Pa]."""
        return self

    def motored(self, _cycle: Cycle, /) -> GasModel | None:
        """Return the gas without combustion (G21): itself if nothing burns, None if the pressure is not known."""
        return None

    def cut(self, _has_open_valves: bool, /) -> GasModel | None:
        """Return the gas in cylinders whose valves are open to the intake, or closed (G21); None if not known."""
        return None

    def approximations(self, _cycle: Cycle, /) -> tuple[GasModel, GasModel]:
        """Return two other curves through measured points, whose change shows the error between points (F9a)."""
        return self, self


def chamber_cycle_of(part: SliderCrank, cycle: Cycle) -> tuple[Cycle, float]:
    """Return the cycle of a chamber in an engine with a cycle, and its crank angle over that of the engine (Y3)."""
    return type(cycle).FOUR_STROKE if part.swept.four_strokes else cycle, part.swept.pace


class OneChamber(GasModel):
    """Gas with one pressure in each cylinder."""

    @abstractmethod
    def cycle_pressure(self, piston: SliderCrank, cycle: Cycle, angles: Array, pace: float, /) -> Array:
        """Return the absolute pressure of a chamber [Pa] at crank angles after its firing, shape of `angles`.

        The cycle is that of the chamber, whose crank turns `pace` times as fast.
        """

    @abstractmethod
    def cycle_breaks(self, piston: SliderCrank, cycle: Cycle, pace: float, /) -> Array:
        """Return the angles after firing at which a derivative of `cycle_pressure` jumps [rad] (G13)."""

    def pressure(self, part: SliderCrank, cycle: Cycle, angles: Array, /) -> Array:
        """Return the absolute cylinder pressure [Pa], shape of `angles` (Y3)."""
        self.check(part)
        cycle, pace = chamber_cycle_of(part, cycle)
        return self.cycle_pressure(part.swept.chamber, cycle, angles - part.swept.firing_delay, pace)

    def breaks(self, part: SliderCrank, cycle: Cycle) -> Array:
        """Return the angles at which a derivative of the pressure jumps [rad] (G13)."""
        cycle, pace = chamber_cycle_of(part, cycle)
        places = self.cycle_breaks(part.swept.chamber, cycle, pace)
        return np.ravel(places[:, None] + part.swept.firing_delay - np.array(part.swept.lags))


@dataclass(frozen=True)
class CylinderGases(GasModel):
    """Gas of an engine whose cylinders differ: the common model, and models of single cylinders by their names."""

    common: GasModel
    single: tuple[tuple[str, GasModel], ...]

    @property
    def models(self) -> tuple[GasModel, ...]:
        """Models of all cylinders, each once."""
        return tuple(dict.fromkeys((self.common, *(model for _, model in self.single))))

    def of_cylinder(self, name: str, /) -> GasModel:
        """Return the model of a cylinder."""
        return dict(self.single).get(name, self.common)

    def only(self, name: str, /) -> GasModel | None:
        """Return the gas of this cylinder alone."""
        return self.of_cylinder(name).only(name)

    def mapped(self, change: Callable[[GasModel], GasModel]) -> CylinderGases:
        """Return the gas with the model of every cylinder changed."""
        return CylinderGases(change(self.common), tuple((name, change(gas)) for name, gas in self.single))

    def shares(self, engine: Engine) -> Sequence[tuple[str, GasModel, Sequence[SliderCrank]]]:
        """Return the gas of every cylinder that fires."""
        gases = [(part, self.of_cylinder(part.name)) for part in engine.cylinders]
        return [(part.name, gas, [part]) for part, gas in gases if gas.fires]

    def check(self, part: SliderCrank, /) -> None:
        """Raise `ModelError` if the gas of a slider-crank does not fit it."""
        self.of_cylinder(part.name).check(part)

    def pressure(self, part: SliderCrank, cycle: Cycle, angles: Array, /) -> Array:
        """Return the pressure in this cylinder [Pa]."""
        return self.of_cylinder(part.name).pressure(part, cycle, angles)

    def thrust(self, part: SliderCrank, cycle: Cycle, angles: Array, /) -> Array:
        """Return the force of the gas of this cylinder [N]."""
        return self.of_cylinder(part.name).thrust(part, cycle, angles)

    def breaks(self, part: SliderCrank, cycle: Cycle) -> Array:
        """Return the breaks of the gas of this cylinder [rad]."""
        return self.of_cylinder(part.name).breaks(part, cycle)

    def alike(self, part: SliderCrank) -> Hashable:
        """Return the key of the gas of this cylinder."""
        return self.of_cylinder(part.name).alike(part)

    def approximations(self, cycle: Cycle, /) -> tuple[GasModel, GasModel]:
        """Return the gas with two other curves through the measured points of every cylinder (F9a)."""
        first = self.mapped(lambda gas: gas.approximations(cycle)[0])
        return first, self.mapped(lambda gas: gas.approximations(cycle)[1])

    def motored(self, cycle: Cycle, /) -> CylinderGases | None:
        """Return the gas without combustion in every cylinder; None if that of one cylinder is not known."""
        gases = [(name, gas.motored(cycle)) for name, gas in self.single]
        common, known = self.common.motored(cycle), [(name, gas) for name, gas in gases if gas is not None]
        return CylinderGases(common, tuple(known)) if common and len(known) == len(gases) else None


def check_pressures(gas: object, *names: str) -> None:
    """Raise `ModelError` if one of the pressures `names` of a gas model is not positive and finite."""
    for name in names:
        pressure = getattr(gas, name)
        if not 0.0 < pressure < math.inf:
            raise ModelError(f"{name} {pressure * 1e-5:g} bar must be positive and finite; give an absolute pressure")
