"""Withdraw the proof of a result whose lower bound contradicts a known design."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.errors import BoundError
from laufruhe.prove.certificate import Certificate, Proof, unproven_certificate
from laufruhe.solvers.result import Result, Status

STATUS = {Status.OPTIMAL: Status.FEASIBLE, Status.INFEASIBLE: Status.FAILED}
"""Status without proof, by the proven one."""


def without_proof(result: Result, error: BoundError) -> Result:
    """Return a result without any bound; its message states the contradiction between bound and design."""
    value = result.objective.value if result.objective is not None else 0.0
    reason = f"its proof is withheld: {error}; please report it, with the problem file"
    phasing = result.phasing
    if phasing is not None:
        ranking = tuple(replace(star, lower_bound=0.0, proven=False) for star in phasing.ranking)
        trade = tuple(replace(point, lower_bound=0.0) for point in phasing.trade)
        phasing = replace(phasing, ranking=ranking, trade=trade)
    return replace(
        result,
        status=STATUS.get(result.status, result.status),
        certificate=_without_bound(result.certificate, value),
        message="; ".join(filter(None, (result.message, reason))),
        conflict=(),
        ranks=tuple(replace(rank, lower_bound=0.0, gap=1.0, proof=Proof.NONE) for rank in result.ranks),
        phasing=phasing,
    )


def _without_bound(certificate: Certificate | None, value: float) -> Certificate | None:
    return None if certificate is None else unproven_certificate(value, certificate.kkt_residual, certificate.method)
