"""Method for discs, shafts and absorbers of the crankshaft, one row of the table of methods."""

from __future__ import annotations

from laufruhe.extensions.torsion.channels import ABSORBER_HEAT, FACTORS, RESONANCES
from laufruhe.extensions.torsion.machine import TORSION
from laufruhe.problem.channels import CHANNELS
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import Method, imported, is_pointwise

_OF_INERTIA = (channel for channel in CHANNELS.values() if channel.inertia_value is not None)
METHOD = Method(
    "boxes of discs and shafts", {TORSION: ()}, ProofStrength.PARTIAL,
    imported("laufruhe.extensions.torsion.solver:solve_torsion"),
    refines_fidelity=True,
    known_channels=frozenset({*FACTORS, *RESONANCES, ABSORBER_HEAT, *_OF_INERTIA}),
    accepts_norm=is_pointwise,
    proves="the optimum of root mean squares of two or three; else a local one",
    before="independent numbers separately",
)  # fmt: skip
