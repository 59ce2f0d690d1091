"""The engine: slider-cranks and rotors on a block on mounts, in SI units (C1)."""

from laufruhe.machine.bearing import Bearing
from laufruhe.machine.block import Block
from laufruhe.machine.bodies import Rod
from laufruhe.machine.chambers import Chamber, Chambers, GasModel, Pump, Steam
from laufruhe.machine.engine import Cycle, Engine, OperatingPoint
from laufruhe.machine.flywheel import Arms, Flywheel, Rim
from laufruhe.machine.gas import Charge, PressureTrace, Seiliger, Wiebe
from laufruhe.machine.geared import GearedInertia
from laufruhe.machine.mount import Mount
from laufruhe.machine.rotor import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.machine.running_gear import Bolts, PistonPin, RunningGear, Shank, Webs
from laufruhe.machine.slider_crank import SliderCrank

__all__ = [
    "CRANKSHAFT",
    "Arms",
    "Bearing",
    "Block",
    "Bolts",
    "Chamber",
    "Chambers",
    "Charge",
    "Cycle",
    "Engine",
    "Flywheel",
    "GasModel",
    "GearedInertia",
    "Mount",
    "OperatingPoint",
    "PistonPin",
    "PressureTrace",
    "Pump",
    "Rim",
    "Rod",
    "Role",
    "Rotor",
    "RunningGear",
    "Seiliger",
    "Shaft",
    "Shank",
    "SliderCrank",
    "Steam",
    "Webs",
    "Wiebe",
]
