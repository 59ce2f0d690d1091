"""Reference of fidelities: a design by the best model (F6, F9)."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import rotor_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.error_bounds import (
    REFERENCE_SAMPLES,
    ROUNDING,
    gas_step_error,
    load_sampling_error,
    relative,
    signals,
)
from laufruhe.problem.evaluation import Evaluation, evaluate, value_of_loads
from laufruhe.problem.problem import Problem


def reference(problem: Problem, engine: Engine | None = None, samples: int = REFERENCE_SAMPLES) -> Evaluation:
    """Return the evaluation of a design at the highest fidelity: all orders and modes, rigid rods, many gas samples.

    The crank speed is uneven if it is in the problem. By default the design is that of the problem as given.
    """
    return evaluate(problem.at(problem.fidelity.exact(samples)), engine)


class Reference:
    """Evaluation of one design by the best model.

    Attributes
    ----------
    best
        Evaluation by the best model.
    terms
        Terms of the objective that are norms of loads, which a fidelity can change.
    value
        Objective of loads and masses by the best model [SI].
    """

    def __init__(self, problem: Problem, best: Evaluation | None = None) -> None:
        self.problem, self.best = problem, reference(problem) if best is None else best
        self.terms = [term for term in problem.objective if term.measure.is_load]
        self.value = value_of_loads(problem, self.best)
        self._values: dict[Fidelity, float] = {}

    def value_at(self, fidelity: Fidelity) -> float:
        """Return the objective of loads and masses of the same design at another fidelity [SI]."""
        key = replace(fidelity, tolerance=None)
        if key not in self._values:
            self._values[key] = value_of_loads(
                self.problem, evaluate(replace(self.problem, fidelity=key), self.best.engine)
            )
        return self._values[key]

    def relative_change(self, fidelity: Fidelity, other: Fidelity | None = None) -> float:
        """Return the relative change of the objective between a fidelity and another one, by default the reference."""
        value = self.value if other is None else self.value_at(other)
        return relative(abs(self.value_at(fidelity) - value), self.value)

    @cached_property
    def doubt(self) -> float:
        """Error of the reference itself, in the unit of the objective (F7-F9)."""
        error = load_sampling_error(self.problem, self.best) + gas_step_error(self.problem, self.best)
        return error + ROUNDING * self.value

    def error_of(self, evaluation: Evaluation) -> float:
        """Return the error of the objective of an evaluation of the same design: change and doubt (F6).

        The error is relative to the objective of this evaluation, and infinite if only that objective is zero.
        """
        value = value_of_loads(self.problem, evaluation)
        return relative(abs(value - self.value) + self.doubt, value)

    @cached_property
    def repeats(self) -> int:
        """Number of periods of all measured signals within the working cycle, for any values of the decisions."""
        rotors = [r for r in self.problem.engine.rotors if r.unbalance != 0 or r.name in self.open_rotors]
        ratios = tuple(as_order(abs(rotor.shaft.ratio)) for rotor in rotors)
        bases = [signal.repeat_order(ratios) for signal in self.exciting_signals]
        return int(min(bases) / self.problem.engine.cycle.base_order) if bases else 1

    @property
    def exciting_signals(self) -> list[Spectrum]:
        """Spectra of the loads on the block, of unit open unbalances, and of measured loads inside the crankcase."""
        inside = [s for term in self.terms if term.measure.is_inside for s in signals(term.measure, self.best)]
        return [*(loads.wrench for loads in self.best.loads), *self.open_rotor_wrenches, *inside]

    @property
    def open_rotors(self) -> set[str]:
        """Names of the rotors with open unbalance or position."""
        sized = {drive.rotor for decision in self.problem.decisions for drive in decision.rotor_drives}
        return sized | {drive.rotor for decision in self.problem.decisions for drive in decision.place_drives}

    @cached_property
    def mounting(self) -> ElasticMounting | None:
        """Block on elastic mounts; None for rigid mounts."""
        return None if self.best.engine.block is None else mounting_in(self.best.engine)

    @cached_property
    def open_rotor_wrenches(self) -> list[Spectrum]:
        """Wrenches of unit unbalances of open rotors at their places, and with each open coordinate 1 m larger."""
        rotors = [replace(r, unbalance=1.0) for r in self.problem.engine.rotors if r.name in self.open_rotors]
        by_name = {rotor.name: rotor for rotor in rotors}
        for drive in (drive for decision in self.problem.decisions for drive in decision.place_drives):
            rotor = by_name[drive.rotor]
            rotors.append(rotor.placed(*(coordinate + (k == drive.axis) for k, coordinate in enumerate(rotor.place))))
        return [rotor_loads([rotor], 1.0, self.problem.engine.cycle) for rotor in rotors]

    @cached_property
    def open_rotor_modes(self) -> set[int]:
        """Numbers of the natural modes that open rotors can excite, 1 the lowest."""
        if self.mounting is None:
            return set()
        return {mode + 1 for load in self.open_rotor_wrenches for mode in self.mounting.excited(load)}

    @cached_property
    def excited_modes(self) -> tuple[int, ...]:
        """Numbers of the natural modes that the loads or open rotors excite, 1 the lowest (E12)."""
        if self.mounting is None:
            return ()
        modes = {mode + 1 for loads in self.best.loads for mode in self.mounting.excited(loads.wrench)}
        return tuple(sorted(modes | self.open_rotor_modes))

    @cached_property
    def mode_contributions(self) -> dict[int, float]:
        """Relative change of the objective without each excited mode."""
        other_modes = {mode: tuple(m for m in self.excited_modes if m != mode) for mode in self.excited_modes}
        return {
            mode: self.relative_change(replace(self.best.fidelity, modes=modes)) for mode, modes in other_modes.items()
        }
