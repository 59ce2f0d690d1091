"""Method of solution: open numbers and measures that it accepts, and its solver."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial

from laufruhe.numerics.norms import Norm
from laufruhe.numerics.processes import call_by_name
from laufruhe.problem.channels import AT_EACH_MOUNT, CHANNELS, OF_MOUNTING, Channel
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence, dependence, open_kinds
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.accuracy import solve_accurately
from laufruhe.solvers.result import Result

# dependences on crank stars and optional shafts that methods of crank stars accept
BUILT = (Dependence.SHIFT, Dependence.AFFINE, Dependence.SWING)
OF_MOUNTS = AT_EACH_MOUNT | {*OF_MOUNTING, *(channel for channel in CHANNELS.values() if channel.simulation)}
"""Channels for which programs of mounts have formulas or a simulation."""
OF_SIZES_ALONE = frozenset(channel for channel in CHANNELS.values() if channel.size_value is not None)
"""Channels that depend on the sizes of an engine only."""
OF_TORQUE = frozenset(channel for channel in CHANNELS.values() if channel.depends_on_torque)
"""Channels that depend on the torque of the crank, and on the inertia of all that turns with it."""


def imported(address: str) -> Callable[[Problem], Result]:
    """Return a solver by its address `module:function`, which is imported when the solver is called."""
    return partial(call_by_name, address)


def is_no_number(channel: Channel) -> bool:
    """Return True if a channel is a load or a mass."""
    return not channel.is_number


def is_pointwise(norm: Norm) -> bool:
    """Return True if a norm is declared convex and a function of the values at single crank angles."""
    return norm.is_convex and norm.is_pointwise


def is_convex(norm: Norm) -> bool:
    """Return True if a norm is declared convex."""
    return norm.is_convex


@dataclass(frozen=True)
class Method:
    """Method that solves problems with certain open numbers and measures.

    Attributes
    ----------
    name
        Name for messages and reports.
    dependences
        Kinds of numbers that may be open together, each with the permitted dependences of measures on it.
        `Dependence.NONE` is always permitted.
    strength
        Kind of proof that its lower bounds can give.
    solver
        Return the best design with its certificate; `imported` returns one whose module is imported when it is called.
    refines_fidelity
        True if more steps of the gas are taken when the design needs them (F9).
    known_channels
        Channels with formulas of its own, for any dependence but UNKNOWN.
    accepts_norm
        Return True if a norm of a load is permitted.
    accepts_constant
        Return True if another channel that no decision changes is permitted.
    accepts_problem
        Return True if all else about a problem is permitted.
    proves
        What the method proves, in words for the user.
    before
        Name of the method that follows one of an extension in the table.
    """

    name: str
    dependences: Mapping[Kind, Collection[Dependence]]
    strength: ProofStrength
    solver: Callable[[Problem], Result]
    refines_fidelity: bool = False
    known_channels: frozenset[Channel] = frozenset()
    accepts_norm: Callable[[Norm], bool] = is_convex
    accepts_constant: Callable[[Channel], bool] = lambda _: True
    accepts_problem: Callable[[Problem], bool] = lambda _: True
    proves: str = ""
    before: str = ""

    @property
    def kinds(self) -> frozenset[Kind]:
        """Kinds of numbers that may be open together."""
        return frozenset(self.dependences)

    def suits(self, problem: Problem) -> bool:
        """Return True if the method can solve a problem with these open numbers and measures."""
        kinds = open_kinds(problem)
        return (
            kinds <= self.kinds
            and all(self._accepts(m, kinds, problem) for m in problem.measures)
            and self.accepts_problem(problem)
        )

    def _accepts(self, measure: Measure, kinds: Collection[Kind], problem: Problem) -> bool:
        # the method permits the dependence of the measure on these kinds
        if measure in problem.known_rows:
            return all(Dependence.AFFINE in self.dependences[kind] for kind in kinds)
        if measure.is_load and not self.accepts_norm(measure.norm):
            return False
        by_kind = {kind: dependence(measure.channel, kind, problem) for kind in kinds}
        if measure.channel in self.known_channels:
            return Dependence.UNKNOWN not in by_kind.values()
        if all(value is Dependence.NONE for value in by_kind.values()):
            return self.accepts_constant(measure.channel)
        return all(value is Dependence.NONE or value in self.dependences[kind] for kind, value in by_kind.items())

    def solve(self, problem: Problem) -> Result:
        """Return the best design, with more steps of the gas if the design needs them (F9)."""
        return solve_accurately(problem, self.solver) if self.refines_fidelity else self.solver(problem)
