"""A whole problem file (docs/reference/problem-files.md)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from laufruhe.files import fields as f
from laufruhe.files.asked import ConstraintTable, ObjectiveTable
from laufruhe.files.assembly import AssemblyTable
from laufruhe.files.bearings import MainBearingTable
from laufruhe.files.engine import EngineTable
from laufruhe.files.fidelity import FidelityTable
from laufruhe.files.fields import Table
from laufruhe.files.flywheel import FlywheelTable
from laufruhe.files.friction import FrictionTable
from laufruhe.files.gas import GasTable
from laufruhe.files.geared import GearedInertiaTable
from laufruhe.files.load_cases import LoadCaseTable
from laufruhe.files.mounts import BlockTable, MountsTable
from laufruhe.files.operating_points import OperatingPointTable
from laufruhe.files.phasing import PhasingTable
from laufruhe.files.quantities import QuantitiesTable
from laufruhe.files.rotors import BalancerShaftTable, CounterweightTable
from laufruhe.files.run_up import RunUpTable
from laufruhe.files.running_gear import RunningGearTable
from laufruhe.files.tolerances import RobustTable, TolerancesTable
from laufruhe.files.torsion import TorsionTable

SCHEMA = "laufruhe.schema.json"


class SearchTable(Table):
    """How far a search goes where the problem is not convex."""

    closed: ClassVar[str] = "says how a search goes, not what the engine is"

    starts: int = Field(default=16, ge=1, le=10_000)
    seed: int = Field(default=0, ge=0)
    boxes: int | None = Field(
        default=None,
        ge=0,
        le=1_000_000,
        description="Number of boxes into which bounds may be divided for a proof; 0 for none.",
    )


class ProblemFile(Table):
    """A whole problem file."""

    title: str = Field(min_length=1)
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    tolerance: f.Tolerance = f.told("Relative gap at which an optimum counts as proven.", 1e-4)
    engine: EngineTable
    quantities: QuantitiesTable | None = None
    phasing: PhasingTable | None = None
    operating_points: list[OperatingPointTable] = Field(min_length=1)
    gas: GasTable | None = None
    friction: FrictionTable | None = None
    mounts: MountsTable | None = None
    block: BlockTable | None = None
    run_up: RunUpTable | None = None
    load_cases: list[LoadCaseTable] = Field(default_factory=list)
    main_bearings: list[MainBearingTable] = Field(default_factory=list)
    running_gear: RunningGearTable | None = None
    torsion: TorsionTable | None = None
    flywheel: FlywheelTable | None = None
    geared_inertias: list[GearedInertiaTable] = Field(default_factory=list)
    counterweights: list[CounterweightTable] = Field(default_factory=list)
    balancer_shafts: list[BalancerShaftTable] = Field(default_factory=list)
    objective: Annotated[list[ObjectiveTable], f.OneOrEach(ObjectiveTable)] | None = f.told(
        "What is minimised; of several tables in order, each among the designs that are best by those before it."
    )
    constraints: list[ConstraintTable] = Field(default_factory=list)
    fidelity: FidelityTable = Field(default_factory=FidelityTable)
    search: SearchTable = Field(default_factory=SearchTable)
    tolerances: TolerancesTable | None = None
    robust: RobustTable | None = None
    assembly: AssemblyTable | None = None

    @property
    def single(self) -> list[str]:
        """What stands here that needs a single objective only."""
        given = [key for key in ("assembly", "robust") if getattr(self, key) is not None]
        return [*given, *(["fidelity.kinematics"] if self.fidelity.kinematics == "auto" else [])]
