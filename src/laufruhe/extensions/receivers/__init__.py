"""Receivers: acceleration, velocity or sound pressure at a driver's hands, seat or ear, weighted as people feel it."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.receivers"
EXTENSION = Extension(
    "receivers",
    keys=(f"{_HERE}.file:FRAME", f"{_HERE}.file:RECEIVERS"),
    channels=tuple(f"{_HERE}.channels:{name}" for name in ("ACCELERATION", "VELOCITY", "PRESSURE")),
    dependences=tuple(
        f"receiver {quantity}  a a a  b m >  >  s s  flywheel=0 torsion=0 electric_machines=a"
        for quantity in ("acceleration", "velocity", "pressure")
    ),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:PICTURE",),
)
