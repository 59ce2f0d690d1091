"""Reading a problem file: TOML, keys, geometry, and what is asked of it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from laufruhe.errors import Complaint, InputError, ModelError
from laufruhe.files.assemble_engine import cycle_of, moving_parts, operating_points
from laufruhe.files.assemble_mounts import mounts_of
from laufruhe.files.assemble_rotors import RotorList, balancer_shafts, counterweights
from laufruhe.files.complaints import Refused, complaints_of, measured, nearest
from laufruhe.files.file_models import LOAD_NAMES, MASS_NAMES, ConstraintTable, ProblemFile, QuantityTable
from laufruhe.files.mount_asked import asked_of_mounts
from laufruhe.files.read_fidelity import at_fidelity
from laufruhe.files.read_phasing import is_open, opened
from laufruhe.machine import Engine, Mount, OperatingPoint, Rotor
from laufruhe.machine.layouts import throw_rotors
from laufruhe.problem.measure import MEASURES, ON_MOUNTS, Quantity, Subject, counted_rotors
from laufruhe.problem.mount_design import MOUNT_NAMES
from laufruhe.problem.problem import Limit, Problem, Term


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
    mounts = found.mounts
    engine = Engine(file.title, cycle_of(file.engine), cylinders, tuple(collected.rotors), mounts, found.block)
    points = operating_points(file, path.parent)
    scene = _Scene(mounts, points, tuple(collected.rotors), found.block is not None)
    objective = _objective(file, scene)
    asked = asked_of_mounts(file, found, scene.points)
    if (collected.decisions or asked.decisions) and not (objective or asked.terms):
        raise Refused("objective", None, "is missing while numbers are open", "say what is to be minimised")
    problem = Problem(
        name=path.stem,
        title=file.title,
        engine=engine,
        points=points,
        decisions=tuple(collected.decisions),
        objective=objective,
        limits=tuple(_limit(t, k, scene) for k, t in enumerate(file.constraints) if t.limit not in MOUNT_NAMES),
        source=file.source,
        assumptions=tuple(file.assumptions),
        tolerance=file.tolerance,
        mount_design=asked,
    )
    return at_fidelity(problem, file.fidelity)


class _Scene:
    """What quantities may refer to."""

    def __init__(self, mounts: Sequence[Mount], points: Sequence[OperatingPoint], rotors: Sequence[Rotor],
                 elastic: bool = False) -> None:  # fmt: skip
        self.mounts = [mount.name for mount in mounts]
        self.points = [point.name for point in points]
        self.rotors = rotors
        self.elastic = elastic

    def quantity(self, name: str, table: QuantityTable, where: str, of: list[str] | None = None) -> Quantity:
        """The quantity that a name and its filters mean, checked against the engine."""
        if name not in (*LOAD_NAMES, *MASS_NAMES):
            raise Refused(where, name, "is no quantity", nearest(name, [*LOAD_NAMES, *MASS_NAMES, *MOUNT_NAMES]))
        at = where.rsplit(".", 1)[0]
        if name in MASS_NAMES:
            return self._mass(name, table, at, of)
        measure, _, subject = name.partition(" ")
        if of is not None:
            raise Refused(f"{at}.of", of, "goes with masses only", "leave it out")
        if subject == Subject.MOUNT_FORCE and not self.mounts:
            raise Refused(where, name, "needs mounts", "add [mounts], or ask for a shaking force")
        if subject == Subject.MOUNT_TRAVEL and not self.elastic:
            raise Refused(where, name, "needs elastic mounts", 'add [mounts] with kind = "elastic", and [block]')
        for key in ("motions", "frequency"):
            if getattr(table, key) is not None:
                raise Refused(f"{at}.{key}", None, f"means nothing for a {subject}", "leave it out")
        for key in ("mounts", "direction_weights"):
            if getattr(table, key) is not None and subject not in ON_MOUNTS:
                raise Refused(f"{at}.{key}", None, "goes with mount forces and travels only", "leave it out")
        self._known(table.mounts, self.mounts, f"{at}.mounts", "mount")
        self._known(table.operating_points, self.points, f"{at}.operating_points", "operating point")
        weights = table.direction_weights
        return Quantity(
            Subject(subject),
            MEASURES[measure],
            mounts=_tuple(table.mounts),
            points=_tuple(table.operating_points),
            orders=None if table.orders is None else tuple(table.orders),
            direction_weights=None if weights is None else (weights[0], weights[1], weights[2]),
        )

    def _mass(self, name: str, table: QuantityTable, at: str, of: list[str] | None) -> Quantity:
        for key in ("mounts", "operating_points", "orders", "direction_weights"):
            if getattr(table, key) is not None:
                raise Refused(f"{at}.{key}", None, "means nothing for a mass", "leave it out")
        self._known(of, [rotor.name for rotor in self.rotors], f"{at}.of", "counterweight or balancer")
        quantity = Quantity(Subject(name), MEASURES["mean"], rotors=_tuple(of))
        counted = counted_rotors(quantity, self.rotors)
        if not counted:
            raise Refused(f"{at}", name, "counts nothing in this engine", "add what it counts, or leave it out")
        for rotor in counted:
            if rotor.radius is None:
                raise Refused(f"{at}", name, f"counts the mass of '{rotor.name}', which has no radius", "give it one")
        return quantity

    @staticmethod
    def _known(names: list[str] | None, known: Sequence[str], where: str, what: str) -> None:
        if names is not None and not names:
            raise Refused(where, names, "is empty", "leave it out to count all")
        for name in names or ():
            if name not in known:
                raise Refused(where, name, f"is no {what} here", nearest(name, list(known)) if known else "add it")


def _tuple(names: list[str] | None) -> tuple[str, ...] | None:
    return None if names is None else tuple(names)


def _objective(file: ProblemFile, scene: _Scene) -> tuple[Term, ...]:
    table = file.objective
    if table is None:
        return (
            (Term(scene.quantity("mean mount force", QuantityTable(), "objective.minimise")),) if scene.mounts else ()
        )
    if (table.minimise is None) == (not table.terms):
        state = "is missing" if table.minimise is None else "is given twice, also as terms"
        raise Refused("objective.minimise", table.minimise, state, "give minimise or [[objective.terms]], one of them")
    if table.minimise in MOUNT_NAMES:
        return ()
    if table.minimise is not None:
        return (Term(scene.quantity(table.minimise, table, "objective.minimise")),)
    return tuple(
        Term(scene.quantity(term.quantity, term, f"objective.terms[{k + 1}].quantity"), term.weight)
        for k, term in enumerate(table.terms)
        if term.quantity not in MOUNT_NAMES
    )


def _limit(table: ConstraintTable, k: int, scene: _Scene) -> Limit:
    where = f"constraints[{k + 1}]"
    quantity = scene.quantity(table.limit, table, f"{where}.limit", table.of)
    for key in ("min", "outside"):
        if getattr(table, key) is not None:
            rule = f"does not go with {quantity.subject}, which has a largest value only"
            raise Refused(f"{where}.{key}", None, rule, "give max")
    if table.max is None:
        raise Refused(f"{where}.max", None, "is missing", "add it")
    maximum = measured(table.max, quantity.unit, f"{where}.max")
    if maximum < 0.0:
        raise Refused(f"{where}.max", table.max, "is negative, and no norm is", "give a value of zero or more")
    return Limit(table.name or quantity.name, quantity, maximum)
