"""Method for open numbers of the flywheel."""

from __future__ import annotations

from laufruhe.extensions.flywheel.channels import OF_FLYWHEEL
from laufruhe.extensions.flywheel.machine import FLYWHEEL
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import Method, imported

BOXES = Method(
    "boxes of the flywheel", {FLYWHEEL: ()}, ProofStrength.EXACT,
    imported("laufruhe.extensions.flywheel.solver:solve_flywheel"),
    known_channels=frozenset(OF_FLYWHEEL), accepts_constant=lambda _: False, before="second-order cones",
    proves="the optimum",
)  # fmt: skip
