"""Rotary engines: rotors with three flanks on eccentrics, each in a housing of two lobes (Y1 to Y6)."""

from laufruhe.extension import Extension

EXTENSION = Extension(
    "rotary",
    layouts=("laufruhe.extensions.rotary.layout:ROTARY",),
    channels=(
        "laufruhe.extensions.rotary.apexes:APEX_SPEED",
        "laufruhe.extensions.rotary.apexes:APEX_ACCELERATION",
    ),
    dependences=(
        "apex speed  0 0 0  0 0 0  0  0 0  flywheel=0 torsion=0",
        "apex acceleration  0 0 0  0 0 0  0  0 0  flywheel=0 torsion=0",
    ),
    sections=("laufruhe.extensions.rotary.chambers:SECTION",),
    pictures=("laufruhe.extensions.rotary.chambers:PICTURE",),
)
