"""Objectives and limits of a problem in code.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Literal, Self, TypeAlias

from laufruhe.problem.number_types import Number, Table, Value, Values

QuantityName: TypeAlias = Literal[
    "mean mount force", "maximum mount force", "rms mount force", "peak to peak mount force", "rmq mount force",
    "worst mean mount force", "mean resultant mount force", "maximum resultant mount force",
    "rms resultant mount force", "peak to peak resultant mount force", "rmq resultant mount force",
    "worst mean resultant mount force", "mean mount travel", "maximum mount travel", "rms mount travel",
    "peak to peak mount travel", "rmq mount travel", "worst mean mount travel", "mean shaking force",
    "maximum shaking force", "rms shaking force", "peak to peak shaking force", "rmq shaking force",
    "worst mean shaking force", "mean rocking couple", "maximum rocking couple", "rms rocking couple",
    "peak to peak rocking couple", "rmq rocking couple", "worst mean rocking couple", "mean roll moment",
    "maximum roll moment", "rms roll moment", "peak to peak roll moment", "rmq roll moment", "worst mean roll moment",
    "mean surging force", "maximum surging force", "rms surging force", "peak to peak surging force",
    "rmq surging force", "worst mean surging force", "mean swaying couple", "maximum swaying couple",
    "rms swaying couple", "peak to peak swaying couple", "rmq swaying couple", "worst mean swaying couple",
    "mean crank torque", "maximum crank torque", "rms crank torque", "peak to peak crank torque", "rmq crank torque",
    "worst mean crank torque", "mean stored work", "maximum stored work", "rms stored work", "peak to peak stored work",
    "rmq stored work", "worst mean stored work", "mean hammer blow", "maximum hammer blow", "rms hammer blow",
    "peak to peak hammer blow", "rmq hammer blow", "worst mean hammer blow", "mean main-bearing force",
    "maximum main-bearing force", "rms main-bearing force", "peak to peak main-bearing force", "rmq main-bearing force",
    "worst mean main-bearing force", "mean main-bearing pressure", "maximum main-bearing pressure",
    "rms main-bearing pressure", "peak to peak main-bearing pressure", "rmq main-bearing pressure",
    "worst mean main-bearing pressure", "mean crank-pin force", "maximum crank-pin force", "rms crank-pin force",
    "peak to peak crank-pin force", "rmq crank-pin force", "worst mean crank-pin force", "mean crank-pin pressure",
    "maximum crank-pin pressure", "rms crank-pin pressure", "peak to peak crank-pin pressure", "rmq crank-pin pressure",
    "worst mean crank-pin pressure", "mean rod force", "maximum rod force", "rms rod force", "peak to peak rod force",
    "rmq rod force", "worst mean rod force", "mean side force", "maximum side force", "rms side force",
    "peak to peak side force", "rmq side force", "worst mean side force", "mean friction power", "mean electric torque",
    "maximum electric torque", "rms electric torque", "peak to peak electric torque", "rmq electric torque",
    "worst mean electric torque", "mean receiver acceleration", "maximum receiver acceleration",
    "rms receiver acceleration", "peak to peak receiver acceleration", "rmq receiver acceleration",
    "worst mean receiver acceleration", "mean receiver velocity", "maximum receiver velocity", "rms receiver velocity",
    "peak to peak receiver velocity", "rmq receiver velocity", "worst mean receiver velocity", "mean receiver pressure",
    "maximum receiver pressure", "rms receiver pressure", "peak to peak receiver pressure", "rmq receiver pressure",
    "worst mean receiver pressure", "mean crank-pin bending stress", "maximum crank-pin bending stress",
    "rms crank-pin bending stress", "peak to peak crank-pin bending stress", "rmq crank-pin bending stress",
    "worst mean crank-pin bending stress", "mean web stress", "maximum web stress", "rms web stress",
    "peak to peak web stress", "rmq web stress", "worst mean web stress", "mean journal torsion stress",
    "maximum journal torsion stress", "rms journal torsion stress", "peak to peak journal torsion stress",
    "rmq journal torsion stress", "worst mean journal torsion stress", "mean journal stress", "maximum journal stress",
    "rms journal stress", "peak to peak journal stress", "rmq journal stress", "worst mean journal stress",
    "mean main-bearing pressure times speed", "maximum main-bearing pressure times speed",
    "rms main-bearing pressure times speed", "peak to peak main-bearing pressure times speed",
    "rmq main-bearing pressure times speed", "worst mean main-bearing pressure times speed", "mean rod stress",
    "maximum rod stress", "rms rod stress", "peak to peak rod stress", "rmq rod stress", "worst mean rod stress",
    "mean share of the buckling load", "maximum share of the buckling load", "rms share of the buckling load",
    "peak to peak share of the buckling load", "rmq share of the buckling load",
    "worst mean share of the buckling load", "mean bolt stress", "maximum bolt stress", "rms bolt stress",
    "peak to peak bolt stress", "rmq bolt stress", "worst mean bolt stress", "mean piston-pin pressure",
    "maximum piston-pin pressure", "rms piston-pin pressure", "peak to peak piston-pin pressure",
    "rmq piston-pin pressure", "worst mean piston-pin pressure", "mean piston-pin bending stress",
    "maximum piston-pin bending stress", "rms piston-pin bending stress", "peak to peak piston-pin bending stress",
    "rmq piston-pin bending stress", "worst mean piston-pin bending stress", "mean piston-pin deflection",
    "maximum piston-pin deflection", "rms piston-pin deflection", "peak to peak piston-pin deflection",
    "rmq piston-pin deflection", "worst mean piston-pin deflection", "mean piston-pin ovality",
    "maximum piston-pin ovality", "rms piston-pin ovality", "peak to peak piston-pin ovality", "rmq piston-pin ovality",
    "worst mean piston-pin ovality", "mean shaft twist", "maximum shaft twist", "rms shaft twist",
    "peak to peak shaft twist", "rmq shaft twist", "worst mean shaft twist", "mean shaft torque",
    "maximum shaft torque", "rms shaft torque", "peak to peak shaft torque", "rmq shaft torque",
    "worst mean shaft torque", "mean shaft stress", "maximum shaft stress", "rms shaft stress",
    "peak to peak shaft stress", "rmq shaft stress", "worst mean shaft stress", "counterweight mass", "balancer mass",
    "added mass", "transmissibility", "static sag", "natural frequencies", "motion frequencies",
    "kinetic-energy decoupling", "decoupling shortfall", "torque-roll residual", "raw torque-roll residual",
    "total stiffness", "static travel", "static mount force", "degree of irregularity", "flywheel inertia",
    "flywheel mass", "rim stress", "arm stress", "shaft distance", "shaft clearance", "envelope radius", "parts price",
    "piston travel", "mean piston speed", "piston speed", "piston acceleration", "rod angle", "rod length",
    "side-force reversal rate", "apex speed", "apex acceleration", "run-up force", "run-up travel", "run-up twist",
    "throw clearance", "running-gear mass", "torsional frequencies", "critical speeds", "absorber heat",
] | str
"""Quantities that may be minimised or limited; those of extensions of users are texts."""


class Goals(ABC):
    """Methods that add objectives and limits; each returns a new problem."""

    @abstractmethod
    def _with_goal(self, key: str, keys: Table, adds: bool) -> Self: ...

    def minimise(
        self, minimise: QuantityName | None = None, *, mounts: Sequence[str] | None = None,
        bearings: Sequence[str] | None = None, cylinders: Sequence[str] | None = None,
        sections: Sequence[str] | None = None, webs: Sequence[str] | None = None,
        receivers: Sequence[str] | None = None, electric_machines: Sequence[str] | None = None,
        operating_points: Sequence[str] | None = None, orders: Values | None = None, alternating: bool | None = None,
        direction_weights: Values | None = None, load_cases: Sequence[str] | None = None,
        motions: Sequence[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = None,
        wanted: Number | None = None, frequency: Value | None = None, terms: Sequence[Table] | None = None,
    ) -> Self:
        """Return the problem with this objective, in place of earlier ones."""
        return self._with_goal("objective", locals(), False)

    def then_minimise(
        self, minimise: QuantityName | None = None, *, mounts: Sequence[str] | None = None,
        bearings: Sequence[str] | None = None, cylinders: Sequence[str] | None = None,
        sections: Sequence[str] | None = None, webs: Sequence[str] | None = None,
        receivers: Sequence[str] | None = None, electric_machines: Sequence[str] | None = None,
        operating_points: Sequence[str] | None = None, orders: Values | None = None, alternating: bool | None = None,
        direction_weights: Values | None = None, load_cases: Sequence[str] | None = None,
        motions: Sequence[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = None,
        wanted: Number | None = None, frequency: Value | None = None, terms: Sequence[Table] | None = None,
        within: Number | None = None,
    ) -> Self:
        """Return the problem with one more objective, among the designs that are best by earlier ones.

        `within` is the share by which the objective before this one may exceed its least value.
        """
        return self._with_goal("objective", locals(), True)

    def limit(
        self, limit: QuantityName, *, mounts: Sequence[str] | None = None, bearings: Sequence[str] | None = None,
        cylinders: Sequence[str] | None = None, sections: Sequence[str] | None = None,
        webs: Sequence[str] | None = None, receivers: Sequence[str] | None = None,
        electric_machines: Sequence[str] | None = None, operating_points: Sequence[str] | None = None,
        orders: Values | None = None, alternating: bool | None = None, direction_weights: Values | None = None,
        load_cases: Sequence[str] | None = None,
        motions: Sequence[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = None,
        wanted: Number | None = None, frequency: Value | None = None, max: Number | None = None,
        min: Number | None = None, outside: Values | None = None, name: str | None = None,
        of: Sequence[str] | None = None,
    ) -> Self:
        """Return the problem with one more limit."""
        return self._with_goal("constraints", locals(), True)
