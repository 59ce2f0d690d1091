"""Electric machines on the crank or on a geared shaft: their torque by order, with limits, as open numbers (T16)."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.electric_torque"
_AFFINE = ("roll moment", "mount force", "resultant mount force", "mount travel", "stored work")
_SMOOTH = ("transmissibility",)
_FREE = (
    "shaking force", "rocking couple", "surging force", "swaying couple", "crank torque",
    "counterweight mass", "balancer mass", "added mass", "static sag", "natural frequencies", "motion frequencies",
    "kinetic-energy decoupling", "decoupling shortfall", "torque-roll residual", "raw torque-roll residual",
    "total stiffness", "static travel", "static mount force",
)  # fmt: skip
EXTENSION = Extension(
    "electric_torque",
    keys=(f"{_HERE}.file:KEY",),
    kinds=(f"{_HERE}.machine:ELECTRIC_TORQUE",),
    channels=(f"{_HERE}.channels:ELECTRIC_TORQUE",),
    dependences=(
        "electric torque  0 0 0  0 0 0  0  0 0  flywheel=0 torsion=0 electric_machines=a",
        *(
            f"{name}  electric_machines={letter}"
            for letter, names in (("a", _AFFINE), ("s", _SMOOTH), ("0", _FREE))
            for name in names
        ),
    ),
    methods=(f"{_HERE}.method:CONES",),
    sections=(f"{_HERE}.section:SECTION",),
)
