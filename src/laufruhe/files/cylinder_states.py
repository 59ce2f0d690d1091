"""States of an operating point in which some cylinders have no combustion: misfire and cut cylinders (G21)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from laufruhe.files.complaints import Refused
from laufruhe.files.gas import names_of_cylinders
from laufruhe.machine import Cycle, GasModel, Seiliger, SliderCrank, Wiebe
from laufruhe.machine.chambers import CommonGas, CylinderGases
from laufruhe.physics.seiliger_cycle import motored_cycle, trapped_charge

EACH = "each"


class StateTable(Protocol):
    """Keys of an operating point that name cylinders without combustion, and keys that contradict them."""

    name: str | None
    misfire: list[int] | Literal["each"] | None
    cut: list[int] | None
    cut_valves: Literal["closed", "open"] | None
    motored: bool
    gas: bool
    bmep: float | None
    brake_torque: float | None


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
        gases = gas if isinstance(gas, CylinderGases) else None

        def fired(name: str, key: str) -> Seiliger | Wiebe:
            model = gases.of_cylinder(name) if gases else gas
            if not isinstance(model, Seiliger | Wiebe):
                rule = "needs [gas] with model seiliger or wiebe, which gives the pressure without combustion"
                raise Refused(f"{where}.{key}", name, rule, "give [gas] such a model, or remove this key")
            return model

        unfired: dict[str, CommonGas] = {name: motored_cycle(fired(name, "misfire"), cycle) for name in self.misfire}
        unfired |= {name: trapped_charge(fired(name, "cut"), self.has_open_valves) for name in self.cut}
        if gases:
            return CylinderGases(gases.common, tuple((dict(gases.single) | unfired).items()))
        common = fired(next(iter(unfired)), "misfire")
        return CylinderGases(common, tuple(unfired.items()))


def cylinder_states(table: StateTable, parts: Sequence[SliderCrank], where: str) -> list[CylinderState]:
    """Return the states of an operating point: one, or one for each cylinder that may misfire.

    `parts` are the slider-cranks in the order of cylinder numbers.
    """
    _check_keys(table, where)
    cut = _names(table.cut or (), parts, f"{where}.cut")
    if table.misfire == EACH:
        # two pistons in one cylinder misfire together, and a piston without a bore does not fire
        each = (_names([k], parts, where) for k, part in enumerate(parts, 1) if part.bore != 0.0)
        misfires = [names for names in dict.fromkeys(each) if not set(names) & set(cut)]
    else:
        misfires = [_names(table.misfire or (), parts, f"{where}.misfire")]
        if set(misfires[0]) & set(cut):
            raise Refused(f"{where}.cut", table.cut, "has cylinders of misfire too", "keep each cylinder in one list")
    if not misfires:
        rule = "leaves no cylinder that fires to misfire"
        raise Refused(f"{where}.misfire", table.misfire, rule, "cut fewer cylinders, or remove misfire")
    is_named, words = table.name is not None and table.misfire != EACH, _words(cut, "cut")
    return [
        CylinderState(
            names, cut, table.cut_valves == "open",
            "" if is_named else _words(names, "misfires" if len(names) == 1 else "misfire") + words,
        )
        for names in misfires
    ]  # fmt: skip


def _check_keys(table: StateTable, where: str) -> None:
    """Raise `Refused` for keys of an operating point that contradict its cylinders without combustion."""
    if table.cut_valves is not None and table.cut is None:
        raise Refused(f"{where}.cut_valves", table.cut_valves, "is given without cut cylinders", "add cut = [1]")
    for key in ("misfire", "cut"):
        if getattr(table, key) is None:
            continue
        if not getattr(table, key):
            raise Refused(f"{where}.{key}", [], "is empty", "name a cylinder, or remove this key")
        if table.motored or not table.gas:
            rule = "is given for a point that has no combustion in any cylinder"
            raise Refused(f"{where}.{key}", None, rule, "remove this key, or motored and gas")
        if table.bmep is not None or table.brake_torque is not None:
            rule = "is given beside a load at the brake, which is that of an engine whose cylinders all fire"
            raise Refused(f"{where}.{key}", None, rule, "give imep, the mean pressure of the cylinders that fire")


def _names(numbers: Sequence[int], parts: Sequence[SliderCrank], where: str) -> tuple[str, ...]:
    # each name once, in the order of cylinder numbers
    names = set(names_of_cylinders(numbers, parts, where))
    return tuple(part.name for part in parts if part.name in names)


def _words(names: Sequence[str], what: str) -> str:
    return f", {' and '.join([', '.join(names[:-1])] * (len(names) > 1) + [names[-1]])} {what}" if names else ""
