"""Results whose proof is withheld, for a bound of theirs contradicts a known design."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.errors import BoundError
from laufruhe.prove.certificate import Certificate, Proof, unproven_certificate
from laufruhe.solvers.result import Result, Status

STATUS = {Status.OPTIMAL: Status.FEASIBLE, Status.INFEASIBLE: Status.FAILED}
"""What is left of a status that was proven."""


def without_proof(result: Result, error: BoundError) -> Result:
    """Return a result that claims nothing of other designs, with both numbers that contradict each other."""
    value = result.objective.value if result.objective is not None else 0.0
    why = f"its proof is withheld: {error}; please report it, with the problem file"
    details = result.phasing
    if details is not None:
        ranking = tuple(replace(star, lower_bound=0.0, proven=False) for star in details.ranking)
        trade = tuple(replace(point, lower_bound=0.0) for point in details.trade)
        details = replace(details, ranking=ranking, trade=trade)
    return replace(
        result,
        status=STATUS.get(result.status, result.status),
        certificate=_without_bound(result.certificate, value),
        message="; ".join(filter(None, (result.message, why))),
        conflict=(),
        ranks=tuple(replace(rank, lower_bound=0.0, gap=1.0, proof=Proof.NONE) for rank in result.ranks),
        phasing=details,
    )


def _without_bound(own: Certificate | None, value: float) -> Certificate | None:
    return None if own is None else unproven_certificate(value, own.kkt_residual, own.method)
