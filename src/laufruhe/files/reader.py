"""Reading a problem file: TOML, keys, geometry, and what is asked of it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from laufruhe.errors import Complaint, InputError, ModelError
from laufruhe.files.asked import Scene, limits_of, objective_of
from laufruhe.files.bearings import bearings_of
from laufruhe.files.complaints import Refused, complaints_of
from laufruhe.files.engine import EngineTable, cycle_of, moving_parts
from laufruhe.files.fidelity import at_fidelity
from laufruhe.files.gas import gas_of
from laufruhe.files.mounts import mounts_of
from laufruhe.files.operating_points import operating_points
from laufruhe.files.phasing import is_open, opened
from laufruhe.files.problem_file import ProblemFile
from laufruhe.files.rotors import RotorList, balancer_shafts, counterweights
from laufruhe.machine import Engine
from laufruhe.machine.layouts import throw_rotors
from laufruhe.problem.decision import Decision
from laufruhe.problem.problem import Problem, Search


def load(path: str | Path) -> Problem:
    """Read and check a problem file.

    Raises
    ------
    InputError
        With one line for everything wrong: file, key, value, rule, remedy.
    """
    path = Path(path)
    return load_tables(tables_of(path), path)


def load_tables(tables: Mapping[str, Any], path: Path) -> Problem:
    """A problem from the tables of its file, changed or not; complaints name the file (`InputError`)."""
    if "study" in tables:
        raise InputError(str(path), (Complaint("study", "", "makes this a study file", "use laufruhe study"),))
    try:
        file = ProblemFile.model_validate(tables)
    except ValidationError as error:
        raise InputError(str(path), complaints_of(error, ProblemFile)) from None
    try:
        if file.phasing is None and not is_open(file.engine, file.balancer_shafts):
            return _assembled(file, file.engine, path=path)
        closed = partial(_assembled, file, path=path)
        return opened(file.engine, file.balancer_shafts, file.phasing, closed)
    except Refused as refused:
        raise InputError(str(path), (refused.complaint,)) from None
    except ModelError as error:
        raise InputError(str(path), (Complaint.of(error, "engine"),)) from None


def tables_of(path: Path) -> dict[str, Any]:
    """The tables of a TOML file, their keys not yet checked; `InputError` where it is none."""
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except IsADirectoryError:
        raise _unreadable(path, "is a folder", "name a problem file in it") from None
    except FileNotFoundError:
        raise _unreadable(path, "does not exist", "check the path") from None
    except OSError as error:
        raise _unreadable(path, f"cannot be read ({error.strerror})", "check its permissions") from None
    except UnicodeDecodeError as error:
        raise _unreadable(path, f"is no UTF-8 text (byte {error.start + 1})", "save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise _unreadable(path, f"is no TOML: {error}", "correct it there") from None
    except ValueError:
        # the one that is no TOMLDecodeError
        raise _unreadable(path, "holds a whole number of thousands of digits", "write it shorter") from None
    except RecursionError:
        raise _unreadable(path, "is nested too deeply", "flatten it") from None


def _unreadable(path: Path, rule: str, remedy: str) -> InputError:
    return InputError(str(path), (Complaint("file", "", rule, remedy),))


def _assembled(file: ProblemFile, table: EngineTable, without_gas: bool = False, *, path: Path) -> Problem:
    """The problem of a file whose [engine] has this table in its place."""
    told = [point.model_copy(update={"gas": point.gas and not without_gas}) for point in file.operating_points]
    cylinders, throws = moving_parts(table, gas=file.gas is not None and any(point.gas for point in told))
    collected = RotorList(rotors=list(throw_rotors(throws)))
    counterweights(file.counterweights, cylinders, throws, collected)
    balancer_shafts(file.balancer_shafts, collected)
    found = mounts_of(file.mounts, file.block)
    cycle = cycle_of(table)
    bearings = bearings_of(file.main_bearings, cylinders)
    engine = Engine(file.title, cycle, cylinders, tuple(collected.rotors), found.mounts, found.block, bearings)
    points = operating_points(told, gas_of(file.gas, path.parent), cycle, table.stroke)
    scene, decisions = Scene(engine, points), (*collected.decisions, *found.decisions)
    objective = objective_of(file.objective, scene)
    _check_decided(decisions)
    if decisions and not objective:
        raise Refused("objective", None, "is missing while numbers are open", "say what is to be minimised")
    problem = Problem(
        name=path.stem,
        title=file.title,
        engine=engine,
        points=points,
        decisions=decisions,
        objective=objective,
        limits=limits_of(file.constraints, scene),
        source=file.source,
        assumptions=tuple(file.assumptions),
        tolerance=file.tolerance,
        mount_numbers=found.numbers,
        search=Search(**file.search.model_dump()),
    )
    return at_fidelity(problem, file.fidelity)


def _check_decided(decisions: Sequence[Decision]) -> None:
    """Refuse what is open and moves nothing."""
    for decision in decisions:
        if not any(drive.acts for drive in decision.drives):
            raise Refused(decision.name, None, "is open, and nothing of this engine follows it", "fix or leave it out")
