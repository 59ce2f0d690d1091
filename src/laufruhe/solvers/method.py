"""A row of the table of methods: what it can have open, what may be asked, and who decides."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from laufruhe.numerics.norms import Norm
from laufruhe.problem.channels import AT_EACH_MOUNT, CHANNELS, OF_MOUNTING, Channel
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence, dependence, kinds_of
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.accuracy import solve_within
from laufruhe.solvers.result import Result

# of stars and choices of shafts: masses are those of the shafts that are built, numbers of a signal are told apart
BUILT = (Dependence.SHIFT, Dependence.AFFINE, Dependence.SWING)
OF_MOUNTS = AT_EACH_MOUNT | {*OF_MOUNTING, *(channel for channel in CHANNELS.values() if channel.simulation)}
"""Channels that programs of mounts have formulas for, or peaks of a simulation."""
OF_SIZES_ALONE = frozenset(channel for channel in CHANNELS.values() if channel.of_engine is not None)
"""Channels that are functions of the sizes of an engine alone."""


def is_no_number(channel: Channel) -> bool:
    """Return whether a channel is a load or a mass."""
    return not channel.is_number


def is_pointwise(norm: Norm) -> bool:
    """Return whether a norm claims to be convex in what each angle has."""
    return norm.is_convex and norm.is_pointwise


def is_convex(norm: Norm) -> bool:
    """Return whether a norm claims to be convex."""
    return norm.is_convex


@dataclass(frozen=True)
class Method:
    """A way of deciding.

    Attributes
    ----------
    name
        In words.
    needs
        Kinds that it can have open together, and how what is asked may depend on each of them; NONE is always allowed.
    strength
        What its bounds can prove.
    solver
        Return the best design with its certificate. The function imports its module when it is first called.
    judges_fidelity
        Whether the fidelity is chosen again where the design needs a better one than that given (F11).
    knows
        Channels that it has formulas of its own for, however they depend on what is open, but not UNKNOWN.
    norms
        Return whether it suits a norm of a load, by what that claims.
    still
        Return whether a channel that it does not know, and that nothing open moves, may be asked beside.
    also
        Return whether other facts of a problem suit it.
    proves
        What of the best design, in words.
    before
        Name of the row that one of an extension stands before.
    """

    name: str
    needs: Mapping[Kind, Collection[Dependence]]
    strength: ProofStrength
    solver: Callable[[Problem], Result]
    judges_fidelity: bool = False
    knows: frozenset[Channel] = frozenset()
    norms: Callable[[Norm], bool] = is_convex
    still: Callable[[Channel], bool] = lambda _: True
    also: Callable[[Problem], bool] = lambda _: True
    proves: str = ""
    before: str = ""

    @property
    def decides(self) -> frozenset[Kind]:
        """Kinds that it can have open together."""
        return frozenset(self.needs)

    def suits(self, problem: Problem) -> bool:
        """Return whether it decides all that is open and asked of a problem."""
        kinds = kinds_of(problem)
        return (
            kinds <= self.decides
            and all(self._names(m, kinds, problem) for m in problem.measures)
            and self.also(problem)
        )

    def _names(self, measure: Measure, kinds: Collection[Kind], problem: Problem) -> bool:
        # the measure depends on these kinds in a way that the method allows
        if measure in problem.known_rows:
            return all(Dependence.AFFINE in self.needs[kind] for kind in kinds)
        if measure.is_load and not self.norms(measure.norm):
            return False
        found = {kind: dependence(measure.channel, kind, problem) for kind in kinds}
        if measure.channel in self.knows:
            return Dependence.UNKNOWN not in found.values()
        if all(each is Dependence.NONE for each in found.values()):
            return self.still(measure.channel)
        return all(each is Dependence.NONE or each in self.needs[kind] for kind, each in found.items())

    def solve(self, problem: Problem) -> Result:
        """Return the best design, at a better fidelity if the method judges that and the design needs it."""
        return solve_within(problem, self.solver) if self.judges_fidelity else self.solver(problem)
