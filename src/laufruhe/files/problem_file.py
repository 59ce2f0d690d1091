"""Model of a problem file (docs/reference/problem-files.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import Field, create_model

from laufruhe.extension import extended
from laufruhe.files import fields as f
from laufruhe.files.complaints import si_value
from laufruhe.files.engine import EngineTable
from laufruhe.files.fidelity import FidelityTable
from laufruhe.files.fields import Table
from laufruhe.files.gas import GAS_MODELS, GasTable, gas_type
from laufruhe.files.geared_inertia import GearedInertiaTable
from laufruhe.files.load_torque import LoadTorqueTable
from laufruhe.files.measures import ConstraintTable, ObjectiveTable
from laufruhe.files.mounts import BlockTable, LoadCaseTable, MountsTable
from laufruhe.files.nested import Place
from laufruhe.files.operating_points import FrictionTable, OperatingPointTable
from laufruhe.files.phasing import PhasingTable
from laufruhe.files.quantities import QuantitiesTable
from laufruhe.files.rotors import BalancerShaftTable, CounterweightTable, UnbalanceTable
from laufruhe.machine import SliderCrank
from laufruhe.machine.layouts import Throw
from laufruhe.problem.problem import Problem

SCHEMA = "laufruhe.schema.json"
Cylinders: TypeAlias = tuple[SliderCrank, ...]
Throws: TypeAlias = tuple[Throw, ...]


@dataclass(frozen=True)
class ExtensionContext:
    """Data of a file that the reader passes to the table of an extension.

    Attributes
    ----------
    file
        Tables of the file.
    engine
        Table [engine] with throws, bank and split-pin angle fixed.
    throws
        Throws of the crank.
    folder
        Folder of the file.
    """

    file: ProblemFile
    engine: EngineTable
    throws: Sequence[Throw]
    folder: Path


@dataclass(frozen=True)
class Key:
    """Table of a problem file that an extension adds.

    Attributes
    ----------
    name
        Key of the table in the file.
    annotation
        Type of its value: a subclass of `Table`, or a list of one.
    read
        Function of table, problem and context that returns the problem with the table. The problem has engine,
        operating points and decisions, but no objective and limits yet.
    numbers
        Function of the table that returns the names of its parts in results, and their addresses in the file.
    single
        True if it requires a single objective.
    adds
        Function of table, slider-cranks, throws and file that returns slider-cranks and throws with its additions,
        before rotors are placed.
    always
        True if `read` is called without the table too, and before other keys, to find open numbers in other tables.
    """

    name: str
    annotation: Any
    read: Callable[[Any, Problem, ExtensionContext], Problem]
    numbers: Callable[[Any], Iterable[tuple[str, Place]]] = lambda _: ()
    single: bool = False
    adds: Callable[[Any, Cylinders, Throws, ProblemFile], tuple[Cylinders, Throws]] = lambda _, c, t, __: (c, t)
    always: bool = False


@dataclass(frozen=True)
class WeightKey:
    """Key of the tables of counterweights and of unbalances of shafts that an extension adds.

    Attributes
    ----------
    name
        Name of the key.
    annotation
        Type of its value.
    prepare
        Function of the file that returns it with the sizes of weights that follow from the key, before these are
        placed.
    """

    name: str
    annotation: Any
    prepare: Callable[[ProblemFile], ProblemFile]


@dataclass(frozen=True)
class Note:
    """Extra text that a file may write at any number, such as a tolerance "± 2 %", read by an extension.

    Attributes
    ----------
    name
        Name of the notes.
    part
        Function of the tables that returns them without such notes, and the notes; these are false if there are none.
    put
        Function of notes, problem, file and tables without notes that returns the problem with the notes.
    """

    name: str
    part: Callable[[Mapping[str, Any]], tuple[dict[str, Any], Any]]
    put: Callable[[Any, Problem, ProblemFile, Mapping[str, Any]], Problem]


class SearchTable(Table):
    """Settings of searches for problems that are not convex."""

    closed: ClassVar[str] = "is a setting of the search, not of the engine"

    starts: int = Field(default=16, ge=1, le=10_000)
    seed: int = Field(default=0, ge=0)
    boxes: int | None = Field(
        default=None,
        ge=0,
        le=1_000_000,
        description="Number of boxes into which bounds may be divided for a proof; 0 for none. "
        "By default each method has its own number.",
    )


class UnitsTable(Table):
    """Units of the report's tables and of the screen; other files stay in SI units and in those of their heads."""

    closed: ClassVar[str] = "is a unit of the report, not a number of the engine"

    force: str | None = f.optional("Unit of forces.")
    mass: str | None = f.optional("Unit of masses.")
    unbalance: str | None = f.optional("Unit of unbalances; that of mass times that of length, if both are given.")
    length: str | None = f.optional("Unit of lengths.")
    torque: str | None = f.optional("Unit of torques, moments and couples.")
    inertia: str | None = f.optional("Unit of moments of inertia.")
    power: str | None = f.optional("Unit of power.")

    def by_si_unit(self) -> tuple[tuple[str, str], ...]:
        """Return pairs of an SI unit and a unit in its place; raise `Refused` for a unit of another dimension."""
        named = {
            "N": "force", "kg": "mass", "kg m": "unbalance", "m": "length", "N m": "torque", "kg m^2": "inertia",
            "W": "power",
        }  # fmt: skip
        units = {si: getattr(self, key) for si, key in named.items() if getattr(self, key) is not None}
        for si, unit in units.items():
            si_value(f"1 {unit}", si, f"units.{named[si]}", unit)
        if self.mass is not None and self.length is not None:
            units.setdefault("kg m", f"{self.mass} {self.length}")
        return tuple(units.items())


