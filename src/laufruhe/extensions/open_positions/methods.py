"""Methods for open positions of unbalances."""

from __future__ import annotations

from functools import partial

from laufruhe.extensions.open_positions.channels import ENVELOPE_RADIUS, SHAFT_CLEARANCE, SHAFT_DISTANCE
from laufruhe.numerics.processes import call_by_name
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import OF_SIZES_ALONE, OF_TORQUE, Method, imported, is_pointwise

_HERE = "laufruhe.extensions.open_positions.solver"
_OF_SHAFTS = frozenset({SHAFT_DISTANCE, SHAFT_CLEARANCE, ENVELOPE_RADIUS})
_PLACED = {
    Kind.UNBALANCE: (Dependence.AFFINE,), Kind.PLACE: (Dependence.BIAFFINE, Dependence.KINKED),
}  # fmt: skip


BOXES = Method(
    "cones over boxes of places", _PLACED, ProofStrength.EXACT, imported(f"{_HERE}:solve_places"),
    refines_fidelity=True, known_channels=_OF_SHAFTS, accepts_norm=is_pointwise, before="stars, each with cones",
    proves="the optimum, as far as the boxes go (P8)",
)  # fmt: skip
CORNERS = Method(
    "local programs, places at their corners",
    {**_PLACED, Kind.PISTON: (Dependence.AFFINE,), Kind.SIZE: (Dependence.MASSES,), Kind.LEAD: (Dependence.SHIFT,)},
    ProofStrength.EXACT, imported(f"{_HERE}:solve_at_corners"),
    refines_fidelity=True, known_channels=_OF_SHAFTS | OF_SIZES_ALONE | OF_TORQUE,
    accepts_problem=partial(call_by_name, f"{_HERE}:is_exact_at_corners"), before="local programs of all numbers",
    proves="what is proven of the rest with places at the corners of their bounds (P20)",
)  # fmt: skip
