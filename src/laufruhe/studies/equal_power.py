"""An engine rebuilt at another size, so that it is evaluated and not scaled (Hasselgruber 1964, eqs. 14-23)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.machine.layouts import Layout
from laufruhe.problem.decision import Decision, RotorDrive
from laufruhe.problem.problem import Problem

# factors on a decision when the engine is resized, by unit
_FRACTION, _LENGTH, _MASS, _UNBALANCE = "", "m", "kg", "kg m"


@dataclass(frozen=True)
class EqualPowerScale:
    """Factors from the reference engine to one of z cylinders and the same power.

    Volumes and masses of parts grow as the cube of length (eq. 21), forces of gas and inertia as its square (eq. 23).

    Attributes
    ----------
    length
        Factor of bore, stroke and every other length (eqs. 18, 19).
    speed
        Factor of crank speed (eq. 20).
    """

    length: float
    speed: float
    mass: float


def equal_power_scale(cylinders: int, reference_cylinders: int) -> EqualPowerScale:
    """Return the factors from an engine with `reference_cylinders` to one with `cylinders` (eqs. 14-23)."""
    ratio = cylinders / reference_cylinders
    return EqualPowerScale(length=ratio**-0.5, speed=ratio**0.5, mass=ratio**-1.5)


def at_equal_power(problem: Problem, reference_cylinders: int) -> Problem:
    """Return the problem with every cylinder resized so that the engine has the reference's power.

    Brake mean pressure and mean piston speed stay, so the gas model is untouched. `ModelError` where cylinders differ
    in bore or stroke, or stand on elastic mounts: the rules have none for a block and its springs.
    """
    cylinders = problem.engine.slider_cranks
    if problem.engine.block is not None:
        raise ModelError("the rules of equal power do not cover a block and its springs; leave equal_power_to out")
    if len({(part.crank_radius, part.bore) for part in cylinders}) > 1:
        raise ModelError("cylinders differ in bore or stroke, so no one scale gives equal power; make them equal")
    scale, phasing = equal_power_scale(len(cylinders), reference_cylinders), problem.phasing
    if phasing is not None:
        # stars are realised in the new size
        realise, layout = phasing.realise, phasing.layout
        phasing = replace(
            phasing,
            realise=lambda candidate: at_equal_power(realise(candidate), reference_cylinders),
            layout=lambda bank, split: _layout(layout(bank, split), scale),
        )
    return replace(
        problem,
        origin=None,
        phasing=phasing,
        engine=_engine(problem.engine, scale),
        points=tuple(replace(point, speed=point.speed * scale.speed) for point in problem.points),
        decisions=tuple(_decision(decision, scale) for decision in problem.decisions),
    )


def _engine(engine: Engine, scale: EqualPowerScale) -> Engine:
    k, m = scale.length, scale.mass
    return replace(
        engine,
        slider_cranks=tuple(part.scaled(k, m) for part in engine.slider_cranks),
        rotors=tuple(
            replace(
                rotor,
                unbalance=rotor.unbalance * m * k,
                radius=None if rotor.radius is None else rotor.radius * k,
            ).placed(*(k * along for along in rotor.place))
            for rotor in engine.rotors
        ),
        bearings=tuple(bearing.scaled(k) for bearing in engine.bearings),
        extras=tuple(extra.scaled(k, m) for extra in engine.extras),
        mounts=tuple(
            mount.mapped(lambda m: replace(m, position=(m.position[0] * k, m.position[1] * k, m.position[2] * k)))
            for mount in engine.mounts
        ),
    )


def _layout(layout: Layout, scale: EqualPowerScale) -> Layout:
    places, throws = (
        tuple(scale.length * x for x in positions) for positions in (layout.positions, layout.throw_positions)
    )
    return replace(layout, positions=places, throw_positions=throws)


def _decision(decision: Decision, scale: EqualPowerScale) -> Decision:
    sizes = {_FRACTION: 1.0, _LENGTH: scale.length, _MASS: scale.mass, _UNBALANCE: scale.mass * scale.length}
    size = sizes[decision.unit]
    gain = scale.mass * scale.length / size
    return replace(
        decision,
        set=decision.set.scaled(size),
        start=decision.start * size,
        drives=tuple(
            replace(drive, gain=drive.gain * gain) if isinstance(drive, RotorDrive) else drive
            for drive in decision.drives
        ),
    )
