"""Reader of problem files: TOML, keys, engine, objective and limits."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from laufruhe.errors import Complaint, InputError, ModelError, printed, refused, wrong_call
from laufruhe.extension import extended
from laufruhe.files import edits, open_numbers
from laufruhe.files.catalogue import with_catalogue
from laufruhe.files.complaints import (
    MAX_COMPLAINTS,
    MISSING,
    Refused,
    complaints_of,
    errors_in_file,
    key_path,
    nearest_file,
)
from laufruhe.files.engine import EngineTable, cycle_of, leads_of, moving_parts, piston_masses
from laufruhe.files.fidelity import with_fidelity
from laufruhe.files.fields import check_format
from laufruhe.files.gas import ChargeTable, GasContext, gas_at_point, gas_of
from laufruhe.files.geared_inertia import geared_of
from laufruhe.files.load_torque import load_torque_of
from laufruhe.files.measures import MeasureContext, limits_of, objectives_of
from laufruhe.files.mounts import axes_sentences, load_cases_of, mounts_of
from laufruhe.files.nested import at, example_at, plain, walk, with_value_at
from laufruhe.files.numbering import REVERSED, sense_of
from laufruhe.files.operating_points import Brake, OperatingPointTable, operating_points, with_load
from laufruhe.files.phasing import is_open, open_phasing
from laufruhe.files.problem_file import EXTENSION_KEYS, WEIGHT_KEYS, ExtensionContext, Note, ProblemFile, file_model
from laufruhe.files.quantities import with_followers
from laufruhe.files.ready import ready_named
from laufruhe.files.rotors import RotorList, balancer_shafts, counterweights
from laufruhe.files.toml_text import line_deeper_than, toml_complaint, toml_text
from laufruhe.machine import Cycle, Engine, GasModel, SliderCrank
from laufruhe.machine.layouts import throw_rotors
from laufruhe.machine.slider_crank import displacement
from laufruhe.problem.advice import ADVICE
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Drawing, Origin, Problem, Search
from laufruhe.problem.problem import Path as Place

DEEPEST, MAX_ENTRIES, MAX_BYTES = 16, 1000, 1_000_000
"""Limits of a file: depth of nested tables, entries of one list or table, and bytes."""
LARGEST = 2**63 - 1
STDIN, UNNAMED = Path("-"), Path("problem")
MAX_OPEN = 200
# control characters except tab and line feed, and marks of the direction of text
_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def load(source: str | Path | Mapping[str, Any]) -> Problem:
    """Return the problem of a file, of the text of a file, or of its tables.

    Parameters
    ----------
    source
        Path; name of a ready problem; text, if it contains a line feed or "="; or tables as nested mappings.

    Raises
    ------
    InputError
        With one line for each fault: file, key, value, rule, remedy.
    """
    return load_tables(*tables_and_path(source))


def tables_and_path(source: str | Path | Mapping[str, Any]) -> tuple[dict[str, Any], Path]:
    """Return the tables of a file or text, and the path that messages name."""
    if isinstance(source, Mapping):
        return _merged(plain(source, DEEPEST + 1), UNNAMED), UNNAMED
    if isinstance(source, str) and ("\n" in source or "=" in source):
        return _merged(_parsed(source.encode("utf-8"), UNNAMED), UNNAMED), UNNAMED
    if not isinstance(source, str | os.PathLike):
        remedy = "give a path, the text of a problem file, or its tables"
        raise wrong_call("problem", source, f"is of type {type(source).__name__}", remedy)
    if not str(source).strip():
        raise wrong_call("problem", source, "is empty", "give a path, the text of a problem file, or its tables")
    path = Path(source)
    if source == path.stem and not path.exists():
        path = ready_named(path.stem).path
    return tables_of(path), display_path(path)


def load_tables(tables: Mapping[str, Any], path: Path) -> Problem:
    """Return the problem of the tables of a file; an `InputError` names the file and all keys that are missing."""
    if "study" in tables:
        raise refused("study", "", "makes this a study file", "use laufruhe study", path)
    check_format(tables, path)
    try:
        return _loaded(tables, path)
    except InputError as error:
        raise InputError(str(path), _all_missing(tables, path, error.complaints)) from None


def _all_missing(tables: Mapping[str, Any], path: Path, complaints: tuple[Complaint, ...]) -> tuple[Complaint, ...]:
    """Return complaints about a missing number, and those about numbers that are missing beside it.

    The file is read again with an example in the place of each missing number, until something else is wrong.
    """
    (last, *others), missing = complaints[-1:], complaints
    while last.rule.startswith(MISSING) and not others and len(missing) < MAX_COMPLAINTS:
        place = tuple(int(part) - 1 if part.isdecimal() else part for part in re.findall(r"[^.\[\]]+", last.where))
        example = example_at(file_model(), place)
        if example is None or not isinstance(at(tables, place[:-1]), Mapping):
            break
        tables = with_value_at(tables, place, example)
        try:
            _loaded(tables, path)
        except InputError as error:
            last, *others = error.complaints
            if last.rule.startswith(MISSING) and last not in missing:
                missing = (*missing, last)
                continue
        break
    return missing


def _loaded(tables: Mapping[str, Any], path: Path) -> Problem:
    try:
        with errors_in_file(path):
            closed, parts = dict(tables), {}
            # notes are removed in reverse order, because an open number may have a note of an extension
            for note in reversed(notes()):
                closed, parts[note] = note.part(closed)
            file = file_model().model_validate(with_followers(closed))
            try:
                problem = _of_file(file, path)
            except Refused as refusal:
                for advice in ADVICE.values():
                    refusal.complaint = advice.remedied(file.engine, refusal.complaint)
                raise
            warnings = (warning for advice in ADVICE.values() for warning in advice.about_file(file.engine, problem))
            problem = replace(problem, warnings=(*problem.warnings, *warnings))

            def finished(problem_of_star: Problem, candidate: Candidate | None) -> Problem:
                problem_of_star = replace(problem_of_star, rebuild=partial(_changed_drawing, closed, path, candidate))
                for note in notes():
                    if parts[note]:
                        problem_of_star = note.put(parts[note], problem_of_star, file, closed)
                return problem_of_star

            if any(parts.values()):
                phasing, problem = problem.phasing, finished(problem, None)
                if phasing is not None:
                    stars = replace(phasing, problem_of=lambda star: finished(phasing.problem_of(star), star))
                    problem = replace(problem, phasing=stars)
            _check_decisions(problem)
            return replace(problem, origin=Origin(tables, path))
    except ValidationError as error:
        raise InputError(str(path), complaints_of(error, file_model())) from None
    except ModelError as error:
        raise InputError(str(path), (Complaint.from_error(error, "engine"),)) from None


@cache
def notes() -> tuple[Note, ...]:
    """Return the kinds of notes that numbers of a file may have, in the order of their application."""
    return tuple(extended("notes", Note, (open_numbers.NOTE,)).values())


def display_path(path: Path) -> Path:
    """Return the path that messages name: `-` is standard input."""
    return Path("stdin") if path == STDIN else path


def _of_file(file: ProblemFile, path: Path) -> Problem:
    if file.geared_inertias and file.engine.throws is not None and file.engine.listed_throws is None:
        rule = "need fixed throws, but engine.throws is open"
        raise Refused("geared_inertias", None, rule, "fix the throws, or remove [[geared_inertias]]")
    # what is not modelled together with the weight of moving parts (T14)
    reasons = {
        "an open crank": file.phasing is not None or is_open(file.engine, file.balancer_shafts),
        "[[geared_inertias]]": bool(file.geared_inertias),
        "fidelity.crank_inertia": file.fidelity.crank_inertia is not None,
    }
    if file.engine.gravity and any(reasons.values()):
        what = next(what for what, is_present in reasons.items() if is_present)
        raise Refused("engine.gravity", True, f"is not modelled together with {what}", "leave one of the two out")
    if file.phasing is None and not is_open(file.engine, file.balancer_shafts):
        return _assembled(file, file.engine, path=path)
    if file.gas is not None:
        file.gas.check_open_crank()
    closed = partial(_assembled, file, path=path)
    return open_phasing(file.engine, file.balancer_shafts, file.phasing, closed)


def edited(origin: Origin, edit: str, *arguments: Any) -> Problem:
    """Return the problem of a file after an edit, the name of a function of `edits`, with its arguments."""
    with errors_in_file(origin.path):
        tables = getattr(edits, edit)(origin.tables, *plain(arguments, DEEPEST))
    return load_tables(tables, origin.path)


def number_of(origin: Origin, name: str) -> tuple[float, str]:
    """Return value or start of a number of a file [SI], by its name in results or its path, and its unit."""
    with errors_in_file(origin.path):
        return edits.number(origin.tables, name)


def text_of(origin: Origin) -> str:
    """Return the text of a problem file."""
    return toml_text(origin.tables)


def _changed_drawing(
    tables: Mapping[str, Any], path: Path, candidate: Candidate | None, changes: Mapping[Place, str | float]
) -> Drawing:
    """Return the engine of a file with other numbers at some addresses; for one candidate if crank stars are open."""
    fidelity = tables.get("fidelity", {})
    if fidelity.get("kinematics") == "auto":
        options = {key: value for key, value in fidelity.items() if key not in ("kinematics", "tolerance")}
        tables = {**tables, "fidelity": options}
    for place, value in changes.items():
        tables = with_value_at(tables, place, value)
    try:
        problem = _of_file(file_model().model_validate(with_followers(tables)), path)
        if candidate is not None and problem.phasing is not None:
            problem = problem.phasing.problem_of(candidate)
    except (ValidationError, Refused, ModelError) as error:
        values = ", ".join(f"{key_path(place)} = {value}" for place, value in changes.items())
        faults = complaints_of(error, file_model()) if isinstance(error, ValidationError) else (error,)
        why = " and ".join(map(str, faults))
        raise ModelError(f"this engine cannot be built with {values}: {why}; narrow its bounds or tolerances") from None
    return Drawing(problem.engine, problem.points, problem.decisions, problem.mount_numbers)


def tables_of(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file with unchecked keys; raise `InputError` if it cannot be read.

    The path `-` is standard input. An engine of the catalogue is written out in the tables.
    """
    if path == STDIN:
        return _merged(_parsed(_standard_input(), display_path(path)), display_path(path))
    try:
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except IsADirectoryError:
        raise refused("file", "", "is a folder", "name a problem file inside this folder", path) from None
    except FileNotFoundError:
        raise refused("file", "", "does not exist", nearest_file(path, "check the path"), path) from None
    except OSError as error:
        raise refused("file", "", f"cannot be read ({error.strerror})", "check its permissions", path) from None
    return _merged(_parsed(content, path), path)


