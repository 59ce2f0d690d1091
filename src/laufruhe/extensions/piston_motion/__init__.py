"""Motion of pistons and rams: stroke, speed, acceleration, rod angle, and reversals of the side force (K19 to K21)."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.piston_motion"
_OF_SHAPE = ("piston travel", "mean piston speed", "piston speed", "piston acceleration", "rod angle", "rod length")
EXTENSION = Extension(
    "piston_motion",
    needs=("bearing_loads",),
    channels=tuple(
        f"{_HERE}.channels:{name}"
        for name in ("TRAVEL", "MEAN_SPEED", "SPEED", "ACCELERATION", "ROD_ANGLE", "ROD_LENGTH", "REVERSAL_RATE")
    ),
    dependences=(
        # an open rod length may be a size
        *(f"{name}  0 0 0  0 s 0  0  0 0  flywheel=0 torsion=0 electric_machines=0" for name in _OF_SHAPE),
        "side-force reversal rate  0 0 s  0 s s  s  0 0  flywheel=0 torsion=0 electric_machines=0",
    ),
    sections=(f"{_HERE}.section:SECTION",),
)