class ProblemFile(Table):
    """Problem file."""

    format: f.FormatNumber = 1
    title: str = Field(min_length=1)
    source: str = ""
    assumptions: list[str] = Field(default_factory=list)
    tolerance: f.Tolerance = f.optional("Relative gap at which an optimum counts as proven.", 1e-4)
    units: UnitsTable = Field(default_factory=UnitsTable)
    engine: EngineTable
    quantities: QuantitiesTable | None = None
    phasing: PhasingTable | None = None
    operating_points: list[OperatingPointTable] = Field(min_length=1)
    gas: GasTable | None = None
    friction: FrictionTable | None = None
    mounts: MountsTable | None = None
    block: BlockTable | None = None
    load_cases: list[LoadCaseTable] = Field(default_factory=list)
    load_torque: LoadTorqueTable | None = None
    geared_inertias: list[GearedInertiaTable] = Field(default_factory=list)
    counterweights: list[CounterweightTable] = Field(default_factory=list)
    balancer_shafts: list[BalancerShaftTable] = Field(default_factory=list)
    objective: Annotated[list[ObjectiveTable], f.ListOrSingle(ObjectiveTable)] | None = f.optional(
        "What is minimised; of several tables in order, each among the designs that are best by those before it."
    )
    constraints: list[ConstraintTable] = Field(default_factory=list)
    fidelity: FidelityTable = Field(default_factory=FidelityTable)
    search: SearchTable = Field(default_factory=SearchTable)

    @property
    def single(self) -> list[str]:
        """Keys of the file that require a single objective."""
        keys = [key.name for key in EXTENSION_KEYS.values() if key.single and getattr(self, key.name) is not None]
        return [*keys, *(["fidelity.kinematics"] if self.fidelity.kinematics == "auto" else [])]


EXTENSION_KEYS: Mapping[str, Key] = extended("keys", Key, ())
"""Tables of extensions by their names."""
WEIGHT_KEYS: Mapping[str, WeightKey] = extended("weight_keys", WeightKey, ())
"""Keys of weights that extensions add, by their names."""


@cache
def file_model() -> type[ProblemFile]:
    """Return the model of a problem file with the tables and keys of extensions."""
    keys: dict[str, Any] = {key.name: (key.annotation | None, None) for key in EXTENSION_KEYS.values()}
    of_weights = {key.name: (key.annotation | None, None) for key in WEIGHT_KEYS.values()}
    weight, unbalance = (f.with_keys(table, of_weights) for table in (CounterweightTable, UnbalanceTable))
    shaft = f.with_keys(BalancerShaftTable, {"unbalances": (list[unbalance], Field(min_length=1))})  # type: ignore[valid-type]
    of_points = {key: field for table in GAS_MODELS.values() for key, field in table.at_points.items()}
    point = f.with_keys(OperatingPointTable, of_points)
    keys |= {
        "operating_points": (list[point], Field(min_length=1)),  # type: ignore[valid-type]
        "gas": (gas_type(), None),
        "counterweights": (list[weight], Field(default_factory=list)),  # type: ignore[valid-type]
        "balancer_shafts": (list[shaft], Field(default_factory=list)),  # type: ignore[valid-type]
    }
    return create_model("ProblemFile", __base__=ProblemFile, __doc__=ProblemFile.__doc__, __module__=__name__, **keys)
