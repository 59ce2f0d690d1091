"""Method for open torques of electric machines, alone or with unbalances: all loads are affine in them."""

from __future__ import annotations

from laufruhe.extensions.electric_torque.machine import ELECTRIC_TORQUE
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import Method, imported

_AFFINE = (Dependence.AFFINE,)
CONES = Method(
    "second-order cones of electric torque",
    {Kind.UNBALANCE: _AFFINE, Kind.PISTON: _AFFINE, ELECTRIC_TORQUE: _AFFINE},
    ProofStrength.EXACT,
    imported("laufruhe.solvers.cones.unbalances:solve_unbalances"),
    refines_fidelity=True,
    before="stars, each with cones",
    proves="the optimum",
)
