"""Torsional vibration of the crankshaft: discs, shafts and absorbers, their modes, stresses, decisions and bounds."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.torsion"
_CHANNELS = "SHAFT_TWIST", "SHAFT_TORQUE", "SHAFT_STRESS", "TORSIONAL_FREQUENCIES", "CRITICAL_SPEEDS", "ABSORBER_HEAT"
EXTENSION = Extension(
    "torsion",
    keys=(f"{_HERE}.file:KEY",),
    kinds=(f"{_HERE}.machine:TORSION",),
    channels=tuple(f"{_HERE}.channels:{name}" for name in _CHANNELS),
    dependences=(
        "shaft twist            0 0 s  0 s 0  >  0 0  flywheel=0 torsion=s electric_machines=a",
        "shaft torque           0 0 s  0 s 0  >  0 0  flywheel=0 torsion=s electric_machines=a",
        "shaft stress           0 0 s  0 s 0  >  0 0  flywheel=0 torsion=s electric_machines=a",
        "torsional frequencies  0 0 s  0 s 0  0  0 0  flywheel=0 torsion=s electric_machines=0",
        "critical speeds        0 0 s  0 s 0  0  0 0  flywheel=0 torsion=s electric_machines=0",
        "absorber heat          0 0 s  0 s 0  w  0 0  flywheel=0 torsion=s electric_machines=s",
    ),
    methods=(f"{_HERE}.method:METHOD",),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:MODES", f"{_HERE}.section:RESPONSE"),
)
