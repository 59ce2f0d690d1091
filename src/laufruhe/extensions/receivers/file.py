"""[[receivers]] and [frame] of a problem file, and their CSV files (Q1-Q6)."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, TypeAlias, cast

import numpy as np

from laufruhe.extensions.receivers.machine import Curve, Frame, FrequencyFunction, Quantity, Receiver, Receivers
from laufruhe.extensions.receivers.weightings import WEIGHTINGS
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, errors_at_key, nearest, require_distinct, require_one_of
from laufruhe.files.csv_rows import MAX_ROWS, named_columns, table_of, take_complex
from laufruhe.files.fields import ListOrSingle, Name, Number, Table
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.machine import Block, Engine, Mount
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.problem.problem import Problem

Frequency: TypeAlias = Annotated[float, Number("Hz", minimum=0.0)]
_QUANTITIES: dict[str, Quantity] = {"m/s^2": "acceleration", "m/s": "velocity", "Pa": "pressure"}
_AXES = ("x", "y", "z")
_UNWEIGHTED = "none"


class TransferFunctionsTable(Table):
    """CSV files of the transfer functions from mount forces to a receiver, by the direction of its response."""

    x: str | None = f.optional("File of the response along x.")
    y: str | None = f.optional("File of the response along y.")
    z: str | None = f.optional("File of the response along z.")
    sound: str | None = f.optional("File of the sound pressure.")


class ReceiverTable(Table):
    """A point at which vibration or sound is felt: a handlebar, a seat, an ear."""

    name: Name
    unit: Literal["m/s^2", "m/s", "Pa"] = f.optional(
        "Unit of the response; that of transfer functions is this unit per newton of mount force.", "m/s^2"
    )
    point: f.Three[f.Length] | None = f.optional("Position of a point that moves with the engine, or with the frame.")
    on: Literal["engine", "frame"] = f.optional("Body that the point moves with.", "engine")
    transfer_functions: TransferFunctionsTable | None = None
    force: Literal["rigid ground", "frame"] | None = f.optional(
        "Forces that transfer functions apply to: those on rigid ground if they were measured with the engine on its "
        "mounts, those on the moving frame if they were measured without the engine."
    )
    band: f.Pair[Frequency] | None = f.optional(
        "Frequencies that count; transfer functions have to cover them, and other frequencies give no response."
    )
    weighting: Annotated[list[str], ListOrSingle(str)] = f.optional(
        "Wk, Wd, Wh, A, a CSV file with factors over frequency, or none; one for all directions, or one for each.",
        [_UNWEIGHTED],
    )


class FrameSpringTable(Table):
    """Spring between frame and ground."""

    position: f.Three[f.Length]
    stiffness: f.Three[f.Stiffness] = f.required("Stiffness along x, y and z.")
    loss_factor: f.LossFactor = f.optional("Hysteretic loss factor.", 0.0)
    damping: f.Three[f.Damping] | None = f.optional("Viscous damping along x, y and z; none by default.")


class FrameTable(Table):
    """Rigid frame under the mounts of the engine, for receivers alone; other quantities have rigid ground there."""

    mass: f.PositiveMass = f.required("Mass of the frame and all that is bolted to it, without the engine.")
    centre_of_gravity: f.Three[f.Length] = f.optional("Its centre of gravity.", [0.0, 0.0, 0.0])
    inertia: f.Three[f.Inertia] = f.required("Moments of inertia about x, y and z through its centre of gravity.")
    inertia_products: f.Three[f.Inertia] = f.optional("Products of inertia xy, xz, yz.", [0.0, 0.0, 0.0])
    springs: list[FrameSpringTable] = f.optional("Springs between frame and ground; none for a free frame.", [])


def _read_frame(_: FrameTable, problem: Problem, context: ExtensionContext) -> Problem:
    # the frame acts on receivers alone, which read it
    if getattr(context.file, "receivers", None) is None:
        raise Refused("frame", None, "acts on receivers alone, and the file has none", "add [[receivers]]")
    if problem.engine.block is None:
        rule = "needs an engine on elastic mounts"
        raise Refused("frame", None, rule, 'add [block], and [mounts] with kind = "elastic"')
    return problem


def _frame(table: FrameTable) -> Frame:
    (a, b, c), (xy, xz, yz), (x, y, z) = table.inertia, table.inertia_products, table.centre_of_gravity
    with errors_at_key("frame"):
        body = Block(table.mass, ((a, xy, xz), (xy, b, yz), (xz, yz, c)), (x, y, z))
        springs = tuple(
            Mount(f"spring {k}", _three(spring.position), _three(spring.stiffness), loss_factor=spring.loss_factor,
                  damping=_three(spring.damping or (0.0, 0.0, 0.0)))
            for k, spring in enumerate(table.springs, 1)
        )  # fmt: skip
    return Frame(body, springs)


def _three(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z


def _read(tables: list[ReceiverTable], problem: Problem, context: ExtensionContext) -> Problem:
    require_distinct([table.name for table in tables], "receivers", "receivers have one name")
    frame: FrameTable | None = getattr(context.file, "frame", None)
    receivers = tuple(
        _receiver(table, problem.engine, frame is not None, context.folder, f"receivers[{k}]")
        for k, table in enumerate(tables, 1)
    )
    extra = Receivers(receivers, None if frame is None else _frame(frame))
    return replace(problem, engine=problem.engine.with_extra(extra))


def _receiver(table: ReceiverTable, engine: Engine, has_frame: bool, folder: Path, where: str) -> Receiver:
    require_one_of(table, where, "point", "transfer_functions")
    band = (0.0, math.inf) if table.band is None else (table.band[0], table.band[1])
    if not band[0] < band[1]:
        raise Refused(f"{where}.band", table.band, "has its ends reversed", "write the lower frequency first")
    quantity, functions = _QUANTITIES[table.unit], tuple[FrequencyFunction | None, ...]()
    if table.point is None:
        functions = _functions(table, engine, has_frame, folder, where)
    else:
        _check_point(table, engine, has_frame, where)
    weightings = _weightings(table, 1 if quantity == "pressure" else len(_AXES), folder, where)
    for curve in (*functions, *weightings):
        if isinstance(curve, FrequencyFunction):
            _check_band(table, band, curve, where)
    point = None if table.point is None else _three(table.point)
    return Receiver(
        table.name, quantity, point, table.on == "frame", functions, table.force == "frame", band, weightings
    )


def _check_point(table: ReceiverTable, engine: Engine, has_frame: bool, where: str) -> None:
    if engine.block is None:
        rule = "needs an engine on elastic mounts, because rigid ones do not let it move"
        raise Refused(f"{where}.point", table.point, rule, 'add [block], and [mounts] with kind = "elastic"')
    if table.on == "frame" and not has_frame:
        raise Refused(f"{where}.on", table.on, "needs a frame", "add [frame] with mass and inertia")
    if table.force is not None:
        raise Refused(f"{where}.force", table.force, "is for transfer functions, and this is a point", "leave it out")
    if table.unit == "Pa":
        raise Refused(f"{where}.unit", table.unit, "is no unit of motion", "write m/s^2 or m/s")


def _functions(
    table: ReceiverTable, engine: Engine, has_frame: bool, folder: Path, where: str
) -> tuple[FrequencyFunction | None, ...]:
    """Return the transfer function of each component of the response, as the forces of its file apply."""
    if not engine.mounts:
        raise Refused(f"{where}.transfer_functions", None, "needs mounts, whose forces it multiplies", "add [mounts]")
    if table.force is None:
        remedy = 'write "rigid ground" (measured with the engine on its mounts) or "frame" (without the engine)'
        raise Refused(f"{where}.force", None, "is missing: the forces that the functions apply to", remedy)
    if table.force == "frame" and not has_frame:
        rule = "needs the forces on a frame that moves, and the mounts of this file stand on rigid ground"
        remedy = 'add [frame], or measure with the engine on its mounts and write force = "rigid ground"'
        raise Refused(f"{where}.force", table.force, rule, remedy)
    names = cast(TransferFunctionsTable, table.transfer_functions)
    components = ("sound",) if table.unit == "Pa" else _AXES
    files = [getattr(names, component) for component in components]
    stray = [key for key in (*_AXES, "sound") if getattr(names, key) is not None and key not in components]
    if stray or not any(files):
        key, rule = (stray[0], f"is no component of {table.unit}") if stray else (components[-1], "is missing")
        remedy = f"give files for {' or '.join(components)}"
        raise Refused(f"{where}.transfer_functions.{key}", None, rule, remedy)
    return tuple(
        None if file is None else _transfer_function(file, engine, folder, f"{where}.transfer_functions.{component}")
        for file, component in zip(files, components, strict=True)
    )


def _check_band(table: ReceiverTable, band: tuple[float, float], curve: FrequencyFunction, where: str) -> None:
    low, high = curve.frequencies[0], curve.frequencies[-1]
    reach = f"{low:g} Hz to {high:g} Hz"
    if table.band is None:
        remedy = f'give the frequencies that count, at most band = ["{low:g} Hz", "{high:g} Hz"]'
        raise Refused(f"{where}.band", None, f"is missing, and {curve.name} has values from {reach} alone", remedy)
    if band[0] < low or band[1] > high:
        rule = f"reaches beyond {curve.name}, which has values from {reach}"
        raise Refused(f"{where}.band", table.band, rule, "narrow the band, or measure more frequencies")


def _columns(file: str, folder: Path, where: str) -> dict[str, Array]:
    """Return the columns of a file by their headings without units, with the frequencies as "frequency"."""
    numbers = table_of(file, folder / file, where)
    if len(numbers.values) < 2 or len(numbers.values) > MAX_ROWS or np.isnan(numbers.values).any():
        rule = f"has fewer than two rows, more than {MAX_ROWS}, or gaps"
        raise Refused(where, file, rule, "write rows of numbers, with the frequency [Hz] first")
    if not any(numbers.names):
        raise Refused(where, file, "has no headings", "name the columns, the first one frequency [Hz]")
    frequencies, first = numbers.values[:, 0], numbers.names[0]
    if not re.fullmatch(r"(frequency|f)( *[\[(]Hz[\])])?", first.strip(), re.IGNORECASE):
        raise Refused(where, file, f"has '{first}' as its first column", "make it frequency [Hz]")
    if frequencies[0] < 0.0 or np.any(np.diff(frequencies) <= 0.0):
        raise Refused(where, file, "has frequencies that do not rise", "sort its rows by frequency, each once")
    columns = list(named_columns(file, numbers, where).items())
    return {"frequency": frequencies, **dict(columns[1:])}


def _transfer_function(file: str, engine: Engine, folder: Path, where: str) -> FrequencyFunction:
    """Return the transfer function of one component from a file with two columns for each mount and direction."""
    columns = _columns(file, folder, where)
    values = []
    for place in (f"{mount.name} {axis}" for mount in engine.mounts for axis in _AXES):
        values_at_place = take_complex(place, columns)
        if values_at_place is None:
            remedy = f"add '{place} real' and '{place} imaginary', or '{place} magnitude' and '{place} phase [deg]'"
            raise Refused(where, file, f"has no columns for the force on mount {place}", f"{remedy}, zeros for none")
        values.append(values_at_place)
    frequencies = columns.pop("frequency")
    if columns:
        rule = f"has a column '{next(iter(columns))}', which is no part of a force on a mount of this engine"
        raise Refused(where, file, rule, f"name columns as '{engine.mounts[0].name} z real', or remove it")
    return _function(file, frequencies, np.stack(values, axis=1))


def _function(file: str, frequencies: Array, values: ComplexArray) -> FrequencyFunction:
    return FrequencyFunction(file, tuple(frequencies.tolist()), tuple(map(tuple, values.tolist())))


def _weightings(table: ReceiverTable, count: int, folder: Path, where: str) -> tuple[Curve, ...]:
    where, words = f"{where}.weighting", table.weighting
    if len(words) not in (1, count):
        raise Refused(where, words, f"has {len(words)} entries for {count} directions", "give one, or one for each")
    curves: list[Curve] = []
    for word in words:
        if word in WEIGHTINGS or word == _UNWEIGHTED:
            curves.append(WEIGHTINGS.get(word))
        elif not (folder / word).is_file():
            remedy = nearest(word, [*WEIGHTINGS, _UNWEIGHTED])
            raise Refused(where, word, "is no weighting and no file beside the problem", remedy)
        else:
            columns = _columns(word, folder, where)
            frequencies = columns.pop("frequency")
            if list(columns) != ["factor"]:
                raise Refused(where, word, "has other columns than frequency and factor", "give these two")
            curves.append(_function(word, frequencies, columns["factor"][:, None].astype(complex)))
    return tuple(curves) * (count if len(curves) == 1 else 1)


FRAME = Key("frame", FrameTable, _read_frame)
RECEIVERS = Key("receivers", list[ReceiverTable], _read)
