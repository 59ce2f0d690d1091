"""Flywheel, evenness of the crank's speed, and torque of the crankshaft over the cycle (T1-T9, T13, T15)."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.flywheel"
_OF_WHEEL = ("flywheel inertia  0 0 0  0 0 0  0  0 0  torsion=+", "flywheel mass  0 0 0  0 0 0  0  0 0  torsion=0",
             "rim stress  0 0 0  0 0 0  0  0 0  torsion=0", "arm stress  0 0 0  0 s s  0  0 0  torsion=0")  # fmt: skip
EXTENSION = Extension(
    "flywheel",
    keys=(f"{_HERE}.file:KEY",),
    kinds=(f"{_HERE}.machine:FLYWHEEL",),
    channels=tuple(
        f"{_HERE}.channels:{name}"
        for name in ("IRREGULARITY", "FLYWHEEL_INERTIA", "FLYWHEEL_MASS", "RIM_STRESS", "ARM_STRESS")
    ),
    dependences=(
        "degree of irregularity  0 0 s  0 s w  w  0 0  flywheel=- torsion=- electric_machines=s",
        *(f"{line} flywheel=+ electric_machines=0" for line in _OF_WHEEL),
    ),
    methods=(f"{_HERE}.method:BOXES",),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:TORQUE",),
)
