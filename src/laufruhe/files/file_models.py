"""The problem file, key by key: what may stand where (docs/problem-files.md)."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import BaseModel, Field, create_model

from laufruhe.fidelity.knobs import KNOBS
from laufruhe.files import fields as f
from laufruhe.files.engine_table import EngineTable
from laufruhe.files.fields import Name, Table
from laufruhe.files.rotors import BalancerShaftTable, CounterweightTable
from laufruhe.problem.measure import MEASURES

QuantityName: TypeAlias = Annotated[str, Field(json_schema_extra={"enum": list(MEASURES)})]
Place: TypeAlias = Annotated[list[f.Length], Field(min_length=3, max_length=3)]
Triple: TypeAlias = Annotated[list[f.NonNegative], Field(min_length=3, max_length=3)]
T = TypeVar("T", bound=BaseModel)


class IntervalsTable(Table):
    """Bounds on the crank angle from each firing to the next."""

    min: f.Angle | None = None
    max: f.Angle | None = None
    largest_deviation: f.Angle | None = Field(default=None, description="From equal intervals.")


class PhasingTable(Table):
    """How open throws, firing orders and shafts are decided."""

    phases: Annotated[int, Field(ge=1, le=96)] | None = Field(
        default=None, description="Equal steps of a turn that throws stand on; those of even firing where left out."
    )
    intervals: IntervalsTable | None = Field(default=None, description="Even firing where left out.")
    best: Annotated[int, Field(ge=1, le=200)] = Field(default=10, description="How many stars are ranked.")
    rank_orders_by: list[Literal["roll moment", "neighbours", "longest gap"]] = Field(
        default=["neighbours", "longest gap"], min_length=1, description="Of firing orders; the first counts most."
    )
    most_shafts: Annotated[int, Field(ge=0, le=48)] | None = Field(
        default=None, description="Optional balancer shafts that may be built."
    )
    most_shaft_mass: f.Mass | None = Field(default=None, description="Of the optional shafts that are built.")
    time_limit: f.Time = Field(default=600.0, description="Of the search.")
    method: Literal["auto", "search", "program", "enumeration"] = "auto"


class OperatingPointTable(Table):
    """A speed and a load."""

    name: Name | None = None
    speed: f.Speed | None = None
    mean_piston_speed: f.PistonSpeed | None = None
    imep: f.Pressure | None = Field(default=None, description="In place of that of [gas].")
    motored: bool = Field(default=False, description="The charge is compressed and gets no heat.")
    gas: bool = Field(default=True, description="false leaves the gas out altogether.")
    up_to: f.Speed | None = Field(default=None, description="Last speed of a range that starts at speed.")
    steps: Annotated[int, Field(ge=2, le=1000)] | None = Field(default=None, description="Speeds in the range.")
    weight: f.Positive = 1.0


class ChargeTable(Table):
    """What every computed cycle says of the charge and of the gas exchange."""

    compression_ratio: f.Positive | None = None
    intake_pressure: f.PositivePressure | None = None
    exhaust_pressure: f.PositivePressure | None = None
    crankcase_pressure: f.PositivePressure | None = None


class SeiligerTable(ChargeTable):
    """Mixed cycle, its cut-off solved for the indicated mean pressure."""

    model: Literal["seiliger"]
    peak_pressure: f.PositivePressure
    imep: f.Pressure
    compression_exponent: f.Positive | None = None
    expansion_exponent: f.Positive | None = None


class WiebeTable(ChargeTable):
    """Finite heat release, the heat solved for the indicated mean pressure."""

    model: Literal["wiebe"]
    imep: f.Pressure
    start: f.Angle
    duration: f.Angle
    shape: f.NonNegative | None = None
    completeness: f.Positive | None = None
    heat_ratio: f.Positive | None = None


class TraceTable(Table):
    """A measured trace: a CSV file of crank angle after the firing dead centre and absolute pressure."""

    model: Literal["trace"]
    file: str
    pressure_unit: str = "bar"
    angle_unit: str = "deg"
    crankcase_pressure: f.PositivePressure | None = None


GasTable: TypeAlias = Annotated[SeiligerTable | WiebeTable | TraceTable, Field(discriminator="model")]


class BlockTable(Table):
    """The rigid body that elastic mounts carry."""

    mass: f.PositiveMass = Field(description="Everything that the mounts carry, moving parts included.")
    centre_of_gravity: Place = Field(default=[0.0, 0.0, 0.0])
    inertia: Annotated[list[f.Inertia], Field(min_length=3, max_length=3)] = Field(
        description="About x, y and z through the centre of gravity."
    )
    inertia_products: Annotated[list[f.Inertia], Field(min_length=3, max_length=3)] = Field(
        default=[0.0, 0.0, 0.0], description="Entries xy, xz, yz of the tensor: xy = - integral of x y dm."
    )


class StopTable(Table):
    """A bump stop along each of the mount's own axes; it acts in run-ups."""

    gap: f.PositiveLength
    stiffness: f.Stiffness


