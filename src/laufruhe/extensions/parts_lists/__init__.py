"""Parts from lists of makers: the best rows, with a proof over all combinations of rows."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.parts_lists"
EXTENSION = Extension(
    "parts_lists",
    channels=(f"{_HERE}.price:PARTS_PRICE",),
    dependences=("parts price  0 0 0  0 0 0  0  0 0  flywheel=0 torsion=0",),
    keys=(f"{_HERE}.file:CHOICES", f"{_HERE}.file:PRICE"),
    reductions=(f"{_HERE}.solver:REDUCTION",),
    sections=(f"{_HERE}.section:SECTION",),
)
