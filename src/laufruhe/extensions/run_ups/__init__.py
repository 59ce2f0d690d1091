"""Run-up and shut-down through resonance: [run_up] of a file, solvers and bounds, tables and picture."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.run_ups"
EXTENSION = Extension(
    "run_ups",
    channels=(f"{_HERE}.channels:FORCE", f"{_HERE}.channels:TRAVEL", f"{_HERE}.channels:TWIST"),
    dependences=tuple(
        f"run-up {number}  s s s  s s s  s  s s  flywheel=s torsion=s" for number in ("force", "travel", "twist")
    ),
    keys=(f"{_HERE}.file:KEY",),
    reductions=(f"{_HERE}.reduction:REDUCTION",),
    sections=(f"{_HERE}.section:SECTION",),
    pictures=(f"{_HERE}.section:PICTURE",),
)
