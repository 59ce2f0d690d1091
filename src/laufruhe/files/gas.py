"""[gas] of a problem file, a table for each model, and the gas that it makes."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field

from laufruhe.errors import counted
from laufruhe.extension import extended
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key
from laufruhe.files.fields import Table
from laufruhe.machine import Cycle, GasModel, Seiliger, SliderCrank, Wiebe
from laufruhe.machine.gas.base import AMBIENT_PRESSURE, CylinderGases
from laufruhe.machine.gas.charge import Charge
from laufruhe.machine.gas.seiliger import FiredCharge


@dataclass(frozen=True)
class GasContext:
    """Folder and cycle of a file, its slider-cranks by cylinder numbers, and the key of the gas in complaints."""

    folder: Path
    cycle: Cycle
    parts: Sequence[SliderCrank]
    where: str = "gas"


class GasTable(Table):
    """Table [gas] of one model; a new model is a subclass with its name as the type of `model`.

    Attributes
    ----------
    acts_on_bore
        True if the gas acts on the bore of [engine].
    single_keys
        Keys, with type and field, that all tables have whose gas acts on the bore: other gas in single cylinders.
    at_points
        Keys, with type and field, of operating points: tables of keys in place of those of [gas].
    """

    acts_on_bore: ClassVar[bool] = True
    single_keys: ClassVar[Mapping[str, Any]] = {}
    at_points: ClassVar[Mapping[str, Any]] = {}

    model: str
    crankcase_pressure: f.PositivePressure = AMBIENT_PRESSURE

    @abstractmethod
    def read(self, context: GasContext) -> tuple[GasModel, Mapping[str, GasModel]]:
        """Return the gas of all cylinders, and that of single cylinders by their names."""

    @classmethod
    def read_single(cls, _table: GasTable, _context: GasContext, /) -> Mapping[str, GasModel]:
        """Return the gas of single cylinders by names, from the keys `single_keys` of another table."""
        return {}

    def check_open_crank(self) -> None:
        """Raise `Refused` if the gas needs fixed throws and firing angles."""


class SingleGasTable(Table):
    """Cylinders whose gas differs; missing keys are those of [gas]."""

    cylinders: Annotated[list[f.CylinderNumber], f.ListOrSingle(f.CylinderNumber), Field(min_length=1)] = f.required(
        "Their numbers."
    )
    imep: f.MeanPressure | None = f.optional("Indicated mean effective pressure of these cylinders.")
    peak_pressure: f.PositivePressure | None = f.optional("Peak pressure of these cylinders, with model seiliger.")
    compression_ratio: f.Positive | None = None


class ChargeTable(GasTable):
    """Charge and gas exchange of a computed cycle."""

    makes: ClassVar[type[FiredCharge]]

    compression_ratio: f.Positive = Charge.compression_ratio
    intake_pressure: f.PositivePressure = Charge.intake_pressure
    exhaust_pressure: f.PositivePressure = Charge.exhaust_pressure
    imep: f.MeanPressure | None = f.optional(
        "Indicated mean effective pressure; needed unless every operating point has a load of its own."
    )
    single_cylinders: list[SingleGasTable] = Field(default_factory=list)

    def read(self, context: GasContext) -> tuple[GasModel, Mapping[str, GasModel]]:
        """Return the cycle, and cycles of single cylinders with other numbers."""
        keys, single = [number.name for number in fields(self.makes)], dict[str, GasModel]()
        numbers = {key: value for key in keys if (value := getattr(self, key)) is not None}
        for k, row in enumerate(self.single_cylinders, 1):
            where, changes = f"gas.single_cylinders[{k}]", row.model_dump(exclude={"cylinders"}, exclude_none=True)
            for key in changes:
                if key not in keys:
                    raise Refused(f"{where}.{key}", None, f"means nothing with model {self.model}", "leave it out")
            with errors_at_key(where):
                model = self.makes(**numbers | changes)
            for name in names_of_cylinders(row.cylinders, context.parts, f"{where}.cylinders"):
                if name in single:
                    raise Refused(f"{where}.cylinders", name, "is given twice", "name each cylinder at most once")
                single[name] = model
        return self.makes(**numbers), single


class SeiligerTable(ChargeTable):
    """Seiliger cycle (mixed heat supply); its cut-off follows from the indicated mean pressure."""

    makes: ClassVar = Seiliger
    model: Literal["seiliger"]
    peak_pressure: f.PositivePressure
    compression_exponent: f.Positive = Seiliger.compression_exponent
    expansion_exponent: f.Positive = Seiliger.expansion_exponent


class WiebeTable(ChargeTable):
    """Cycle with Wiebe heat release; the heat follows from the indicated mean pressure."""

    makes: ClassVar = Wiebe
    model: Literal["wiebe"]
    start: f.Angle
    duration: f.Angle
    shape: f.NonNegative = Wiebe.shape
    completeness: f.Positive = Wiebe.completeness
    heat_ratio: f.Positive = Wiebe.heat_ratio


GAS_MODELS: Mapping[str, type[GasTable]] = extended(
    "gas_models",
    GasTable,
    (SeiligerTable, WiebeTable),
    lambda one: get_args(one.model_fields["model"].annotation)[0],
)
"""Tables of gas models by the names of their models."""


def gas_type() -> Any:
    """Return the type of [gas]: the tables of all models, told apart by `model`."""
    keys = {key: field for table in GAS_MODELS.values() for key, field in table.single_keys.items()}
    tables = [f.with_keys(table, keys) if table.acts_on_bore else table for table in GAS_MODELS.values()]
    return Annotated[reduce(or_, tables), Field(discriminator="model")] | None


def default_numbers(gas: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield key and text of each number that [gas] of a file leaves to its default."""
    for key, field in GAS_MODELS[gas["model"]].model_fields.items():
        if key not in gas and isinstance(field.default, float):
            unit = next(one.unit for one in field.metadata if isinstance(one, f.Number))
            yield key, f"{1e-5 * field.default:g} bar" if unit == "Pa" else f"{field.default:g}"


