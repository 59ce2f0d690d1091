"""Reading a problem file: TOML, keys, geometry, and what is asked of it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from laufruhe.errors import Complaint, InputError, ModelError
from laufruhe.files.asked import Scene, limits_of, objective_of
from laufruhe.files.assemble_engine import cycle_of, moving_parts, operating_points
from laufruhe.files.assemble_mounts import mounts_of
from laufruhe.files.complaints import Refused, complaints_of
from laufruhe.files.file_models import ProblemFile
from laufruhe.files.read_fidelity import at_fidelity
from laufruhe.files.read_phasing import is_open, opened
from laufruhe.files.rotors import RotorList, balancer_shafts, counterweights
from laufruhe.machine import Engine
from laufruhe.machine.layouts import throw_rotors
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
    """A problem from the tables of its file, changed or not; complaints name the file.

    Raises
    ------
    InputError
        As `load` does.
    """
    if "study" in tables:
        raise InputError(str(path), (Complaint("study", "", "makes this a study file", "use laufruhe study"),))
    try:
        file = ProblemFile.model_validate(tables)
    except ValidationError as error:
        raise InputError(str(path), complaints_of(error, ProblemFile)) from None
    try:
        if is_open(file):
            return opened(file, lambda closed: _assembled(closed, path))
        return _assembled(file, path)
    except Refused as refused:
        raise InputError(str(path), (refused.complaint,)) from None
    except ModelError as error:
        raise InputError(str(path), (Complaint.of(error, "engine"),)) from None


def tables_of(path: Path) -> dict[str, Any]:
    """The tables of a TOML file, their keys not yet checked.

    Raises
    ------
    InputError
        If it cannot be read or is no TOML.
    """
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


def _assembled(file: ProblemFile, path: Path) -> Problem:
    has_gas = file.gas is not None and any(point.gas for point in file.operating_points)
    cylinders, throws = moving_parts(file.engine, has_gas)
    collected = RotorList(rotors=list(throw_rotors(throws)))
    counterweights(file.counterweights, cylinders, throws, collected)
    balancer_shafts(file.balancer_shafts, collected)
    found = mounts_of(file.mounts, file.block)
    engine = Engine(file.title, cycle_of(file.engine), cylinders, tuple(collected.rotors), found.mounts, found.block)
    points = operating_points(file, path.parent)
    scene = Scene(engine, points)
    objective, decisions = objective_of(file, scene), (*collected.decisions, *found.decisions)
    for decision in decisions:
        gains: list[complex] = [drive.gain for drive in decision.rotor_drives]
        if not any([*gains, *(drive.gain for drive in decision.mount_drives)]):
            raise Refused(decision.name, None, "is open, and nothing of this engine follows it", "fix or leave it out")
    if decisions and not objective:
        raise Refused("objective", None, "is missing while numbers are open", "say what is to be minimised")
    problem = Problem(
        name=path.stem,
        title=file.title,
        engine=engine,
        points=points,
        decisions=decisions,
        objective=objective,
        limits=limits_of(file, scene),
        source=file.source,
        assumptions=tuple(file.assumptions),
        tolerance=file.tolerance,
        mount_numbers=found.numbers,
        search=Search(file.search.starts, file.search.seed, file.search.boxes),
    )
    return at_fidelity(problem, file.fidelity)
