"""What the engine is: slider-cranks and rotors on a block on mounts, in SI (C1)."""

from laufruhe.machine.bearing import Bearing
from laufruhe.machine.block import Block
from laufruhe.machine.engine import Cycle, Engine, OperatingPoint
from laufruhe.machine.gas import Charge, GasModel, PressureTrace, Seiliger, Wiebe
from laufruhe.machine.mount import Mount
from laufruhe.machine.rotor import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.machine.slider_crank import Rod, SliderCrank
from laufruhe.machine.torsion import Absorber, Disc, Section, Torsion

__all__ = [
    "CRANKSHAFT",
    "Absorber",
    "Bearing",
    "Block",
    "Charge",
    "Cycle",
    "Disc",
    "Engine",
    "GasModel",
    "Mount",
    "OperatingPoint",
    "PressureTrace",
    "Rod",
    "Role",
    "Rotor",
    "Section",
    "Seiliger",
    "Shaft",
    "SliderCrank",
    "Torsion",
    "Wiebe",
]
