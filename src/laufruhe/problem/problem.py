"""A design problem: an engine, open numbers, objective and limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path as FilePath
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import Complaint, ModelError, counted, wrong_call
from laufruhe.machine import CRANKSHAFT, Engine, OperatingPoint, SliderCrank
from laufruhe.machine.facing import Facing
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.willans import FrictionTest
from laufruhe.problem.advice import ADVICE
from laufruhe.problem.decision import Decision, Numbers, apply_decisions
from laufruhe.problem.goals import Goals
from laufruhe.problem.measure import Limit, Measure, PriorityLevel, Term
from laufruhe.problem.phasing import PhasingOf
from laufruhe.problem.sets import Value
from laufruhe.problem.statements import Statements
from laufruhe.units import quantity

if TYPE_CHECKING:
    import pint

Path: TypeAlias = tuple[str | int, ...]
"""Address of a number in a problem file: keys, and indices in lists from zero."""


@dataclass(frozen=True)
class Drawing:
    """Engine of a problem file, with operating points, decisions and mounts; a spring has fourteen numbers (E13)."""

    engine: Engine
    points: tuple[OperatingPoint, ...]
    decisions: tuple[Decision, ...]
    mount_numbers: tuple[tuple[float, ...], ...]


LEAD_DIGITS = 9
"""Decimal digits to which leads are compared [rad]."""
Rebuild: TypeAlias = Callable[[Mapping[Path, str | float]], Drawing]
"""Function that returns the drawing of a problem file with other numbers at some addresses."""


def no_file(changes: Mapping[Path, str | float]) -> Drawing:
    """Raise `ModelError`: the problem was not read from a file."""
    raise ModelError(f"{', '.join(map(str, changes))} needs a problem file, and this problem was made in code")


def _with_changes(
    rebuild: Rebuild, earlier: Mapping[Path, str | float], changes: Mapping[Path, str | float]
) -> Drawing:
    return rebuild({**earlier, **changes})


def _without_rounding(part: SliderCrank) -> SliderCrank:
    # without rounding errors in the lead of a facing piston
    facing = part.facing
    return (
        replace(part, facing=replace(facing, ahead=round(facing.ahead, LEAD_DIGITS)))
        if isinstance(facing, Facing)
        else part
    )


class Extra:
    """Additional part of a problem that an extension reads and decides; the core evaluates the other parts.

    Attributes
    ----------
    words
        Name of the request, as a plural or a noun with its article.
    """

    words: ClassVar[str]
    evaluates: ClassVar[bool] = False
    """True if `evaluated` states the objective with this extension."""

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of the open numbers that the extension decides."""
        return ()

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limits that the extension adds."""
        return ()

    def objective_name(self, name: str) -> str:
        """Return the name of the objective with this extension, from its name without."""
        return name

    def evaluated(self, _problem: Problem, result: Any, /) -> Any:
        """Return the result of the initial design of a problem with what the extension evaluates."""
        return result


E = TypeVar("E", bound=Extra)


@dataclass(frozen=True)
class Search:
    """Settings of searches for problems that are not convex.

    Attributes
    ----------
    starts, seed
        Largest number of start points, and seed of random ones.
    boxes
        Largest number of boxes in branch and bound; None lets the method choose.
    proves
        False if no lower bound is needed.
    solver
        Solver of cvxpy that proposes unbalances; empty for the solvers of this package.
    """

    starts: int = 16
    seed: int = 0
    boxes: int | None = None
    proves: bool = True
    solver: str = ""

    def boxes_or(self, usual: int) -> int:
        """Return the requested number of boxes, or the usual one."""
        return usual if self.boxes is None else self.boxes


@dataclass(frozen=True, eq=False)
class Origin:
    """File of a problem: its tables as they were read, and its path."""

    tables: Mapping[str, Any]
    path: FilePath


@dataclass(frozen=True, eq=False)
class KnownRows:
    """Rows of a measure over time, whose value is the largest length of constant + slope x.

    The rows have the shapes (k, d) and (k, d, n); x are the columns of the decisions that loads are affine in.
    """

    constant: NDArray[np.float64]
    slope: NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Problem(Goals, Statements):
    """A design problem as solvers and reports need it.

    Attributes
    ----------
    title, source, assumptions
        Texts for the reader of a report.
    engine
        Design as given; open numbers have their start values.
    decisions
        Open numbers, unbalances before those of the mounts.
    tolerance
        Relative gap at which an optimum counts as proven.
    mount_numbers
        Numbers of elastic mounts as given: stiffness, loss factor, damping, position, turned angles (E13).
    phasing
        Open throws, firing order and shafts; None if these are fixed.
    extras
        Requests of extensions, at most one of a class.
    origin
        File of the problem; None if it was made or changed in code.
    ranks
        Objectives in order of priority, the first equal to `objective`; empty for a single objective.
    fires_together
        True if cylinders are meant to fire at once.
    shown_units
        Pairs of an SI unit and the unit of reports in its place.
    warnings
        Warnings about the file, which stop nothing.
    friction
        Friction measurements that turn loads at the brake into indicated loads.
    known_rows
        Rows of measures in time whose largest length is convex in the unbalances.
    rebuild
        Function that builds engine, points and decisions from the file with other numbers.
    """

    name: str
    title: str
    engine: Engine
    points: tuple[OperatingPoint, ...]
    decisions: tuple[Decision, ...] = ()
    objective: tuple[Term, ...] = ()
    limits: tuple[Limit, ...] = ()
    source: str = ""
    assumptions: tuple[str, ...] = ()
    fidelity: Fidelity = EXACT
    tolerance: float = 1e-4
    mount_numbers: tuple[tuple[float, ...], ...] = ()
    search: Search = Search()
    phasing: Phasing | None = None
    extras: tuple[Extra, ...] = ()
    origin: Origin | None = field(default=None, compare=False, repr=False)
    ranks: tuple[PriorityLevel, ...] = ()
    fires_together: bool = False
    shown_units: tuple[tuple[str, str], ...] = ()
    warnings: tuple[Complaint, ...] = ()
    friction: tuple[FrictionTest, ...] = ()
    known_rows: Mapping[Measure, KnownRows] = field(default_factory=dict, compare=False, repr=False)
    rebuild: Rebuild = field(default=no_file, compare=False, repr=False)

    def __repr__(self) -> str:
        return f"<Problem {self.summary}>"

    @property
    def summary(self) -> str:
        """Description of the problem and its open numbers in one line."""
        engine = self.engine
        limits = (*self.limits, *(name for extra in self.extras for name in extra.limit_names))
        numbers = {"mount": engine.mounts, "operating point": self.points, "limit": limits}
        parts = [self.name, counted(len(engine.cylinders), "cylinder"), str(engine.cycle)]
        parts += [counted(len(parts_of_kind), name) for name, parts_of_kind in numbers.items()]
        return ", ".join(parts) + "; open: " + (", ".join(self.open_names) or "nothing")

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of the open numbers and choices."""
        names = self.phasing.open_names if self.phasing is not None else ()
        numbers = (decision.name + (" and angle" if decision.set.width > 1 else "") for decision in self.decisions)
        return (*names, *numbers, *(name for extra in self.extras for name in extra.open_names))

    def extra(self, kind: type[E]) -> E | None:
        """Return the request of a class, or None."""
        return next((extra for extra in self.extras if isinstance(extra, kind)), None)

    @property
    def drawing(self) -> Problem:
        """Problem without the requests of extensions."""
        return self.changed(extras=()) if self.extras else self

    @property
    def plausibility_warnings(self) -> tuple[Complaint, ...]:
        """Warnings about the file and about unusual numbers, the first for each place, which stop nothing."""
        first: dict[str, Complaint] = {}
        for advice in ADVICE.values():
            for warning in advice.about_problem(self):
                first.setdefault(warning.where, warning)
        return (*self.warnings, *first.values())

    @property
    def unbalances(self) -> tuple[Decision, ...]:
        """Decisions in which all loads are affine."""
        return tuple(decision for decision in self.decisions if decision.is_affine)

    @property
    def mount_decisions(self) -> tuple[Decision, ...]:
        """Decisions about the mounts."""
        return tuple(decision for decision in self.decisions if decision.mount_drives)

    @property
    def start(self) -> tuple[Value, ...]:
        """Values of the decisions in the design as given."""
        return tuple(decision.start for decision in self.decisions)

    @property
    def measures(self) -> tuple[Measure, ...]:
        """Measures that are minimised or limited."""
        later = (term.measure for rank in self.ranks[1:] for term in rank.terms)
        return (*(term.measure for term in self.objective), *later, *(limit.measure for limit in self.limits))

    @property
    def load_terms(self) -> tuple[Term, ...]:
        """Terms that are norms of loads or masses."""
        return tuple(term for term in self.objective if not term.measure.channel.is_number)

    @property
    def mount_terms(self) -> tuple[Term, ...]:
        """Terms that are numbers of a block on its mounts."""
        return tuple(term for term in self.objective if term.measure.is_mounting)

    @property
    def load_limits(self) -> tuple[Limit, ...]:
        """Limits on norms of loads and masses."""
        return tuple(
            limit for limit in self.limits if not limit.measure.channel.is_number or limit.measure in self.known_rows
        )

    @property
    def mount_limits(self) -> tuple[Limit, ...]:
        """Limits on numbers of a block on its mounts."""
        return tuple(limit for limit in self.limits if limit.measure.is_mounting)

    @property
    def uses_mounts(self) -> bool:
        """True if numbers of elastic mounts are open, minimised or limited."""
        return bool(self.mount_decisions) or any(measure.is_mounting for measure in self.measures)

    @property
    def balance(self) -> Problem:
        """Problem of the unbalances on fixed mounts: objective and limits of loads and masses alone."""
        return replace(
            self, decisions=self.unbalances, objective=self.load_terms, limits=self.load_limits, mount_numbers=()
        )

    @property
    def has_gas(self) -> bool:
        """True if gas acts at any operating point."""
        return any(self.fidelity.gas_of(point) is not None for point in self.points)

    @property
    def depends_on_gas(self) -> bool:
        """True if gas affects a measure: by the roll moment, or at an uneven speed by all loads."""
        return self.has_gas and (
            any(measure.depends_on_gas for measure in self.measures) or self.fidelity.has_uneven_speed
        )

    @property
    def gas_distinguishes_cylinders(self) -> bool:
        """True if a measure depends on gas, and the gas pressure differs between cylinders."""
        gases = [gas for gas in map(self.fidelity.gas_of, self.points) if gas is not None]
        if not gases or not self.depends_on_gas:
            return False
        parts = map(_without_rounding, self.engine.cylinders)
        return len({tuple(gas.alike(part) for gas in gases) for part in parts}) > 1

    @property
    def cylinders_are_alike(self) -> bool:
        """True if cylinders have equal masses, lengths and gas, so that they differ in place and firing alone."""
        parts = {
            replace(_without_rounding(part), name="", x=0.0, throw=0.0, bank=0.0, firing_angle=0.0, shaft=CRANKSHAFT)
            for part in self.engine.cylinders
        }
        return len(parts) <= 1 and not self.gas_distinguishes_cylinders

    @property
    def depends_on_firing_order(self) -> bool:
        """True if a measure depends on a crank star's firing order.

        It does with torsion, loads inside the crankcase with gas, and gas that differs between cylinders.
        """
        if self.gas_distinguishes_cylinders or any(measure.is_cylinder_resolved for measure in self.measures):
            return True
        loads = [measure.load for measure in self.measures if measure.is_inside]
        return (self.has_gas and bool(loads)) or not all(load.depends_on_unbalances for load in loads)

    @property
    def objective_name(self) -> str:
        """Name of the objective; empty without one."""
        terms = self.objective
        name = " + ".join(f"{term.weight:g} x {term.measure.name}" for term in terms)
        if len(terms) == 1 and terms[0].weight == 1.0:
            name = terms[0].measure.name
        for extra in self.extras if terms else ():
            name = extra.objective_name(name)
        return name

    @property
    def objective_unit(self) -> str | None:
        """SI unit of the objective, empty if its terms have several; None without an objective."""
        units = {term.measure.unit for term in self.objective}
        if not units:
            return None
        return units.pop() if len(units) == 1 else ""

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """Return the problem with other numbers of its file, named as in results or by paths as in studies.

        An open number starts at its new value and stays open.

        Parameters
        ----------
        values
            Names and values: `{"front web.mass": "1.2 kg", "engine.rod_ratio": 0.28}`. Numbers without a unit are in
            SI units, angles in radians; a complex unbalance or mass has size and angle.

        Raises
        ------
        laufruhe.errors.InputError
            If a file with these numbers would be refused.
        """
        if not isinstance(values, Mapping):
            raise wrong_call("values", values, "is no table of names and values", 'write {"engine.rod_ratio": 0.28}')
        for name in values:
            _check_name(name)
        return cast("Self", self._by_reader("edited", "with_values", values))

    def open(self, name: str, low: Any, high: Any, start: Any = None) -> Self:
        """Return the problem with one more open number; it starts at its present value unless `start` is given."""
        _check_name(name)
        return cast("Self", self._by_reader("edited", "open_number", name, low, high, start))

    def fix(self, name: str, value: Any = None) -> Self:
        """Return the problem with one number fixed, at `value` or at its start."""
        _check_name(name)
        return cast("Self", self._by_reader("edited", "fix_number", name, value))

    def __getitem__(self, name: str) -> float:
        """Return a number of the problem by its name in results or its path [SI]; an open one at its start."""
        return self._number(name)[0]

    def quantity(self, name: str, unit: Any = "") -> pint.Quantity[float]:
        """Return a number with its unit [pint], by its name in results or its path, in `unit` if given."""
        return quantity(*self._number(name), unit)

    def to_toml(self) -> str:
        """Return the text of the problem file."""
        return str(self._by_reader("text_of"))

    def _number(self, name: str) -> tuple[float, str]:
        _check_name(name)
        number: tuple[float, str] = self._by_reader("number_of", name)
        return number

    def _with_goal(self, key: str, keys: Mapping[str, Any], adds: bool) -> Self:
        goal = {name: value for name, value in keys.items() if name != "self" and value is not None}
        return cast("Self", self._by_reader("edited", "with_goal", key, goal, adds))

    def _by_reader(self, name: str, *arguments: Any) -> Any:
        if self.origin is None:
            raise ModelError(f"{self.name} was made or changed in code; edit numbers right after loading its file")
        # by its address, because this room imports no file format
        return resolve_name(f"laufruhe.files.reader:{name}")(self.origin, *arguments)

    def changed(self, **changes: Any) -> Problem:
        """Return the problem with other attributes; with open crank stars, the problem of every star has them too."""
        changes = {"origin": None, **changes}
        if self.phasing is not None:
            problem_of = self.phasing.problem_of
            phasing = replace(self.phasing, problem_of=lambda candidate: problem_of(candidate).changed(**changes))
            return replace(self, phasing=phasing, **changes)
        return replace(self, **changes)

    def at(self, fidelity: Fidelity) -> Problem:
        """Return the problem at another fidelity."""
        return self.changed(fidelity=fidelity)

    def fixed_at(self, values: Sequence[Value], decisions: Sequence[Decision] | None = None) -> Problem:
        """Return the problem with decisions fixed at these values; by default all decisions.

        If one is a number of the file, engine, operating points and drives of other decisions are built again.

        Raises
        ------
        ModelError
            If the engine cannot be built with these values.
        """
        fixed = self.decisions if decisions is None else tuple(decisions)
        value_of = {decision.name: value for decision, value in zip(fixed, values, strict=True)}
        redrawn = self._drawn({v.path: v.written(value_of[d.name]) for d in fixed for v in d.address_drives})
        if redrawn is not self:
            by_name = {decision.name: decision for decision in redrawn.decisions}
            fixed = tuple(by_name[decision.name] for decision in fixed)
        direct = [decision for decision in fixed if not decision.address_drives]
        numbers = redrawn.numbers([value_of[decision.name] for decision in direct], direct)
        rows = tuple(tuple(map(float, row)) for row in numbers.mounts)
        return replace(
            redrawn, engine=numbers.engine(redrawn.engine), mount_numbers=rows or redrawn.mount_numbers,
            decisions=tuple(decision for decision in redrawn.decisions if decision.name not in value_of),
        )  # fmt: skip

    def _drawn(self, changes: Mapping[Path, str | float]) -> Problem:
        """Return the problem built again from its file with `changes` of numbers; decisions keep their sets."""
        if not changes:
            return self
        drawing = self.rebuild(changes)
        by_name = {decision.name: decision for decision in drawing.decisions}
        for decision in self.decisions:
            if not decision.address_drives and decision.name not in by_name:
                raise ModelError(f"{decision.name} is open but has no effect in this engine; fix it")
        if len(drawing.points) != len(self.points):
            raise ModelError("an open number changes the number of operating points; fix it")
        # measures refer to operating points by name, and a name may contain an open speed
        points = tuple(
            replace(point, name=previous.name) for point, previous in zip(drawing.points, self.points, strict=True)
        )
        decisions = tuple(d if d.address_drives else replace(by_name[d.name], set=d.set) for d in self.decisions)
        return replace(
            self, engine=drawing.engine, points=points, mount_numbers=drawing.mount_numbers, decisions=decisions,
            rebuild=partial(_with_changes, self.rebuild, changes),
        )  # fmt: skip

    def design(self, values: Sequence[Value], decisions: Sequence[Decision] | None = None) -> Engine:
        """Return the engine of a design: `decisions`, by default all, have these values, the others their start."""
        selected = self.decisions if decisions is None else decisions
        if any(decision.address_drives for decision in selected):
            return self.fixed_at(values, selected).engine
        return self.numbers(values, selected).engine(self.engine)

    def numbers(self, values: Sequence[Any], decisions: Sequence[Decision] | None = None) -> Numbers:
        """Return unbalances, mounts and other open numbers of the engine with decisions at these values.

        Values may be symbols of a smooth program.
        """
        selected = self.decisions if decisions is None else decisions
        unbalances = {rotor.name: rotor.unbalance for rotor in self.engine.rotors}
        places = {rotor.name: list(rotor.place) for rotor in self.engine.rotors}
        on_mounts = any(decision.mount_drives for decision in selected)
        mounts = [list(row) for row in self.mount_numbers] if on_mounts else []
        return apply_decisions(Numbers(unbalances, places, mounts), selected, values)


def _check_name(name: object) -> None:
    if not isinstance(name, str):
        raise wrong_call("name", name, "is no name of a number", 'write for example "engine.rod_ratio"')


Phasing: TypeAlias = PhasingOf[Problem]
"""Phasing of a problem; `problem_of` returns problems."""