def gas_of(table: GasTable | None, context: GasContext) -> GasModel | None:
    """Return the gas model of the engine, or None without [gas]. The chambers of the slider-cranks are checked."""
    if table is None:
        return None
    with errors_at_key("gas"):
        common, single = table.read(context)
        for model in GAS_MODELS.values() if table.acts_on_bore else ():
            others = model.read_single(table, context)
            for name in sorted(others.keys() & single.keys()):
                raise Refused("gas", name, "has gas of its own twice", "name each cylinder at most once")
            single = {**others, **single}
    gas: GasModel = CylinderGases(common, tuple(single.items())) if single else common
    with errors_at_key("gas.compression_ratio"):
        for part in context.parts:
            gas.check(part)
    return gas


def gas_at_point(table: GasTable | None, gas: GasModel | None, point: Table, context: GasContext) -> GasModel | None:
    """Return the gas of an operating point: that of [gas], or another one by a key of its model."""
    for name, model in GAS_MODELS.items():
        for key in model.at_points:
            if (value := getattr(point, key, None)) is not None:
                where = f"{context.where}.{key}"
                if not isinstance(table, model):
                    raise Refused(where, None, f"needs [gas] with model {name}", "give [gas] that model")
                keys = {name: getattr(value, name) for name in value.model_fields_set}
                return gas_of(table.model_copy(update=keys), replace(context, where=where))
    return gas


def names_of_cylinders(numbers: Sequence[int], parts: Sequence[SliderCrank], where: str) -> list[str]:
    """Return the names of cylinders by their numbers; two pistons in one cylinder are named together."""
    names = []
    for number in numbers:
        if number > len(parts):
            raise Refused(where, number, f"is not among {counted(len(parts), 'cylinder')}", "count them from 1")
        part = parts[number - 1]
        names += [part.name, *(other.name for other in parts if part.faces(other) or other.faces(part))]
    return names
