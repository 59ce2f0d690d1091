"""Methods for open lead angles of shafts."""

from __future__ import annotations

from laufruhe.problem.channels import MOUNT_FORCE, OF_BLOCK
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import OF_TORQUE, Method, imported, is_no_number, is_pointwise

_SOLVER, _NEXT = "laufruhe.extensions.phase_leads.solver", "stars, each with cones"

SHIFTED_LOADS = Method(
    "boxes of leads", {Kind.UNBALANCE: (Dependence.AFFINE,), Kind.LEAD: (Dependence.SHIFT,)}, ProofStrength.EXACT,
    imported(f"{_SOLVER}:solve_leads"),
    refines_fidelity=True, known_channels=OF_TORQUE, accepts_norm=is_pointwise,
    accepts_constant=is_no_number, before=_NEXT,
    proves="the optimum, as far as the boxes go (P13)",
)  # fmt: skip
SHARED_CHAMBERS = Method(
    "boxes of leads between shared chambers", {Kind.LEAD: ()}, ProofStrength.EXACT,
    imported(f"{_SOLVER}:solve_shared_leads"),
    refines_fidelity=True, known_channels=frozenset({MOUNT_FORCE, *OF_BLOCK}), accepts_norm=is_pointwise,
    accepts_constant=is_no_number, before=_NEXT,
    accepts_problem=lambda p: p.engine.block is None and not p.fidelity.has_uneven_speed,
    proves="the optimum, as far as the boxes go (P15)",
)  # fmt: skip
