"""A design problem: an engine, what may be decided, what is wanted, what is forbidden."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import Complaint, ModelError, counted, wrong_call
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.willans import FrictionTest
from laufruhe.problem.decision import Decision, Kind, Numbers, moved_numbers
from laufruhe.problem.drawing import Beside, Rebuild, no_file
from laufruhe.problem.extra import Extra
from laufruhe.problem.measure import Limit, Measure, Rank, Term
from laufruhe.problem.phasing import PhasingOf
from laufruhe.problem.plausibility import doubts
from laufruhe.problem.sets import Value

E = TypeVar("E", bound=Extra)


@dataclass(frozen=True)
class Search:
    """How searches go about what is not convex.

    Attributes
    ----------
    starts, seed
        The most points that a search starts from, and the seed of those drawn at random.
    boxes
        That what is open may be divided into for a proof; as is worth it when None.
    proves
        Whether what is found is to be proven.
    """

    starts: int = 16
    seed: int = 0
    boxes: int | None = None
    proves: bool = True

    def boxes_or(self, usual: int) -> int:
        """Return how many boxes are asked for, or the usual number."""
        return usual if self.boxes is None else self.boxes


class Origin(Protocol):
    """The file of a problem, in which numbers may be changed by name."""

    @property
    def file(self) -> tuple[Mapping[str, Any], Path]:
        """Tables as they were read, and where they stand."""

    def with_values(self, values: Mapping[str, Any]) -> Problem:
        """Numbers at other values."""

    def opened(self, name: str, low: Any, high: Any, start: Any) -> Problem:
        """A number left open."""

    def fixed(self, name: str, value: Any) -> Problem:
        """A number fixed."""


@dataclass(frozen=True, eq=False)
class KnownRows:
    """Rows of a measure that is the largest length of constant + slope x, x the columns of what loads are affine in.

    Attributes
    ----------
    constant, slope
        Shapes (k, d) and (k, d, n).
    """

    constant: NDArray[np.float64]
    slope: NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Problem:
    """Everything that a solver and a report need to know.

    Attributes
    ----------
    name
        Of the file, for results.
    title, source, assumptions
        For the reader of a report.
    engine
        The design as given; open numbers stand at their start.
    points
        Operating points.
    decisions
        Open numbers, unbalances before those of the mounts.
    objective
        Weighted sum of measures to be least.
    limits
        What is forbidden.
    fidelity
        What of the physics is kept.
    sharply
        Whether a gap within the tolerance is closed further where that is cheap beside a command (P10).
    tolerance
        Relative gap at which an optimum counts as proven.
    mount_numbers
        Of elastic mounts as given: stiffness, loss factor, damping, position, turned angles (E13).
    search
        How searches go about what is not convex.
    phasing
        What of throws, firing order and the choice of shafts is open; None if nothing is.
    extras
        What extensions ask beyond the drawing, one of a class.
    ranks
        All objectives in order where there are several, `objective` the first of them; else none.
    origin
        The file that it was read from; None where it was made or changed in code.
    fires_together
        Whether cylinders are meant to fire at once.
    friction
        Measurements that loads at the brake are made indicated ones by.
    known_rows
        Of measures in time, whose largest length is convex in what loads are affine in.
    rebuild
        What gives the drawing of its file with other numbers.
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
    sharply: bool = False
    ranks: tuple[Rank, ...] = ()
    fires_together: bool = False
    friction: tuple[FrictionTest, ...] = ()
    known_rows: Mapping[Measure, KnownRows] = field(default_factory=dict, compare=False, repr=False)
    rebuild: Rebuild = field(default=no_file, compare=False, repr=False)

    def __repr__(self) -> str:
        return f"<Problem {self.summary}>"

    def _repr_html_(self) -> str:
        return f"<strong>{html.escape(self.title)}</strong><br>{html.escape(self.summary)}"

    @property
    def summary(self) -> str:
        """What the problem is about and what of it is open, in one line."""
        engine = self.engine
        numbers = {"mount": engine.mounts, "operating point": self.points, "limit": self.limits}
        parts = [self.name, counted(len(engine.cylinders), "cylinder"), str(engine.cycle)]
        parts += [counted(len(each), name) for name, each in numbers.items()]
        return ", ".join(parts) + "; open: " + (", ".join(self.open_names) or "nothing")

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of what is open."""
        names = self.phasing.open_names if self.phasing is not None else ()
        numbers = (decision.name + (" and angle" if decision.set.width > 1 else "") for decision in self.decisions)
        return (*names, *numbers, *(name for extra in self.extras for name in extra.open_names))

    def extra(self, kind: type[E]) -> E | None:
        """Return what an extension asks of a class; None where it asks nothing."""
        return next((one for one in self.extras if isinstance(one, kind)), None)

    @property
    def drawing(self) -> Problem:
        """The problem without what extensions ask beyond it."""
        return self.changed(extras=()) if self.extras else self

    @property
    def doubts(self) -> tuple[Complaint, ...]:
        """What is so unusual that its author is asked whether it is meant; nothing stops for it."""
        return doubts(self.engine, self.points, self.fires_together or self.phasing is not None)

    @property
    def unbalances(self) -> tuple[Decision, ...]:
        """Decisions that loads are affine in."""
        return tuple(decision for decision in self.decisions if decision.is_affine)

    @property
    def mount_decisions(self) -> tuple[Decision, ...]:
        """Decisions about the mounts."""
        return tuple(decision for decision in self.decisions if decision.mount_drives)

    @property
    def start(self) -> tuple[Value, ...]:
        """Decisions of the design as given."""
        return tuple(decision.start for decision in self.decisions)

    @property
    def measures(self) -> tuple[Measure, ...]:
        """All that is minimised or limited."""
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
    def asks_mounts(self) -> bool:
        """Whether anything of elastic mounts is open or asked."""
        return bool(self.mount_decisions) or any(measure.is_mounting for measure in self.measures)

    @property
    def balance(self) -> Problem:
        """The problem on its mounts as they stand: what is open, wanted and forbidden of loads and masses alone."""
        return replace(
            self, decisions=self.unbalances, objective=self.load_terms, limits=self.load_limits, mount_numbers=()
        )

    @property
    def has_gas(self) -> bool:
        """Whether gas acts at any operating point."""
        return any(self.fidelity.gas_of(point) is not None for point in self.points)

    @property
    def feels_gas(self) -> bool:
        """Whether gas loads what is minimised or limited: its roll moment alone, and all where it drives the speed."""
        return self.has_gas and (any(measure.feels_gas for measure in self.measures) or self.fidelity.is_uneven)

    @property
    def feels_order(self) -> bool:
        """Whether anything asked changes with the firing order of one star: twist, and all inside with gas."""
        felt = [measure.load for measure in self.measures if measure.feels_order]
        if any(measure.is_told_apart for measure in self.measures):
            return True
        return (self.has_gas and bool(felt)) or not all(load.feels_unbalances for load in felt)

    @property
    def flywheel_decisions(self) -> tuple[Decision, ...]:
        """Decisions about the flywheel."""
        return tuple(decision for decision in self.decisions if decision.kind is Kind.FLYWHEEL)

    @property
    def objective_name(self) -> str:
        """What is minimised, in words; empty where nothing is."""
        terms = self.objective
        name = " + ".join(f"{term.weight:g} x {term.measure.name}" for term in terms)
        if len(terms) == 1 and terms[0].weight == 1.0:
            name = terms[0].measure.name
        for extra in self.extras if terms else ():
            name = extra.objective_name(name)
        return name

    @property
    def objective_unit(self) -> str | None:
        """SI unit of what is minimised, empty where its terms have several; None where nothing is."""
        units = {term.measure.unit for term in self.objective}
        if not units:
            return None
        return units.pop() if len(units) == 1 else ""

    def with_values(self, values: Mapping[str, Any]) -> Problem:
        """The problem with other numbers, by the names that results show, or by paths as studies have them.

        A number that is open starts there and stays open.

        Parameters
        ----------
        values
            As a file has them: `{"front web.mass": "1.2 kg", "engine.rod_ratio": 0.28}`.

        Raises
        ------
        laufruhe.errors.InputError
            In the words of a file with that number.
        """
        if not isinstance(values, Mapping):
            raise wrong_call("values", values, "is no table of names and values", 'write {"engine.rod_ratio": 0.28}')
        for name in values:
            _check_name(name)
        return self._origin.with_values(values)

    def open(self, name: str, low: Any, high: Any, start: Any = None) -> Problem:
        """The problem with one more number open between two bounds; it starts where it stands unless told."""
        _check_name(name)
        return self._origin.opened(name, low, high, start)

    def fix(self, name: str, value: Any = None) -> Problem:
        """The problem with one number fixed, at a value or where it starts."""
        _check_name(name)
        return self._origin.fixed(name, value)

    @property
    def _origin(self) -> Origin:
        if self.origin is None:
            raise ModelError(f"{self.name} was made or changed in code; change numbers of what was loaded, before that")
        return self.origin

    def changed(self, **changes: Any) -> Problem:
        """The same problem with other attributes, every design of an open star included."""
        changes = {"origin": None, **changes}
        if self.phasing is not None:
            realise = self.phasing.realise
            phasing = replace(self.phasing, realise=lambda candidate: realise(candidate).changed(**changes))
            return replace(self, phasing=phasing, **changes)
        return replace(self, **changes)

    def at(self, fidelity: Fidelity) -> Problem:
        """The same problem at another fidelity."""
        return self.changed(fidelity=fidelity)

    def held(self, values: Sequence[Value], decisions: Sequence[Decision] | None = None) -> Problem:
        """Return the problem with decisions, all of them unless some are named, held at these values.

        A number of the file puts the engine, its operating points and what follows of other decisions together anew.

        Raises
        ------
        ModelError
            If there is no such engine.
        """
        held = self.decisions if decisions is None else tuple(decisions)
        value_of = {decision.name: value for decision, value in zip(held, values, strict=True)}
        drawn = self._drawn({v.path: v.written(value_of[d.name]) for d in held for v in d.address_drives})
        if drawn is not self:
            known = {decision.name: decision for decision in drawn.decisions}
            held = tuple(known[decision.name] for decision in held)
        moved = [decision for decision in held if not decision.address_drives]
        numbers = drawn.numbers([value_of[decision.name] for decision in moved], moved)
        rows = tuple(tuple(map(float, row)) for row in numbers.mounts)
        return replace(
            drawn, engine=numbers.engine(drawn.engine), mount_numbers=rows or drawn.mount_numbers,
            decisions=tuple(decision for decision in drawn.decisions if decision.name not in value_of),
        )  # fmt: skip

    def _drawn(self, changes: Mapping[tuple[str | int, ...], str | float]) -> Problem:
        """The problem as its file draws it with numbers changed; decisions keep their sets, and follow as there."""
        if not changes:
            return self
        found = self.rebuild(changes)
        known = {decision.name: decision for decision in found.decisions}
        for decision in self.decisions:
            if not decision.address_drives and decision.name not in known:
                raise ModelError(f"{decision.name} is open, and nothing of this engine follows it")
        if len(found.points) != len(self.points):
            raise ModelError("another number of operating points follows from an open number; fix it")
        # measures know operating points by name, and a name may be the speed that is open
        points = tuple(replace(new, name=own.name) for new, own in zip(found.points, self.points, strict=True))
        decisions = tuple(d if d.address_drives else replace(known[d.name], set=d.set) for d in self.decisions)
        return replace(
            self, engine=found.engine, points=points, mount_numbers=found.mount_numbers, decisions=decisions,
            rebuild=Beside(self.rebuild, changes),
        )  # fmt: skip

    def design(self, values: Sequence[Value], decisions: Sequence[Decision] | None = None) -> Engine:
        """The engine with decisions, all of them unless some are named, in place of those it was given with."""
        moved = self.decisions if decisions is None else decisions
        if any(decision.address_drives for decision in moved):
            return self.held(values, moved).engine
        return self.numbers(values, moved).engine(self.engine)

    def numbers(self, values: Sequence[Any], decisions: Sequence[Decision] | None = None) -> Numbers:
        """The numbers of the engine with decisions at these values; symbols do as well."""
        moved = self.decisions if decisions is None else decisions
        on_mounts = any(decision.mount_drives for decision in moved)
        given = Numbers.of(self.engine, self.mount_numbers if on_mounts else ())
        return moved_numbers(given, moved, values)


def _check_name(name: object) -> None:
    if not isinstance(name, str):
        raise wrong_call("name", name, "is no name of a number", 'write for example "engine.rod_ratio"')


Phasing: TypeAlias = PhasingOf[Problem]
"""Of a problem; `realise` gives problems."""
