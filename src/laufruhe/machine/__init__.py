"""The engine: slider-cranks and rotors on a block on mounts, in SI units (C1)."""

import warnings
from typing import TYPE_CHECKING

from laufruhe.errors import LaufruheWarning
from laufruhe.extension import MOVED, object_at
from laufruhe.machine.block import Block
from laufruhe.machine.bodies import Rod
from laufruhe.machine.engine import Cycle, Engine, OperatingPoint
from laufruhe.machine.gas.base import GasModel
from laufruhe.machine.gas.charge import Charge, TrappedCharge
from laufruhe.machine.gas.seiliger import Seiliger
from laufruhe.machine.gas.wiebe import Wiebe
from laufruhe.machine.load_torque import LoadTorque
from laufruhe.machine.mount import Mount
from laufruhe.machine.rotor import CRANKSHAFT, GearedInertia, Role, Rotor, Shaft
from laufruhe.machine.slider_crank import SliderCrank

__all__ = [
    "CRANKSHAFT",
    "Block",
    "Charge",
    "Cycle",
    "Engine",
    "GasModel",
    "GearedInertia",
    "LoadTorque",
    "Mount",
    "OperatingPoint",
    "Rod",
    "Role",
    "Rotor",
    "Seiliger",
    "Shaft",
    "SliderCrank",
    "TrappedCharge",
    "Wiebe",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> type:
        """Return a class that an extension has now; warn about its new place."""
        if name not in MOVED:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        warnings.warn(f"laufruhe.machine.{name} is now {MOVED[name].replace(':', '.')}", LaufruheWarning, stacklevel=2)
        return object_at(MOVED[name])