class MountTable(Table):
    """One mount."""

    name: Name | None = None
    position: Annotated[list[f.OpenLength], Field(min_length=3, max_length=3)] | None = None
    relative_stiffness: Triple | None = Field(default=None, description="Along its own x, y, z; 0 carries nothing.")
    turned: Annotated[list[f.OpenAngle], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="Turns about x, then y, then z that bring the axes of C2 to its own."
    )
    stiffness: Annotated[list[f.OpenStiffness], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="Along its own x, y, z."
    )
    loss_factor: f.OpenLossFactor | None = Field(
        default=None, description="Damping work over deformation work over 2 pi."
    )
    damping: Annotated[list[f.OpenDamping], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="Viscous, along its own x, y, z."
    )
    like: Name | None = Field(default=None, description="Stiffness, loss and damping follow those of this mount.")
    mirror_of: Name | None = Field(default=None, description="All follows this mount, mirrored in the plane y = 0.")
    stop: StopTable | None = None


class MountsTable(Table):
    """How the engine is held."""

    kind: Literal["rigid", "elastic"] = "rigid"
    positions: list[Place] = Field(default_factory=list)
    names: list[Name] | None = None
    relative_stiffness: Triple = Field(default=[0.0, 1.0, 1.0], description="Of every rigid mount that gives none.")
    stiffness: Annotated[list[f.Stiffness], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="Of every elastic mount that gives none."
    )
    loss_factor: f.LossFactor = Field(default=0.0, description="Of every elastic mount that gives none.")
    stop: StopTable | None = None
    places: list[MountTable] = Field(default_factory=list)


class QuantityTable(Table):
    """What part of a quantity counts."""

    mounts: list[str] | None = None
    operating_points: list[str] | None = None
    orders: list[f.NonNegative] | None = None
    direction_weights: Triple | None = None
    motions: list[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = Field(
        default=None, description="That are to have a mode of their own."
    )
    frequency: f.Frequency | None = Field(default=None, description="Wanted about the torque-roll axis.")


class TermTable(QuantityTable):
    """One part of a weighted objective."""

    quantity: QuantityName
    weight: f.Positive = 1.0


class ObjectiveTable(QuantityTable):
    """What is to be least: one quantity, or a weighted sum of terms."""

    minimise: QuantityName | None = None
    terms: list[TermTable] = Field(default_factory=list)


class ConstraintTable(QuantityTable):
    """A limit on a quantity."""

    limit: QuantityName
    max: f.Side | None = Field(default=None, description="With the unit of the quantity.", examples=["6 kg"])
    min: f.Side | None = Field(default=None, description="Of natural frequencies, decoupling or sag.")
    outside: Annotated[list[f.Side], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="A band that holds no natural frequency.", examples=[["12 Hz", "20 Hz"]]
    )
    name: Name | None = None
    of: list[str] | None = Field(default=None, description="Counterweights or balancers whose mass counts.")


def _with_knobs(table: type[T]) -> type[T]:
    """A table with a key for every choice of fidelity that it does not name itself."""
    keys: dict[str, Any] = {}
    for knob in KNOBS:
        if knob.key not in table.model_fields:
            kind = Annotated[knob.kind, f.Number(knob.unit, above=0.0)] if knob.unit else knob.kind
            keys[knob.key] = (kind | None, Field(default=None, **knob.told))
    return create_model(table.__name__, __base__=table, __doc__=table.__doc__, __module__=__name__, **keys)


@_with_knobs
class FidelityTable(Table):
    """Speed against accuracy."""

    kinematics: Literal["exact", "two-order", "auto"] = Field(
        default="exact", description="auto: the cheapest choice that keeps the objective within the tolerance."
    )
    tolerance: f.Positive | None = Field(default=None, description="Relative error of the objective, for auto.")


class SearchTable(Table):
    """How many points a search starts from where the problem is not convex."""

    starts: int = Field(default=16, ge=1, le=10_000)
    seed: int = Field(default=0, ge=0)
    boxes: int | None = Field(
        default=None, ge=0, le=1_000_000, description="That bounds of stiffness may be divided into for a proof."
    )


class ProblemFile(Table):
    """A whole problem file."""

    title: str = Field(min_length=1)
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    tolerance: f.Positive = Field(default=1e-4, description="Relative gap at which an optimum counts as proven.")
    engine: EngineTable
    phasing: PhasingTable | None = None
    operating_points: list[OperatingPointTable] = Field(min_length=1)
    gas: GasTable | None = None
    mounts: MountsTable | None = None
    block: BlockTable | None = None
    counterweights: list[CounterweightTable] = Field(default_factory=list)
    balancer_shafts: list[BalancerShaftTable] = Field(default_factory=list)
    objective: ObjectiveTable | None = None
    constraints: list[ConstraintTable] = Field(default_factory=list)
    fidelity: FidelityTable = Field(default_factory=FidelityTable)
    search: SearchTable = Field(default_factory=SearchTable)