def _merged(tables: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the tables with an engine of the catalogue written out.

    Raise `InputError` for control characters in texts, and for tables that are too deep or too long.
    """
    for place, node in walk(tables):
        where = key_path(place)
        if len(place) > DEEPEST:
            raise refused(where, "", f"is nested more than {DEEPEST} levels deep", "flatten it", path)
        strange = _UNSEEN.search("".join(text for text in (*place[-1:], node) if isinstance(text, str)))
        if strange is not None:
            rule = f"contains U+{ord(strange.group()):04X}, which is not a printable character"
            raise refused(where, "", rule, "remove it; in a path write / for \\", path)
        if isinstance(node, dict | list) and len(node) > MAX_ENTRIES:
            raise refused(where or "file", "", f"has {len(node)} entries", f"at most {MAX_ENTRIES} are read", path)
        if isinstance(node, int) and not -LARGEST <= node <= LARGEST:
            raise refused(where, "", "is a whole number of more than 64 bits", "write a smaller one", path)
    with errors_in_file(path):
        return with_catalogue(tables)


@cache
def _standard_input() -> bytes:
    return sys.stdin.buffer.read(MAX_BYTES + 1)


def _parsed(content: bytes, path: Path) -> dict[str, Any]:
    if len(content) > MAX_BYTES:
        raise refused("file", "", f"is larger than {MAX_BYTES // 1_000_000} MB", "a problem takes a few kB", path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refused("file", "", f"is no UTF-8 text (byte {error.start + 1})", "save it as UTF-8", path) from None
    deep = line_deeper_than(DEEPEST, text)
    if deep is not None:
        raise refused(f"line {deep}", "", f"is nested more than {DEEPEST} levels deep", "flatten it", path)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), (toml_complaint(content, error),)) from None
    except ValueError:
        # the parser raises a plain ValueError only for integers with thousands of digits
        raise refused("file", "", "contains a whole number of thousands of digits", "shorten it", path) from None


def is_study(path: Path) -> bool:
    """Return True for a study file."""
    return "study" in tables_of(path)


def _assembled(file: ProblemFile, table: EngineTable, without_gas: bool = False, *, path: Path) -> Problem:
    """Return the problem of a file with this table [engine], which has no open throws, firing order or bank angles."""
    needs_bore = file.gas is not None and file.gas.acts_on_bore and any(point.gas for point in file.operating_points)
    cylinders, throws = moving_parts(table, gas=needs_bore)
    keys = sorted(EXTENSION_KEYS.values(), key=lambda key: not key.always)
    for key in keys:
        if (key_table := getattr(file, key.name)) is not None:
            cylinders, throws = key.adds(key_table, cylinders, throws, file)
    for weight_key in WEIGHT_KEYS.values():
        file = weight_key.prepare(file)
    collected = RotorList(rotors=list(throw_rotors(throws)))
    counterweights(file.counterweights, cylinders, throws, collected)
    balancer_shafts(file.balancer_shafts, collected)
    is_mirrored = table.value_of("rotation") == REVERSED
    on_mounts, cycle = mounts_of(file.mounts, file.block, path.parent, is_mirrored), cycle_of(table)
    brake = _brake(file, cylinders, cycle, path.parent)
    gas_table = with_load(file.gas, file.operating_points)
    gas_context = GasContext(path.parent, cycle, cylinders)
    gas = gas_of(gas_table, gas_context)

    def gas_at(point: OperatingPointTable, where: str) -> GasModel | None:
        return gas_at_point(gas_table, gas, point, replace(gas_context, where=where))

    points = operating_points(file.operating_points, gas_at, cycle, table.stroke, brake, cylinders)
    if without_gas:
        points = tuple(replace(point, gas=None) for point in points)
    geared, of_geared = geared_of(file.geared_inertias)
    engine = Engine(
        file.title, cycle, cylinders, tuple(collected.rotors), on_mounts.mounts, on_mounts.block, geared,
        load_cases_of(file.load_cases, on_mounts.block),
        load_torque=load_torque_of(file.load_torque, path.parent, cycle, cylinders), gravity=table.gravity,
    )  # fmt: skip
    load_said = [f"Load: {sentence}" for sentence in engine.load_torque.recording] if engine.load_torque else []
    loads = (*piston_masses(table, cylinders, file.counterweights), *leads_of(table), *collected.decisions, *of_geared)
    problem = Problem(
        name=printed(path.stem),
        title=file.title,
        engine=engine,
        points=points,
        decisions=(*loads, *on_mounts.decisions),
        source=file.source,
        assumptions=(
            *file.assumptions,
            *sense_of(table),
            *axes_sentences(file.mounts, file.block),
            *(brake.said if brake else ()),
            *load_said,
        ),
        tolerance=file.tolerance,
        shown_units=file.units.by_si_unit(),
        mount_numbers=on_mounts.numbers,
        search=Search(**file.search.model_dump()),
        fires_together=table.fires_together,
    )
    context = ExtensionContext(file, table, throws, path.parent)
    for key in keys:
        if key.always or getattr(file, key.name) is not None:
            problem = key.read(getattr(file, key.name), problem, context)
    measure_context = MeasureContext(problem.engine, points)
    ranks = objectives_of(file.objective, measure_context, file.single)
    problem = replace(
        problem,
        objective=ranks[0].terms if ranks else (),
        ranks=ranks if len(ranks) > 1 else (),
        limits=(*limits_of(file.constraints, measure_context), *problem.limits),
        friction=tuple(brake.tests if brake else ()),
    )
    return with_fidelity(problem, file.fidelity)


def _brake(file: ProblemFile, cylinders: Sequence[SliderCrank], cycle: Cycle, folder: Path) -> Brake | None:
    # a file without [friction] has no loads at the brake
    if file.friction is None:
        return None
    if file.gas is None or not any(point.gas for point in file.operating_points):
        raise Refused("friction", None, "is given, but no operating point has gas", "add [gas], or leave it out")
    if any(part.swept.piston.bore is None for part in cylinders):
        raise Refused("engine.bore", None, "is missing, but [friction] needs the displacement", "add it")
    has_brake = any(point.bmep is not None or point.brake_torque is not None for point in file.operating_points)
    if (
        has_brake
        and isinstance(file.gas, ChargeTable)
        and any(row.imep is not None for row in file.gas.single_cylinders)
    ):
        rule = "shares a load at the brake equally, and [[gas.single_cylinders]] have an imep of their own"
        raise Refused("friction", None, rule, "give the operating points an imep, or remove that of the cylinders")
    return Brake(file.friction, folder, displacement(cylinders), cycle)


def _check_decisions(problem: Problem) -> None:
    """Raise `Refused` for too many open numbers, and for ones without effect or objective or that rename points."""
    decisions, without_effect = problem.decisions, "is open but has no effect in this engine"
    if len(decisions) > MAX_OPEN:
        remedy = "fix some numbers, or couple some to others"
        raise Refused(decisions[MAX_OPEN].name, None, f"is open, but at most {MAX_OPEN} numbers can be open", remedy)
    for decision in decisions:
        if not decision.has_effect:
            raise Refused(decision.name, None, without_effect, "fix or leave it out")
    if decisions and not problem.objective:
        raise Refused(
            "objective", None, "is missing, but numbers of the file are open", "add [objective] with minimise"
        )
    as_given, names = (problem.engine, problem.points, problem.mount_numbers), [point.name for point in problem.points]
    for decision in decisions:
        drawings = list[Drawing]()
        for bound in (decision.lower, decision.upper) if decision.address_drives else ():
            with suppress(ModelError):
                drawings.append(problem.rebuild({d.path: d.written(bound) for d in decision.address_drives}))
        if len(drawings) > 1 and all((d.engine, d.points, d.mount_numbers) == as_given for d in drawings):
            raise Refused(decision.name, None, without_effect, "fix or leave it out")
        if any([point.name for point in drawing.points] != names for drawing in drawings):
            rule = f"is open and changes the speeds that name the operating points ({', '.join(names)})"
            raise Refused(
                decision.name, None, rule, "list the operating points one by one, each with a name and without up_to"
            )
