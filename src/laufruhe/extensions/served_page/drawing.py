"""Front view of the engine for the page: positions of its parts over a cycle, and unbalances of its weights."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from laufruhe.machine import Rotor, SliderCrank
from laufruhe.machine.rotor import Role
from laufruhe.present.poses import STEEL, THICKNESS, Pose, bore_of
from laufruhe.problem.problem import Problem

STEPS = 72
"""Steps over one turn of the crank."""
_MAX_PARTS = 48


def drawing_of(problem: Problem) -> dict[str, Any] | None:
    """Return the front view of an engine in millimetres, y to the right and z up (C2); None for many cylinders."""
    engine = problem.engine
    parts = engine.slider_cranks
    if not parts or len(parts) > _MAX_PARTS:
        return None
    return {
        "steps": _steps(engine.cycle.angle),
        "cycle": math.degrees(engine.cycle.angle),
        "bore": 1e3 * bore_of(engine),
        "disc": 1.5e9 / (STEEL * THICKNESS),
        "parts": [_part(part, engine.cycle.angle) for part in parts],
        "rotors": [_rotor(problem, rotor) for rotor in engine.rotors if rotor.role is not Role.THROW],
        "mounts": [{"name": m.name, "at": [_mm(m.position[1]), _mm(m.position[2])]} for m in engine.mounts],
    }


def _steps(cycle: float) -> int:
    return round(STEPS * cycle / math.tau)


@lru_cache(maxsize=4 * _MAX_PARTS)
def _part(part: SliderCrank, cycle: float) -> dict[str, Any]:
    poses = [Pose.at_angle(part, k * cycle / _steps(cycle)) for k in range(_steps(cycle))]
    return {
        "name": part.name,
        "x": _mm(part.x),
        "bank": math.degrees(part.bank),
        "fires": math.degrees(part.firing_angle),
        "crank": _place(poses[0].crank),
        "pins": [_place(pose.pin) for pose in poses],
        "feet": [_place(pose.foot) for pose in poses],
        "pistons": [_place(pose.piston) for pose in poses],
        "bodies": [
            {"moves": body.moves, "shapes": [[_place(z) for z in pose.bodies[k].points] for pose in poses]}
            for k, body in enumerate(poses[0].bodies)
        ],
    }


def _rotor(problem: Problem, rotor: Rotor) -> dict[str, Any]:
    """Return a counterweight for the page: its unbalance without decisions [kg m], and the gain of each (C4)."""
    constant, drives = complex(rotor.unbalance), list[dict[str, Any]]()
    for decision in problem.decisions:
        for drive in decision.rotor_drives:
            if drive.rotor == rotor.name:
                constant -= complex(drive.of(decision.start))
                gains = [complex(drive.of(direction)) for direction in decision.set.directions]
                angle = decision.angle_name if decision.set.width > 1 else None
                drives.append({"name": decision.name, "angle": angle, "gains": [[g.real, g.imag] for g in gains]})
    return {
        "name": rotor.name,
        "x": _mm(rotor.x),
        "at": [_mm(rotor.shaft.y), _mm(rotor.shaft.z)],
        "ratio": float(rotor.shaft.ratio),
        "unbalance": [constant.real, constant.imag],
        "by": drives,
    }


def _place(zeta: complex) -> list[float]:
    return [_mm(zeta.imag), _mm(zeta.real)]


def _mm(value: float) -> float:
    return round(1e3 * float(value), 2)
