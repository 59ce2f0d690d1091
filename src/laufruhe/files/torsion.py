"""[torsion] of a problem file: discs, shafts and absorbers of the crankshaft (V1-V3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from pydantic import Field

from laufruhe import units
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, blamed_on, nearest, one_of
from laufruhe.files.fields import Name, Table
from laufruhe.machine import CRANKSHAFT, Absorber, Disc, Section, SliderCrank, Torsion
from laufruhe.machine.layouts import Throw
from laufruhe.machine.torsion import STEEL, stiffness_of
from laufruhe.physics.torsion import reduced_inertia


class PieceTable(Table):
    """A round piece of a shaft."""

    length: f.PositiveLength
    diameter: f.PositiveLength
    bore: f.NonNegativeLength = 0.0


class SectionTable(Table):
    """What is told of any shaft between two discs."""

    pieces: list[PieceTable] = f.told("One behind another, in place of the stiffness.", [])
    diameter: f.PositiveLength | None = f.told(
        "Of its weakest place; needed for a stress. That of the pieces if left out."
    )
    bore: f.NonNegativeLength = 0.0
    damping: f.TorsionalDamping = 0.0
    loss_factor: f.LossFactor | None = None


class ShaftTable(SectionTable):
    """A shaft between two discs: its stiffness, or what it follows from."""

    stiffness: f.TorsionalStiffness | None = None


class CrankTable(SectionTable):
    """From throw to throw."""

    stiffness: f.TorsionalStiffnesses | None = None


class DiscTable(Table):
    """A disc beside the throws."""

    name: Name
    end: Literal["front", "rear"]
    inertia: f.PositiveInertia
    damping: f.TorsionalDamping = Field(default=0.0, description="Against the block.")
    shaft: ShaftTable = Field(description="From this disc to the next towards the throws.")


class AbsorberTable(Table):
    """A viscous or rubber damper, or a pendulum."""

    name: Name
    on: str = Field(description="Name of its disc, or throw 1, throw 2 ...")
    inertia: f.PositiveInertia
    damping: f.TorsionalDamping = 0.0
    stiffness: f.TorsionalStiffness | None = None
    loss_factor: f.LossFactor = 0.0
    order: f.Positive | None = f.told("That a pendulum is tuned to.")
    damping_ratio: f.NonNegative = 0.0


class TorsionTable(Table):
    """Discs and shafts that the crankshaft twists between."""

    throw_inertia: f.Inertias = Field(description="Of pin, webs and counterweights, without rods and pistons.")
    cylinder_damping: f.TorsionalDampings = f.told("Of every throw, against the block.", [0.0])
    loss_factor: f.LossFactor = f.told("Of every shaft that has none of its own.", 0.0)
    shear_modulus: f.PositivePressure = STEEL
    speeds: f.Pair[f.Speed] | None = f.told("Range over which the response is shown and speeds are barred.")
    output: str | None = f.told("Disc where the load takes its torque; the last one where left out.")
    crank: CrankTable | None = None
    discs: list[DiscTable] = Field(default_factory=list)
    absorbers: list[AbsorberTable] = Field(default_factory=list)


def torsion_of(table: TorsionTable | None, parts: Sequence[SliderCrank], throws: Sequence[Throw]) -> Torsion | None:
    """The chain from front to rear; None where nothing is said of it."""
    if table is None:
        return None
    for part in parts:
        if part.shaft != CRANKSHAFT:
            rule = f"is of one crankshaft, and {part.name} works on shaft '{part.shaft.name}'"
            raise Refused("torsion", None, rule, "leave it out")
    own = _throw_discs(table, parts, throws)
    crank = _crank_sections(table, len(own))
    front = [_disc(disc) for disc in table.discs if disc.end == "front"]
    rear = [_disc(disc) for disc in table.discs if disc.end == "rear"]
    discs = (*front, *own, *rear)
    ends = [
        (disc.end, _section(disc.shaft, table, f"torsion.discs[{k + 1}].shaft", disc.shaft.stiffness))
        for k, disc in enumerate(table.discs)
    ]
    sections = [*(s for end, s in ends if end == "front"), *crank, *(s for end, s in ends if end == "rear")]
    named = (replace(s, name=f"{discs[k].name} - {discs[k + 1].name}") for k, s in enumerate(sections))
    names = [disc.name for disc in discs]
    if table.output is not None and table.output not in names:
        raise Refused("torsion.output", table.output, "is no disc", nearest(table.output, names))
    if table.speeds is not None and not table.speeds[0] < table.speeds[1]:
        raise Refused("torsion.speeds", None, "is no range", "write the smaller one first")
    absorbers = [_absorber(a, names, f"torsion.absorbers[{k + 1}]") for k, a in enumerate(table.absorbers)]
    with blamed_on("torsion"):
        speeds = None if table.speeds is None else (table.speeds[0], table.speeds[1])
        return Torsion(discs, tuple(named), tuple(absorbers), table.output or "", speeds)


def _throw_discs(table: TorsionTable, parts: Sequence[SliderCrank], throws: Sequence[Throw]) -> list[Disc]:
    """A disc a throw from the front, with what its pistons and rods reduce to the crank."""
    places = sorted({throw.x for throw in throws}, reverse=True)
    at = [[k for throw in throws if throw.x == x for k in throw.cylinders] for x in places]
    # what of a throw's mass turns beside its rods
    turning = [sum(abs(throw.unbalance) for throw in throws if throw.x == x) for x in places]
    inertias = _for_each(table.throw_inertia, len(places), "torsion.throw_inertia", "throws")
    dampings = _for_each(table.cylinder_damping, len(places), "torsion.cylinder_damping", "throws")
    found = []
    for n, (own, unbalance) in enumerate(zip(at, turning, strict=True)):
        radius = max((parts[k].crank_radius for k in own), default=0.0)
        total = inertias[n] + unbalance * radius + sum(reduced_inertia(parts[k]) for k in own)
        with blamed_on("torsion.throw_inertia"):
            found.append(Disc(f"throw {n + 1}", total, dampings[n], tuple(parts[k].name for k in own)))
    return found


def _crank_sections(table: TorsionTable, throws: int) -> list[Section]:
    if throws == 1:
        if table.crank is not None:
            raise Refused("torsion.crank", None, "joins throws, and there is one", "leave it out")
        return []
    if table.crank is None:
        raise Refused("torsion.crank", None, "is missing", "say how stiff the crankshaft is from throw to throw")
    if table.crank.stiffness is None:
        return [_section(table.crank, table, "torsion.crank", None)] * (throws - 1)
    each = _for_each(table.crank.stiffness, throws - 1, "torsion.crank.stiffness", "shafts between throws")
    return [_section(table.crank, table, "torsion.crank", stiffness) for stiffness in each]


def _section(shaft: SectionTable, table: TorsionTable, where: str, stiffness: float | None) -> Section:
    """A shaft without a name yet."""
    one_of(shaft, where, "stiffness", "pieces")
    diameter, bore = shaft.diameter, shaft.bore
    for k, piece in enumerate(shaft.pieces):
        if piece.bore >= piece.diameter:
            shown = units.shown(piece.bore, "m")
            raise Refused(f"{where}.pieces[{k + 1}].bore", shown, "is as wide as its shaft", "give it a wall")
    if stiffness is None:
        pieces = [(piece.length, piece.diameter, piece.bore) for piece in shaft.pieces]
        stiffness = stiffness_of(pieces, table.shear_modulus)
        if diameter is None:
            _, diameter, bore = min(pieces, key=lambda piece: (piece[1] ** 4 - piece[2] ** 4) / piece[1])
    loss = table.loss_factor if shaft.loss_factor is None else shaft.loss_factor
    with blamed_on(where):
        return Section("shaft", stiffness, shaft.damping, loss, diameter, bore)


def _disc(table: DiscTable) -> Disc:
    return Disc(table.name, table.inertia, table.damping)


def _absorber(table: AbsorberTable, names: Sequence[str], where: str) -> Absorber:
    if table.on not in names:
        raise Refused(f"{where}.on", table.on, "is no disc", nearest(table.on, list(names)))
    if table.order is not None and table.stiffness is not None:
        raise Refused(f"{where}.order", None, "is of a pendulum, and its stiffness is that of rubber", "keep one")
    with blamed_on(where):
        return Absorber(
            table.name, table.on, table.inertia, table.stiffness or 0.0, table.loss_factor, table.damping,
            table.order or 0.0, table.damping_ratio,
        )  # fmt: skip


def _for_each(values: Sequence[float], count: int, where: str, what: str) -> list[float]:
    if len(values) not in (1, count):
        raise Refused(where, None, f"has {len(values)} numbers for {count} {what}", "give one, or one for each")
    return list(values) * count if len(values) == 1 else list(values)
