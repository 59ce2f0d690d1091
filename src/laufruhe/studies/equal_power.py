"""An engine rebuilt at another size, so that it is evaluated and not scaled (Hasselgruber 1964, eqs. 14-23)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.errors import ModelError
from laufruhe.machine.layouts import Layout
from laufruhe.machine.scaling import scale_part
from laufruhe.problem.decision import Decision, RotorDrive
from laufruhe.problem.problem import Drawing, Problem


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

    Brake mean pressure and mean piston speed stay, so the gas model is untouched. Raise `ModelError` if cylinders
    differ in bore or stroke, or the engine stands on elastic mounts: no rule scales a block and its springs.
    """
    cylinders = problem.engine.slider_cranks
    if problem.engine.block is not None:
        raise ModelError("equal_power_to cannot scale a block on elastic mounts; remove equal_power_to")
    if len({(part.crank_radius, part.bore) for part in cylinders}) > 1:
        raise ModelError(
            "cylinders differ in bore or stroke, so no common scale gives equal power; give all the same size"
        )
    scale, phasing = equal_power_scale(len(cylinders), reference_cylinders), problem.phasing
    k = scale.length

    def scaled_layout(layout: Layout) -> Layout:
        places, throws = (tuple(k * x for x in xs) for xs in (layout.positions, layout.throw_positions))
        return replace(layout, positions=places, throw_positions=throws)

    if phasing is not None:
        # engines of crank stars are built in the new size
        problem_of, layout = phasing.problem_of, phasing.layout
        phasing = replace(
            phasing,
            problem_of=lambda candidate: at_equal_power(problem_of(candidate), reference_cylinders),
            layout=lambda bank, split: scaled_layout(layout(bank, split)),
        )
    drawing = _scaled(Drawing(problem.engine, problem.points, problem.decisions, problem.mount_numbers), scale)
    return replace(
        problem,
        origin=None,
        phasing=phasing,
        engine=drawing.engine,
        points=drawing.points,
        decisions=drawing.decisions,
        rebuild=lambda changes: _scaled(problem.rebuild(changes), scale),
    )


def _scaled(drawing: Drawing, scale: EqualPowerScale) -> Drawing:
    k, m, engine = scale.length, scale.mass, drawing.engine
    load = engine.load_torque
    extras = tuple(extra.scaled(k, m) for extra in engine.extras)
    still = {extra.name for extra in extras if extra in engine.extras}
    engine = replace(
        engine,
        slider_cranks=tuple(scale_part(part, k, m) for part in engine.slider_cranks),
        rotors=tuple(scale_part(rotor, k, m) for rotor in engine.rotors),
        extras=extras,
        load_torque=load and replace(load, torques=tuple(torque / scale.speed for torque in load.torques)),
        mounts=tuple(scale_part(mount, k, m) for mount in engine.mounts),
    )
    return replace(
        drawing,
        engine=engine,
        points=tuple(replace(point, speed=point.speed * scale.speed) for point in drawing.points),
        decisions=tuple(
            decision if decision.kind.name in still else _decision(decision, k, m) for decision in drawing.decisions
        ),
    )


def _decision(decision: Decision, length: float, mass: float) -> Decision:
    """Return a decision of an engine scaled to equal power: bounds, start and gains times length and mass factors.

    Other numbers of the file, such as an open stroke, keep their values: the engine is built with them and then scaled.
    """
    if decision.address_drives:
        return decision
    sizes = {"": 1.0, "rad": 1.0, "m": length, "kg": mass, "kg m": mass * length}
    if decision.unit not in sizes:
        raise ModelError(f"equal_power_to has no rule for {decision.name}, which is open; fix it")
    size = sizes[decision.unit]
    return replace(
        decision,
        set=decision.set.scaled(size),
        start=decision.start * size,
        drives=tuple(
            replace(drive, gain=drive.gain * (mass * length / size)) if isinstance(drive, RotorDrive) else drive
            for drive in decision.drives
        ),
    )
