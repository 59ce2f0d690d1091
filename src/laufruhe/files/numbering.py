"""Numbers of the cylinders as a maker gives them: the place of each number in the layout (C3)."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.machine.layouts import LayoutKind

BY_BANK, ALTERNATING = "one bank after the other", "alternating"
Scheme: TypeAlias = Annotated[
    list[int] | Literal["one bank after the other", "alternating"],
    f.OrWord(list[f.CylinderNumber], "[1, 2, 3, 6, 5, 4]", words=(BY_BANK, ALTERNATING)),
]
KEYS = ("numbering", "first_bank", "first_end", "rotation")
"""Keys of [engine] that number the cylinders."""
USUAL = {"numbering": BY_BANK, "first_bank": "left", "first_end": "front"}
"""Values of the keys of numbers where the file leaves them out."""
REVERSED = "counter-clockwise"


def place_order(table: Any, kind: LayoutKind, count: int) -> tuple[int, ...]:
    """Return the index of the place of each cylinder by its number; `table` is [engine].

    The layout counts places bank by bank from the front, and the left bank is its first. If the crank turns the other
    way, the layout is the mirror image of the engine, and its first bank is the right one.
    """
    scheme, first_bank, first_end, rotation = (table.value_of(key) if kind.takes(key) else None for key in KEYS)
    banks = kind.banks
    if count % banks:
        # the layout refuses the count
        return tuple(range(count))
    if scheme == ALTERNATING and banks == 1:
        rule = f"alternates between banks, and layout '{kind.name}' has one"
        raise Refused("engine.numbering", scheme, rule, "leave it out, or list the number of each cylinder")
    per_bank, is_mirrored = count // banks, int(rotation == REVERSED and banks > 1)
    if isinstance(scheme, list):
        if sorted(scheme) != list(range(1, count + 1)):
            raise Refused("engine.numbering", scheme, f"is no permutation of 1 to {count}", "number every cylinder")
        if first_bank is not None or first_end is not None:
            key = "first_end" if first_bank is None else "first_bank"
            rule = "means nothing beside a list of numbers, which gives every place"
            raise Refused(f"engine.{key}", table.value_of(key), rule, "leave it out")
        seen = [(k // per_bank ^ is_mirrored) * per_bank + k % per_bank for k in range(count)]
        return tuple(seen[scheme.index(number)] for number in range(1, count + 1))
    swap = is_mirrored ^ int(first_bank == "right")

    def turn(place: int) -> tuple[int, int]:
        bank, station = divmod(place, per_bank)
        ahead = per_bank - 1 - station if first_end == "flywheel" else station
        return (ahead, bank ^ swap) if scheme == ALTERNATING else (bank ^ swap, ahead)

    return tuple(sorted(range(count), key=turn))


def sense_of(table: Any) -> tuple[str, ...]:
    """Return the sentence of a report about an engine that turns counter-clockwise; empty for others."""
    text = (
        "The crank turns counter-clockwise seen from the front: angles count in its sense, y points to the right, and "
        "pictures show the mirror image."
    )
    return (text,) if table.value_of("rotation") == REVERSED else ()
