"""States of an operating point in which some cylinders have no combustion: misfire and cut cylinders (G21)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Table
from laufruhe.files.gas import names_of_cylinders
from laufruhe.machine import Cycle, GasModel, SliderCrank
from laufruhe.machine.gas.base import CylinderGases

SINGLY = "each"


class StateTable(Table):
    """Cylinders of an operating point that have no combustion."""

    misfire: Annotated[
        list[f.CylinderNumber] | Literal["each"] | None, f.OrWord(list[f.CylinderNumber], "[3]", words=(SINGLY,))
    ] = f.optional('Cylinders whose charge is compressed without combustion; "each" makes one point for each cylinder.')
    cut: list[f.CylinderNumber] | None = f.optional("Cylinders without combustion, whose valves stand still.")
    cut_valves: Literal["closed", "open"] | None = f.optional(
        "Valves of cut cylinders: closed (default) over a charge of intake pressure at the largest volume, or open to "
        "the intake."
    )


@dataclass(frozen=True)
class CylinderState:
    """Cylinders without combustion.

    Attributes
    ----------
    misfire, cut
        Names of the slider-cranks that misfire, and of those that are cut.
    has_open_valves
        True if the valves of cut cylinders are open to the intake, False if they are closed.
    suffix
        End of the name of the operating point.
    """

    misfire: tuple[str, ...]
    cut: tuple[str, ...]
    has_open_valves: bool
    suffix: str

    def gas(self, gas: GasModel | None, cycle: Cycle, where: str) -> GasModel | None:
        """Return the gas of the engine in this state, from the gas with combustion in every cylinder."""
        if not self.misfire and not self.cut:
            return gas
        gases = gas if isinstance(gas, CylinderGases) or gas is None else CylinderGases(gas, ())

        def without_combustion(name: str, key: str) -> GasModel:
            model = gases and gases.of_cylinder(name)
            unfired = model and (model.cut(self.has_open_valves) if key == "cut" else model.motored(cycle))
            if unfired:
                return unfired
            rule = "needs [gas] with model seiliger or wiebe, which gives the pressure without combustion"
            remedy = "give [gas] such a model, or remove this key"
            if key == "misfire" and model and model.motored_remedy:
                remedy = f"{model.motored_remedy}, or remove this key"
            raise Refused(f"{where}.{key}", name, rule, remedy)

        unfired = {name: without_combustion(name, "misfire") for name in self.misfire}
        unfired |= {name: without_combustion(name, "cut") for name in self.cut}
        return gases and CylinderGases(gases.common, tuple((dict(gases.single) | unfired).items()))


def cylinder_states(
    table: StateTable, parts: Sequence[SliderCrank], where: str, is_named: bool
) -> list[CylinderState]:  # fmt: skip
    """Return the states of an operating point: one, or one for each cylinder that may misfire.

    `parts` are the slider-cranks in the order of cylinder numbers. A point with a name of its own keeps it.
    """
    for key in ("misfire", "cut"):
        if getattr(table, key) == []:
            raise Refused(f"{where}.{key}", [], "is empty", "name a cylinder, or remove this key")
    if table.cut_valves is not None and table.cut is None:
        raise Refused(f"{where}.cut_valves", table.cut_valves, "is given without cut cylinders", "add cut = [1]")
    cut = _names(table.cut or (), parts, f"{where}.cut")
    if isinstance(table.misfire, str):
        # two pistons in one cylinder misfire together, and a piston without a bore does not fire
        single = (_names([k], parts, where) for k, part in enumerate(parts, 1) if part.bore != 0.0)
        misfires, is_named = [names for names in dict.fromkeys(single) if not set(names) & set(cut)], False
    else:
        misfires = [_names(table.misfire or (), parts, f"{where}.misfire")]
        if set(misfires[0]) & set(cut):
            raise Refused(f"{where}.cut", table.cut, "has cylinders of misfire too", "keep each cylinder in one list")
    if not misfires:
        rule, remedy = "leaves no cylinder that fires to misfire", "cut fewer cylinders, or remove misfire"
        raise Refused(f"{where}.misfire", table.misfire, rule, remedy)
    words = ["" if is_named else _words(n, "misfires" if len(n) == 1 else "misfire") for n in misfires]
    end = "" if is_named else _words(cut, "cut")
    has_open_valves = table.cut_valves == "open"
    return [CylinderState(n, cut, has_open_valves, word + end) for n, word in zip(misfires, words, strict=True)]


def _names(numbers: Sequence[int], parts: Sequence[SliderCrank], where: str) -> tuple[str, ...]:
    # each name once, in the order of cylinder numbers
    names = set(names_of_cylinders(numbers, parts, where))
    return tuple(part.name for part in parts if part.name in names)


def _words(names: Sequence[str], what: str) -> str:
    return f", {' and '.join([', '.join(names[:-1])] * (len(names) > 1) + [names[-1]])} {what}" if names else ""
