"""[torsion] of a problem file: discs, shafts, geared branches and absorbers of the crankshaft (V1-V3, V16)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import Field

from laufruhe import units
from laufruhe.extensions.torsion.machine import STEEL, TORSION, Absorber, Disc, ShaftSection, Torsion, stiffness_of
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, nearest, require_one_of
from laufruhe.files.fields import ListOrSingle, Name, Number, Open, Table
from laufruhe.files.nested import Place, at
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.machine import CRANKSHAFT, SliderCrank
from laufruhe.machine.layouts import Throw
from laufruhe.physics.torque import reduced_inertia
from laufruhe.problem.decision import Decision, NumberDrive
from laufruhe.problem.problem import Problem

T = TypeVar("T")

# most discs beside the throws: a response over speed then takes seconds
MAX_DISCS = 60
# relative difference of the inertia of discs from the given rotating inertia, because files have rounded numbers
_ROUNDED = 0.01
Inertias: TypeAlias = Annotated[list[float], ListOrSingle(Annotated[float, Number("kg m^2", minimum=0.0)])]
TorsionalDamping: TypeAlias = Annotated[float, Number("N m s/rad", minimum=0.0)]
TorsionalDampings: TypeAlias = Annotated[list[float], ListOrSingle(TorsionalDamping)]
OpenTorsionalStiffness: TypeAlias = Annotated[float | Open, Number("N m/rad", above=0.0, openable=True)]
OpenTorsionalDamping: TypeAlias = Annotated[float | Open, Number("N m s/rad", minimum=0.0, openable=True)]
TorsionalStiffnesses: TypeAlias = Annotated[list[float | Open], ListOrSingle(OpenTorsionalStiffness)]


class PieceTable(Table):
    """A round piece of a shaft."""

    length: f.PositiveLength
    diameter: f.OpenPositiveLength
    bore: f.NonNegativeLength = 0.0


class SectionTable(Table):
    """Shaft between two discs."""

    pieces: list[PieceTable] = f.optional("Round pieces, one behind another, in place of the stiffness.", [])
    diameter: f.PositiveLength | None = f.optional(
        "Diameter of the weakest section, needed for a stress; by default that of the pieces."
    )
    bore: f.NonNegativeLength = 0.0
    damping: TorsionalDamping = 0.0
    loss_factor: f.LossFactor | None = f.optional("Hysteretic loss factor; by default that of [torsion].")


class TorsionShaftTable(SectionTable):
    """A shaft between two discs: its stiffness, or what it follows from."""

    stiffness: OpenTorsionalStiffness | None = None


class CrankTable(SectionTable):
    """Shafts from throw to throw."""

    stiffness: TorsionalStiffnesses | None = None


class BranchDiscTable(Table):
    """A disc of a branch."""

    name: Name
    inertia: f.OpenInertia
    damping: TorsionalDamping = f.optional("Viscous damping against the block.", 0.0)
    shaft: TorsionShaftTable = f.required("Shaft from this disc to the next one towards the throws.")


class DiscTable(BranchDiscTable):
    """A disc in addition to the throws."""

    end: Literal["front", "rear"]


class BranchTable(Table):
    """Shaft that gears, a belt or a chain drive from a disc: a camshaft, pump, propeller or generator."""

    on: str = f.required("Name of the disc that drives it: of the crankshaft, or of a branch before it.")
    ratio: f.Ratio = f.required("Speed over that of this disc; negative runs against it.")
    gear_inertia: f.PositiveInertia | None = f.optional(
        "Inertia of its gear, which follows the disc without twist, at the speed of the branch."
    )
    discs: list[BranchDiscTable] = f.optional("Discs of the branch, from its gear.", [])


class AbsorberTable(Table):
    """A viscous or rubber damper, or a pendulum."""

    name: Name
    on: str = f.required("Name of its disc, or throw 1, throw 2 ...")
    inertia: f.OpenInertia
    damping: OpenTorsionalDamping = 0.0
    stiffness: OpenTorsionalStiffness | None = None
    loss_factor: f.LossFactor = 0.0
    order: f.Positive | None = f.optional("Order to which a pendulum is tuned.")
    damping_ratio: f.NonNegative = 0.0


class TorsionTable(Table):
    """Discs and shafts of the torsional system of the crankshaft."""

    throw_inertia: Inertias = f.required(
        "Moment of inertia of a throw: pin, webs and counterweights, without rod and piston."
    )
    cylinder_damping: TorsionalDampings = f.optional("Viscous damping of every throw against the block.", [0.0])
    loss_factor: f.LossFactor = f.optional("Hysteretic loss factor of every shaft that has none of its own.", 0.0)
    shear_modulus: f.PositivePressure = STEEL
    speeds: f.Pair[f.Speed] | None = f.optional(
        "Range of speeds in which the response is shown and barred speeds are looked for."
    )
    output: str | None = f.optional("Disc at which the driven machine takes its torque; the last one by default.")
    crank: CrankTable | None = None
    discs: list[DiscTable] = Field(default_factory=list)
    branches: list[BranchTable] = Field(default_factory=list)
    absorbers: list[AbsorberTable] = Field(default_factory=list)


class _OpenNumbers:
    """Reader of numbers that may be open, which collects the decisions about those that are."""

    def __init__(self) -> None:
        self.decisions: list[Decision] = []

    def number(self, value: float | Open, key: str, unit: str, name: str, parts: Sequence[str]) -> float:
        """Return the value of key `key` of parts with one name; an open number gives its start, and adds a decision."""
        number = Open.from_value(value)
        drives = (NumberDrive(TORSION, (part, key)) for part in parts)
        self.decisions += number.decisions(f"torsion.{name}.{key}", unit, *drives)
        return number.start


def _chain(
    table: TorsionTable, parts: Sequence[SliderCrank], throws: Sequence[Throw]
) -> tuple[Torsion, list[Decision]]:
    """Return the chain from front to rear, and the decisions about its open numbers."""
    for part in parts:
        if part.shaft != CRANKSHAFT:
            rule = f"is modelled for one crankshaft, and the throw of {part.name} is on shaft '{part.shaft.name}'"
            raise Refused("torsion", None, rule, "leave it out")
    count = len(table.discs) + sum(len(branch.discs) for branch in table.branches)
    if count > MAX_DISCS:
        rule = f"has {count} discs, and at most {MAX_DISCS} may be given beside the throws"
        raise Refused("torsion.discs", None, rule, "combine neighbouring discs into one")
    throws = [throw for throw in throws if throw.shaft == CRANKSHAFT]
    open_numbers, discs_of_throws = _OpenNumbers(), _throw_discs(table, parts, throws)
    ends = {end: [(k, disc) for k, disc in enumerate(table.discs) if disc.end == end] for end in ("front", "rear")}
    front, rear = (
        [
            Disc(d.name, open_numbers.number(d.inertia, "inertia", "kg m^2", d.name, [d.name]), d.damping)
            for _, d in disc_tables
        ]
        for disc_tables in (ends["front"], ends["rear"])
    )
    discs = [*front, *discs_of_throws, *rear]
    names = [disc.name for disc in discs]
    links = [f"{a} - {b}" for a, b in itertools.pairwise(names)]
    joined = [*links[: len(front)], *links[len(links) - len(rear) :]]
    shafts = [
        _section(
            disc.shaft, table, f"torsion.discs[{k + 1}].shaft", disc.shaft.stiffness, disc.name, [link], open_numbers
        )[0]
        for (k, disc), link in zip((*ends["front"], *ends["rear"]), joined, strict=True)
    ]
    crank = _crank_sections(table, links[len(front) : len(links) - len(rear)], open_numbers)
    sections, parents = [*shafts[: len(front)], *crank, *shafts[len(front) :]], list(range(len(links)))
    output = table.output or discs[-1].name
    for k, branch in enumerate(table.branches, 1):
        _add_branch(branch, table, f"torsion.branches[{k}]", discs, sections, parents, open_numbers)
    names = [disc.name for disc in discs]
    if table.output is not None and table.output not in names:
        raise Refused("torsion.output", table.output, "is no disc", nearest(table.output, names))
    if table.speeds is not None and not table.speeds[0] < table.speeds[1]:
        raise Refused(
            "torsion.speeds", None, "has its ends reversed", 'write the lower first, as in ["800 rpm", "1200 rpm"]'
        )
    absorbers = [
        _absorber(a, names, f"torsion.absorbers[{k + 1}]", open_numbers) for k, a in enumerate(table.absorbers)
    ]
    with errors_at_key("torsion"):
        speeds = None if table.speeds is None else (table.speeds[0], table.speeds[1])
        chain = Torsion(tuple(discs), tuple(sections), tuple(absorbers), output, speeds, tuple(parents))
    return chain, open_numbers.decisions


def _add_branch(
    branch: BranchTable, table: TorsionTable, where: str, discs: list[Disc], sections: list[ShaftSection],
    parents: list[int], open_numbers: _OpenNumbers,
) -> None:  # fmt: skip
    """Add the discs and shafts of a branch, and the inertia of its gear to the disc that drives it (V16)."""
    names = [disc.name for disc in discs]
    if branch.on not in names:
        raise Refused(f"{where}.on", branch.on, "is no disc before this branch", nearest(branch.on, names))
    if not branch.discs and branch.gear_inertia is None:
        raise Refused(f"{where}.discs", None, "is missing", "give the branch discs, or a gear_inertia")
    parent = names.index(branch.on)
    ratio = discs[parent].ratio * branch.ratio
    geared = (branch.gear_inertia or 0.0) * branch.ratio**2
    discs[parent] = replace(discs[parent], inertia=discs[parent].inertia + geared)
    for k, disc in enumerate(branch.discs, 1):
        inertia = open_numbers.number(disc.inertia, "inertia", "kg m^2", disc.name, [disc.name])
        link, place = f"{discs[parent].name} - {disc.name}", f"{where}.discs[{k}].shaft"
        sections += _section(disc.shaft, table, place, disc.shaft.stiffness, disc.name, [link], open_numbers)
        parents.append(parent)
        parent = len(discs)
        discs.append(Disc(disc.name, inertia, disc.damping, ratio=ratio))


def _throw_discs(table: TorsionTable, parts: Sequence[SliderCrank], throws: Sequence[Throw]) -> list[Disc]:
    """Return the discs of the torsional chain, one for each throw from the front, with reduced inertias."""
    places = sorted({throw.x for throw in throws}, reverse=True)
    at = [[k for throw in throws if throw.x == x for k in throw.cylinders] for x in places]
    # a throw has the number that the file counts it by, which may go from the rear
    first = [next(k for k, throw in enumerate(throws) if throw.x == x) for x in places]
    numbers = [sorted(first).index(k) for k in first]
    # the mass of a throw that turns, without its rods
    turning = [sum(abs(throw.unbalance) for throw in throws if throw.x == x) for x in places]
    inertias = _for_each(table.throw_inertia, len(places), "torsion.throw_inertia", "throws")
    dampings = _for_each(table.cylinder_damping, len(places), "torsion.cylinder_damping", "throws")
    discs = []
    for n, names, unbalance in zip(numbers, at, turning, strict=True):
        radius = max((parts[k].crank_radius for k in names), default=0.0)
        total = inertias[n] + unbalance * radius + sum(reduced_inertia(parts[k]) for k in names)
        with errors_at_key("torsion.throw_inertia"):
            discs.append(Disc(f"throw {n + 1}", total, dampings[n], tuple(parts[k].name for k in names)))
    return discs


def _crank_sections(table: TorsionTable, links: Sequence[str], open_numbers: _OpenNumbers) -> list[ShaftSection]:
    where, crank = "torsion.crank", table.crank
    if not links:
        if crank is not None:
            raise Refused(where, None, "joins throws, but the crankshaft has only one throw", "leave it out")
        return []
    if crank is None:
        raise Refused(where, None, "is missing", "give the stiffness of the crankshaft from throw to throw")
    if crank.stiffness is None or len(crank.stiffness) == 1:
        value = None if crank.stiffness is None else crank.stiffness[0]
        return _section(crank, table, where, value, "crank", links, open_numbers)
    stiffnesses = _for_each(crank.stiffness, len(links), f"{where}.stiffness", "shafts between throws")
    return [
        _section(crank, table, where, stiffness, link, [link], open_numbers)[0]
        for stiffness, link in zip(stiffnesses, links, strict=True)
    ]


def _section(
    shaft: SectionTable, table: TorsionTable, where: str, stiffness_given: float | Open | None, name: str,
    links: Sequence[str], open_numbers: _OpenNumbers,
) -> list[ShaftSection]:  # fmt: skip
    """Return equal shaft sections of the torsional chain, named after the discs that they join."""
    require_one_of(shaft, where, "stiffness", "pieces")
    diameter, bore, length = shaft.diameter, shaft.bore, None
    if stiffness_given is not None:
        stiffness = open_numbers.number(stiffness_given, "stiffness", "N m/rad", name, links)
    else:
        pieces = [_piece(piece, f"{where}.pieces[{k + 1}]", len(shaft.pieces)) for k, piece in enumerate(shaft.pieces)]
        stiffness = stiffness_of(pieces, table.shear_modulus)
        if diameter is None:
            _, diameter, bore = min(pieces, key=lambda piece: (piece[1] ** 4 - piece[2] ** 4) / piece[1])
            length = pieces[0][0] if len(pieces) == 1 else None
        if length is not None:
            open_numbers.number(shaft.pieces[0].diameter, "diameter", "m", name, links)
        elif any(isinstance(piece.diameter, Open) for piece in shaft.pieces):
            raise Refused(
                f"{where}.diameter", None, "is given, but a piece has an open diameter", "remove this diameter"
            )
    loss = table.loss_factor if shaft.loss_factor is None else shaft.loss_factor
    with errors_at_key(where):
        return [
            ShaftSection(link, stiffness, shaft.damping, loss, diameter, bore, length, table.shear_modulus)
            for link in links
        ]


def _piece(piece: PieceTable, where: str, count: int) -> tuple[float, float, float]:
    diameter = Open.from_value(piece.diameter)
    if diameter.is_open and count > 1:
        rule = "is open, but its shaft has several pieces"
        raise Refused(f"{where}.diameter", None, rule, "fix the diameter, or describe the shaft as a single piece")
    if piece.bore >= diameter.lower:
        bore = units.quantity_text(piece.bore, "m")
        raise Refused(f"{where}.bore", bore, "is not smaller than the diameter of its shaft", "make it smaller")
    return piece.length, diameter.start, piece.bore


def _absorber(table: AbsorberTable, names: Sequence[str], where: str, open_numbers: _OpenNumbers) -> Absorber:
    if table.on not in names:
        raise Refused(f"{where}.on", table.on, "is no disc", nearest(table.on, list(names)))
    if table.order is not None and table.stiffness is not None:
        raise Refused(
            f"{where}.order",
            None,
            "is for a pendulum absorber, but stiffness is for a rubber absorber",
            "keep one of the two keys",
        )
    holds = Open.from_value(table.stiffness).lower or Open.from_value(table.damping).lower or table.order
    if not holds:
        rule = "may be zero, and then nothing holds the ring"
        raise Refused(f"{where}.damping", None, rule, "give the absorber a stiffness, damping or order above zero")
    inertia, stiffness, damping = (
        open_numbers.number(value, key, unit, table.name, [table.name])
        for key, unit, value in (
            ("inertia", "kg m^2", table.inertia),
            ("stiffness", "N m/rad", table.stiffness or 0.0),
            ("damping", "N m s/rad", table.damping),
        )
    )
    with errors_at_key(where):
        return Absorber(
            table.name, table.on, inertia, stiffness, table.loss_factor, damping, table.order or 0.0,
            table.damping_ratio,
        )  # fmt: skip


def _for_each(values: Sequence[T], count: int, where: str, what: str) -> list[T]:
    if len(values) not in (1, count):
        raise Refused(where, None, f"has {len(values)} numbers for {count} {what}", "give one for all, or one for each")
    return list(values) * count if len(values) == 1 else list(values)


def _read(table: TorsionTable, problem: Problem, context: ExtensionContext) -> Problem:
    """Return the problem with the torsional chain of [torsion]; refuse an inertia that contradicts the discs (V14)."""
    chain, decisions = _chain(table, problem.engine.slider_cranks, context.throws)
    _check_machines(problem, chain)
    inertia = problem.engine.turning_inertia
    result = replace(problem, engine=problem.engine.with_extra(chain), decisions=(*problem.decisions, *decisions))
    if inertia is None:
        return result
    where = "fidelity.crank_inertia" if getattr(context.file, "flywheel", None) is None else "flywheel"
    discs = {(disc.name, "inertia") for disc in chain.discs}
    for decision in result.decisions:
        if decision.kind.name == "flywheel":
            rule = "is open, but the discs of [torsion] give the inertia of all rotating parts"
            raise Refused(decision.name, None, rule, "remove [flywheel], and leave the inertia of a disc open")
        if any(key in discs for key in decision.keys(TORSION)):
            rule = f"gives an inertia that follows from {decision.name}, which is open"
            raise Refused(where, None, rule, "leave it out")
    without_rings = chain.turning_inertia(problem.engine.slider_cranks)
    maximum = without_rings + sum(absorber.inertia for absorber in chain.absorbers)
    if not without_rings * (1.0 - _ROUNDED) <= inertia <= maximum * (1.0 + _ROUNDED):
        of_discs = units.quantity_text(without_rings, "kg m^2")
        rule = f"differs from the {of_discs} that the discs of [torsion] have without pistons and rods"
        remedy = (
            "leave [flywheel] out, and the inertia follows from the discs"
            if where == "flywheel"
            else "make the two inertias agree"
        )
        raise Refused(where, units.quantity_text(inertia, "kg m^2"), rule, remedy)
    return result


def _check_machines(problem: Problem, chain: Torsion) -> None:
    names = [disc.name for disc in chain.discs]
    for torque in (torque for point in problem.points for torque in problem.engine.torques(point)):
        if torque.disc not in ("", *names):
            raise Refused("electric_machines", torque.disc, "is no disc of [torsion]", nearest(torque.disc, names))


def _numbers(table: Mapping[str, Any]) -> Iterator[tuple[str, Place]]:
    places: list[Place] = [("absorbers",), ("discs",)]
    places += [("branches", k, "discs") for k in range(len(table.get("branches", ())))]
    for place in places:
        for k, one in enumerate(at(table, place) or ()):
            label, address = f"torsion.{one.get('name')}", ("torsion", *place, k)
            yield label, address
            yield from _shaft_numbers(label, (*address, "shaft"), one.get("shaft"))
    yield from _shaft_numbers("torsion.crank", ("torsion", "crank"), table.get("crank"))


def _shaft_numbers(label: str, place: Place, shaft: Mapping[str, Any] | None) -> Iterator[tuple[str, Place]]:
    if shaft:
        yield from ((label, (*place, "pieces", 0)) for _ in shaft.get("pieces", ())[:1])
        yield label, place


KEY = Key("torsion", TorsionTable, _read, _numbers)
