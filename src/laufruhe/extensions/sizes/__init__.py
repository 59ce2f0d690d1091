"""Sizes of the running gear: their stresses, and proven optima of open sizes, also with stars."""

from laufruhe.extension import Extension

_HERE = "laufruhe.extensions.sizes"
_CHANNELS = (
    "CRANK_PIN_STRESS", "WEB_STRESS", "JOURNAL_TORSION", "JOURNAL_STRESS", "MAIN_BEARING_PV", "ROD_STRESS",
    "ROD_BUCKLING", "BOLT_STRESS", "PIN_PRESSURE", "PIN_STRESS", "PIN_DEFLECTION", "PIN_OVALITY", "THROW_CLEARANCE",
    "GEAR_MASS",
)  # fmt: skip
EXTENSION = Extension(
    "sizes",
    needs=("bearing_loads",),
    channels=tuple(f"{_HERE}.channels:{name}" for name in _CHANNELS),
    dependences=(
        "crank-pin bending stress  a 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "web stress  a a a  s m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "journal torsion stress  a a a  s m >  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "journal stress  a a a  s m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "main-bearing pressure times speed  a a a  v m >  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "rod stress  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "share of the buckling load  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "bolt stress  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "piston-pin pressure  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "piston-pin bending stress  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "piston-pin deflection  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "piston-pin ovality  0 0 a  0 m s  >  0 0  flywheel=0 torsion=0 electric_machines=0",
        "throw clearance  0 0 0  0 - 0  0  0 0  flywheel=0 torsion=0 electric_machines=0",
        "running-gear mass  0 0 0  0 + 0  0  0 0  flywheel=0 torsion=0 electric_machines=0",
    ),
    keys=(f"{_HERE}.file:KEY",),
    methods=(f"{_HERE}.methods:ALONE",),
)
