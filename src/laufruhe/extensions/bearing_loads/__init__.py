"""Loads of main bearings, crank pins and piston pins, with their pressure, friction power and hammer blow (B1-B11)."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.bearing_loads"
_CHANNELS = (
    "HAMMER_BLOW", "MAIN_BEARING_FORCE", "MAIN_BEARING_PRESSURE", "CRANK_PIN_FORCE", "CRANK_PIN_PRESSURE", "ROD_FORCE",
    "SIDE_FORCE", "FRICTION_POWER",
)  # fmt: skip
_OF_BEARINGS = ("main-bearing force", "main-bearing pressure", "hammer blow", "friction power")
_OF_PINS = ("crank-pin force", "crank-pin pressure", "side force", "rod force")
EXTENSION = Extension(
    "bearing_loads",
    keys=(f"{_HERE}.file:KEY",),
    channels=tuple(f"{_HERE}.channels:{name}" for name in _CHANNELS),
    dependences=(
        *(f"{name}  a a a  v m >  >  0 0  flywheel=0 torsion=0 electric_machines=0" for name in _OF_BEARINGS),
        *(f"{name}  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0" for name in _OF_PINS),
    ),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:PICTURE",),
)
