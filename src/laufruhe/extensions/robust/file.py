"""Tolerances in a problem file: "1.25 kg ± 2 %" at a number, [tolerances], [robust], and lots of [assembly]."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, TypeAlias

from pydantic import Field

from laufruhe import units
from laufruhe.extensions.robust.assembly import Assembly, Lot
from laufruhe.extensions.robust.tolerance import (
    AddedDrive,
    Error,
    FileDrive,
    Law,
    PistonDrive,
    Population,
    Robust,
    Scope,
    ShareDrive,
    Tolerance,
    Tolerances,
)
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, key_path, si_value
from laufruhe.files.csv_rows import rows_of
from laufruhe.files.fields import Table
from laufruhe.files.problem_file import ExtensionContext, Key, Note
from laufruhe.files.rotors import name_of_unbalance
from laufruhe.machine import Engine
from laufruhe.machine.rotor import grade_of, permitted_unbalance
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.problem.problem import Path, Problem

SIGNS = ("±", "+-", "+/-")
_TOLERANCE = re.compile(
    r"^(?P<number>.*?)\s*(?:±|\+/-|\+-)\s*(?P<size>.*?)(?P<words>(?:\s+(?:normal|uniform|piece|batch))*)\s*$"
)
_NUMBER = re.compile(r"^\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_ROOMS = ("engine", "gas", "mounts", "block", "counterweights", "balancer_shafts")
_SIZES = ("mass", "unbalance", "radius")
_EXAMPLE = 'write for example "1.25 kg ± 2 %" or "1.25 kg +- 25 g normal batch"'
RESIDUAL = "tolerances.residual_unbalance"


class TolerancesTable(Table):
    """Tolerances of built engines that belong to no single number of this file, such as residual unbalance."""

    closed: ClassVar[str] = "is a tolerance, and the optimum would always be zero"

    residual_unbalance: str | None = Field(
        default=None, description="Left on the crankshaft by balancing: an unbalance on each plane, or a grade of "
        "ISO 21940-11 for all of them together.", examples=["G 6.3", "50 g cm"],
    )  # fmt: skip
    rotor_mass: f.PositiveMass | None = f.optional(
        "Mass of the rotor that has the grade: crankshaft, flywheel, clutch."
    )
    planes: int = Field(
        default=2, ge=1, le=48, description="Number of balancing planes, from the first throw to the last."
    )
    law: Literal["uniform", "normal"] = "uniform"


class RobustTable(Table):
    """Design for engines as built: for the worst case within the tolerances, or for a share of them."""

    closed: ClassVar[str] = "selects the engines to design for, and is not optimised"

    over: str = f.optional('"worst case", or a share of engines such as "95 %".', "worst case")
    engines: int = Field(default=1000, ge=20, le=100_000, description="Number of engines that are drawn.")
    seed: int = Field(default=1, ge=0)


@dataclass(frozen=True)
class Mark:
    """Tolerance as written at a number of the file, such as "1.25 kg ± 2 %"; `path` has the keys of that number.

    Attributes
    ----------
    text
        Whole text.
    number, unit
        Number of the drawing as written, and its unit; None for an open number.
    size
        Largest error as written: with a unit, in percent, or a plain number.
    """

    path: Path
    text: str
    number: float | None
    unit: str
    size: str
    law: Law
    scope: Scope | None

    def refused(self, rule: str, remedy: str) -> Refused:
        """Return an error with a rule and a remedy."""
        return Refused(key_path(self.path), self.text, rule, remedy)

    @property
    def is_share(self) -> bool:
        """True if the tolerance is in percent."""
        return self.size.endswith("%")

    @property
    def error(self) -> float:
        """Largest manufacturing error, in the unit of the number, or as a fraction of the number."""
        if self.is_share:
            share = self._parsed(self.size[:-1].strip() or "?", "") / 100.0
            if share >= 1.0:
                raise self.refused("is a tolerance of 100 % or more", "give less than 100 %")
            return share
        if not self.unit:
            return self._parsed(self.size, "")
        one_unit = f"1 {self.unit}"
        dimension = units.dimension_of(one_unit)
        if dimension is None:
            raise self.refused("is not a number with a known unit", _EXAMPLE)
        is_plain = _NUMBER.fullmatch(self.size) is not None
        return self._parsed(f"{self.size} {self.unit}" if is_plain else self.size, dimension) / units.parse(
            one_unit, dimension
        )

    @property
    def gain(self) -> float:
        """Largest error in the unit of the number."""
        return self.error * (abs(self.number or 0.0) if self.is_share else 1.0)

    def _parsed(self, text: str, dimension: str) -> float:
        try:
            value = units.parse(text, dimension)
        except units.UnitError:
            raise self.refused(f"has a tolerance '{self.size}' whose unit does not fit the number", _EXAMPLE) from None
        if value < 0.0:
            raise self.refused("has a negative tolerance", "write it without a sign; it applies in both directions")
        return value


@dataclass(frozen=True)
class Marks:
    """Tolerances at numbers of a file."""

    written: tuple[Mark, ...]


def _split(tables: Mapping[str, Any]) -> tuple[dict[str, Any], Marks | None]:
    marks: list[Mark] = []
    plain = {key: _strip_marks(value, (key,), marks) if key in _ROOMS else value for key, value in tables.items()}
    return plain, Marks(tuple(marks)) if marks or {"tolerances", "robust"} & set(tables) else None


def _attach(marks: Marks, problem: Problem, file: Any, tables: Mapping[str, Any]) -> Problem:
    tolerances = [_tolerance(mark, problem, tables) for mark in marks.written]
    tolerances += _residual(file.tolerances, problem.engine, max(point.speed for point in problem.points))
    if file.robust is None:
        return problem
    robust = Robust(Tolerances(tuple(tolerances)), _population(file.robust, tolerances))
    return replace(problem, extras=(*problem.extras, robust))


def _strip_marks(node: Any, path: Path, marks: list[Mark]) -> Any:
    if isinstance(node, list):
        return [_strip_marks(entry, (*path, k), marks) for k, entry in enumerate(node)]
    if isinstance(node, dict):
        tolerance = node.get("tolerance")
        if "between" in node and isinstance(tolerance, str):
            marks.append(_parse_mark(tolerance if any(sign in tolerance for sign in SIGNS) else f"± {tolerance}", path))
            node = {key: value for key, value in node.items() if key != "tolerance"}
            if marks[-1].number is not None:
                raise marks[-1].refused("gives a number beside { between = ... }", 'write for example "± 2 %"')
        return {key: _strip_marks(value, (*path, key), marks) for key, value in node.items()}
    if isinstance(node, str) and any(sign in node for sign in SIGNS) and path[-1] not in ("name", "names"):
        mark = _parse_mark(node, path)
        if mark.number is None:
            return node
        marks.append(mark)
        return node[: re.search(r"±|\+/-|\+-", node).start()].strip() if mark.unit else mark.number  # type: ignore[union-attr]
    return node


def _parse_mark(text: str, path: Path) -> Mark:
    match = _TOLERANCE.match(text)
    where = key_path(path)
    if match is None or not match["size"]:
        raise Refused(where, text, "has a tolerance sign without a tolerance after it", _EXAMPLE)
    words = match["words"].split()
    laws, scopes = ([word for word in words if word in list(kind)] for kind in (Law, Scope))
    if len(laws) > 1 or len(scopes) > 1:
        raise Refused(where, text, "names two distributions, or both batch and part", "keep one of each")
    number = _NUMBER.match(match["number"])
    return Mark(
        path, text, float(number.group()) if number else None, units.unit_of(match["number"]), match["size"],
        Law(laws[0]) if laws else Law.UNIFORM, Scope(scopes[0]) if scopes else None,
    )  # fmt: skip


def _population(table: RobustTable, tolerances: Sequence[Tolerance]) -> Population:
    """Return which engines within tolerances the objective counts: the worst one, or a percentage of random ones."""
    if not tolerances:
        raise Refused("robust", None, "has no tolerances", 'give one to a number, for example "1.25 kg ± 2 %"')
    if table.over == "worst case":
        return Population(None, table.engines, table.seed)
    try:
        share = units.parse(table.over, "") if table.over.strip().endswith("%") else math.nan
    except units.UnitError:
        share = math.nan
    if not 0.5 < share < 1.0:
        rule = "is neither the worst case nor a share of engines between 50 and 100 %"
        raise Refused("robust.over", table.over, rule, 'write "worst case", or for example "95 %"')
    if table.engines * (1.0 - share) < 1.0:
        rule = f"is so high that none of {table.engines} engines lies above it"
        raise Refused("robust.over", table.over, rule, "raise engines, or lower the share")
    return Population(share, table.engines, table.seed)


_Errors: TypeAlias = tuple[list[Error], float, str]


def _tolerance(mark: Mark, problem: Problem, tables: Mapping[str, Any]) -> Tolerance:
    key = mark.path[-1]
    pieces = {"reciprocating_mass": _pistons, "rotating_mass": _pins}
    if mark.path[:1] == ("engine",) and len(mark.path) == 2 and key in pieces:
        errors, size, unit = pieces[str(key)](mark, problem.engine)
    elif mark.path[0] in ("counterweights", "balancer_shafts") and key in _SIZES:
        errors, size, unit = _rotor(mark, problem, tables)
    else:
        return _file_tolerance(mark)
    scope = mark.scope or Scope.PIECE
    name = f"{errors[0].name}.{key}" if mark.path[0] != "engine" else key_path(mark.path)
    if scope is Scope.BATCH:
        errors = [Error(name, tuple(drive for error in errors for drive in error.drives))]
    return Tolerance(name, unit, size, tuple(errors), mark.law, scope)


def _pistons(mark: Mark, engine: Engine) -> _Errors:
    size = mark.gain * units.parse(f"1 {mark.unit}", "kg")
    if size >= min(part.reciprocating_mass for part in engine.slider_cranks):
        raise mark.refused("is a tolerance of 100 % of the mass or more", "give less")
    return [Error(part.name, (PistonDrive(k, size),)) for k, part in enumerate(engine.slider_cranks)], size, "kg"


def _pins(mark: Mark, engine: Engine) -> _Errors:
    size, errors, pin_places = mark.gain * units.parse(f"1 {mark.unit}", "kg"), [], set()
    for part in engine.slider_cranks:
        place = (part.shaft.name, round(part.x, 9), round(math.remainder(part.throw, math.tau), 9))
        if place in pin_places:
            continue
        pin_places.add(place)
        arm = part.crank_radius * complex(math.cos(part.throw), math.sin(part.throw))
        drive = AddedDrive(f"error of the pin of {part.name}", part.x, size * arm, part.shaft)
        errors.append(Error(f"throw of {part.name}", (drive,)))
    return errors, size, "kg"


def _rotor(mark: Mark, problem: Problem, tables: Mapping[str, Any]) -> _Errors:
    """Return the errors that a relative tolerance of a counterweight or balancer allows."""
    table = tables[str(mark.path[0])][mark.path[1]]
    if mark.path[0] == "counterweights":
        name = str(table["name"])
    else:
        names = [unbalance.get("name") for unbalance in table["unbalances"]]
        name = name_of_unbalance(table["name"], names, int(mark.path[3]))
    decided = {drive.rotor for decision in problem.decisions for drive in decision.rotor_drives}
    if mark.is_share:
        share = mark.error
    elif mark.number:
        share = mark.error / abs(mark.number)
    else:
        rule = "is open, and an open number has its tolerance in percent"
        raise mark.refused(rule, "give the tolerance in percent")
    if share >= 1.0:
        raise mark.refused("is a tolerance of 100 % or more", "give less")
    if not any(rotor.name == name and (rotor.unbalance != 0.0 or name in decided) for rotor in problem.engine.rotors):
        raise mark.refused("has a tolerance in percent, but its unbalance is zero", "leave the tolerance out")
    return [Error(name, (ShareDrive(name, share),))], share, ""


def _file_tolerance(mark: Mark) -> Tolerance:
    # any other number: the problem is rebuilt from the file
    if mark.number is None:
        raise mark.refused(
            "is open, and among open numbers only masses and unbalances may have a tolerance", "fix it, or leave it out"
        )
    is_of_a_piece = any(isinstance(part, int) for part in mark.path)
    if mark.scope is Scope.PIECE and not is_of_a_piece:
        raise mark.refused("is one number for the whole engine, not for each part", "write batch, or no word at all")
    gain = mark.gain
    dimension = (units.dimension_of(f"1 {mark.unit}") or "") if mark.unit else ""
    size = gain * (units.parse(f"1 {mark.unit}", dimension) if mark.unit else 1.0)
    drive = FileDrive(mark.path, mark.number, gain, mark.unit)
    scope = mark.scope or (Scope.PIECE if is_of_a_piece else Scope.BATCH)
    name = key_path(mark.path)
    return Tolerance(name, dimension, size, (Error(name, (drive,)),), mark.law, scope)


def _residual(table: TolerancesTable | None, engine: Engine, speed: float) -> list[Tolerance]:
    """Return the tolerance of residual unbalance on planes from the first throw to the last."""
    if table is None or table.residual_unbalance is None:
        if table is not None and table.rotor_mass is not None:
            raise Refused(
                "tolerances.rotor_mass",
                None,
                "needs a balance grade",
                "add residual_unbalance, or leave rotor_mass out",
            )
        return []
    grade = grade_of(table.residual_unbalance)
    if grade is None:
        try:
            permitted = units.parse(table.residual_unbalance, "kg m")
        except units.UnitError:
            rule, remedy = "is neither a balance grade nor an unbalance", 'write for example "G 6.3" or "50 g cm"'
            raise Refused(RESIDUAL, table.residual_unbalance, rule, remedy) from None
        if table.rotor_mass is not None:
            raise Refused(
                "tolerances.rotor_mass",
                None,
                "is for a balance grade, but residual_unbalance is an unbalance",
                "leave it out",
            )
    elif table.rotor_mass is None:
        rule = "is missing, but a balance grade needs the mass of the rotor"
        raise Refused("tolerances.rotor_mass", None, rule, "add the mass of crankshaft, flywheel and clutch")
    else:
        permitted = permitted_unbalance(grade, table.rotor_mass, speed) / table.planes
    if permitted < 0.0:
        raise Refused(RESIDUAL, table.residual_unbalance, "is negative", "leave the sign out")
    front, rear = (pick(part.x for part in engine.slider_cranks) for pick in (max, min))
    places = [front + (rear - front) * k / max(table.planes - 1, 1) for k in range(table.planes)]
    errors = tuple(
        Error(f"plane {k + 1}", (AddedDrive(f"residual unbalance {k + 1}", x, permitted),), 2)
        for k, x in enumerate(places)
    )
    return [Tolerance(RESIDUAL, "kg m", permitted, errors, Law(table.law))]


COLUMNS = {"pistons": ("mass",), "rods": ("mass at the small end", "mass at the big end")}
MAX_PARTS = 100


class AssemblyTable(Table):
    """Measured pistons and rods; the optimiser decides which goes into which cylinder."""

    pistons: str | None = f.optional("CSV file with the mass of each piston.")
    rods: str | None = f.optional("CSV file with the masses of each rod at the small end and at the big end.")
    mass_unit: str = f.optional("Unit of the masses in these files.", "g")


def _assembly(table: AssemblyTable, problem: Problem, context: ExtensionContext) -> Problem:
    """Return the problem with the measured pistons and rods (lots) from the CSV files of [assembly]."""
    engine = problem.engine
    if context.file.geared_inertias:
        raise Refused("geared_inertias", None, "are not supported together with [assembly]", "leave one of the two out")
    unit = si_value(f"1 {table.mass_unit}", "kg", "assembly.mass_unit", table.mass_unit)
    lots = []
    for key, columns in COLUMNS.items():
        file, where = getattr(table, key), f"assembly.{key}"
        if file is None:
            continue
        rows = rows_of(file, context.folder / file, where, columns)
        count = len(engine.slider_cranks)
        if len(rows) < count:
            raise Refused(
                where, file, f"has {len(rows)} parts for {count} cylinders", "measure at least one for each cylinder"
            )
        if len(rows) > MAX_PARTS:
            raise Refused(where, file, f"has {len(rows)} parts", f"at most {MAX_PARTS} can be handled")
        if min(min(row) for row in rows) <= 0.0:
            raise Refused(where, file, "has a mass that is not above zero; correct this row", "correct it")
        lots.append(Lot(key[:-1], tuple((unit * row[0], unit * row[1] if len(row) > 1 else 0.0) for row in rows)))
    if not lots:
        raise Refused("assembly", None, "names no file of parts to choose from", "name a file of pistons or rods")
    for part in engine.slider_cranks:
        minimum = part.reciprocating_mass + sum(float(lot.differences[:, 0].min()) for lot in lots)
        if type(part) is not SliderCrank or minimum <= 0.0:
            rule = "needs plain cylinders whose reciprocating mass is above all differences of the parts"
            raise Refused("assembly", None, rule, "correct the masses in the files, or remove [assembly]")
    return replace(problem, extras=(*problem.extras, Assembly(tuple(lots))))


def _unchanged(_: Table, problem: Problem, __: ExtensionContext) -> Problem:
    return problem


TOLERANCES = Key("tolerances", TolerancesTable, _unchanged)
ROBUST = Key("robust", RobustTable, _unchanged, single=True)
ASSEMBLY = Key("assembly", AssemblyTable, _assembly, single=True)
NOTE = Note("tolerances", _split, _attach)
