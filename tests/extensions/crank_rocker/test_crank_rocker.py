"""Crank-rocker: places of its masses by intersections of circles, limits that are other mechanisms, files and gas."""

from __future__ import annotations

import cmath
import math
import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import laufruhe
import moving_masses as moving
import ready
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.crank_rocker.mechanism import CrankRocker
from laufruhe.extensions.flywheel.torque import torque_facts
from laufruhe.extensions.piston_motion.motion import piston_motion
from laufruhe.machine import Cycle, Engine, OperatingPoint, Shaft
from laufruhe.machine.kinematics import piston_acceleration, piston_velocity
from laufruhe.machine.rotor import CRANKSHAFT
from laufruhe.machine.scaling import scale_part
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque
from laufruhe.prove.certificate import Proof
from problem_files import PROBLEMS

SPEED = 9.0
PROBLEM = PROBLEMS / "beam-engine.toml"
AT = OperatingPoint("run", SPEED)
SHARED = {"layout", "cycle", "stroke", "reciprocating_mass", "throws", "cylinder_spacing", "single_cylinders"}


def rocker(
    side: int = 1, bank: float = 0.0, throw: float = 0.0, shaft: Shaft = CRANKSHAFT, **numbers: Any
) -> CrankRocker:
    """Return a linkage without symmetry."""
    linkage: dict[str, Any] = {
        "crank_radius": 0.11, "pivot": complex(-0.5, 0.42), "coupler_length": 0.55, "arm": 0.4, "side": side,
        "end": cmath.rect(0.35, 2.6 * side), "piston_rod_length": 0.6, "piston_offset": 0.7 if side > 0 else 0.3,
        "coupler_mass": 12.0, "coupler_share": 0.4, "coupler_inertia": 0.7, "rocker_mass": 30.0, "rocker_share": 0.2,
        "rocker_inertia": 2.1, "piston_rod_mass": 7.0, "piston_rod_share": 0.55, "piston_rod_inertia": 0.3,
    }  # fmt: skip
    part = CrankRocker(
        name="cylinder 1", x=0.2, rod_length=math.inf, reciprocating_mass=25.0, rotating_mass=6.0, throw=throw,
        bank=bank, shaft=shaft, **linkage | numbers,
    )  # fmt: skip
    return replace(part, firing_angle=((bank - throw + part.fires_at) / shaft.ratio) % math.tau)


def circles(first: np.ndarray, radius: float, other: Any, reach: float, side: int) -> np.ndarray:
    """Return the point at these distances from two centres, to the left (1) or right (-1) of the line between them."""
    line = other - first
    distance = np.abs(line)
    angle = np.arccos((radius**2 + distance**2 - reach**2) / (2.0 * radius * distance))
    return first + radius * line / distance * np.exp(1j * side * angle)


def masses(part: CrankRocker) -> list[moving.Mass]:
    """Derive all masses from geometry alone."""
    alpha = part.shaft.ratio * moving.angles() + part.throw - part.bank
    crank = part.crank_radius * np.exp(1j * alpha)
    pin = circles(crank, part.coupler_length, part.pivot, part.arm, part.side)
    end = part.pivot + part.end * (pin - part.pivot) / part.arm
    piston = end.real + np.sqrt(part.piston_rod_length**2 - (end.imag - part.piston_offset) ** 2)
    piston = piston + 1j * part.piston_offset
    centre, axis = part.shaft.z + 1j * part.shaft.y, np.exp(1j * part.bank)

    def body(link: str, first: Any, last: Any) -> list[moving.Mass]:
        mass, share, inertia = (getattr(part, f"{link}_{key}") for key in ("mass", "share", "inertia"))
        line = axis * (last - first)
        return moving.rigid(mass, inertia, part.x, centre + axis * first + share * line, line)

    return [
        moving.Mass(part.reciprocating_mass, part.x, centre + axis * piston),
        moving.Mass(part.rotating_mass, part.x, centre + axis * crank),
        *body("coupler", crank, pin), *body("rocker", part.pivot + 0.0 * end, end), *body("piston_rod", end, piston),
    ]  # fmt: skip


@pytest.mark.parametrize(
    "part",
    [
        rocker(), rocker(-1, bank=-0.5 * math.pi, throw=1.0),
        rocker(bank=0.3, throw=-2.0, shaft=Shaft("back", -1.0, 0.1, -0.2)),
    ],
    ids=["left", "right", "geared"],
)  # fmt: skip
def test_loads_are_those_of_its_masses(part: CrankRocker) -> None:
    loads = shaking_loads(Engine("one", Cycle.TWO_STROKE, (part,)), AT).sample(moving.STEPS)
    expected = moving.wrench(masses(part), SPEED)
    size = np.abs(expected).max()
    assert pytest.approx(expected, abs=1e-9 * size) == loads[:, [1, 2, 3]].T
    assert pytest.approx(part.x * np.array([-expected[1], expected[0]]), abs=1e-9 * size) == loads[:, 4:].T


def test_torque_is_what_the_energy_loses() -> None:
    part = rocker()
    torque = crank_torque(Engine("one", Cycle.TWO_STROKE, (part,)), AT).sample(moving.STEPS)
    loss = -(SPEED**2) * moving.differentiated(moving.energy(masses(part)).astype(complex), times=1).real
    assert torque == pytest.approx(loss, abs=1e-9 * np.abs(torque).max())


def test_a_long_rocker_guides_its_pin_as_a_crosshead() -> None:
    """A rocker of 10 km leads the coupler's pin along a line, as a crosshead (K5, K6)."""
    far = 1e4
    part = rocker(-1, pivot=complex(0.5, far), coupler_length=0.5, arm=far, end=complex(far), piston_rod_length=3e5,
                  piston_offset=0.0)  # fmt: skip
    alpha = np.linspace(0.0, math.tau, 50)
    (rock, rate, swing), _ = part.links(np, alpha)
    velocity = 1j * rate * far * rock
    acceleration = (1j * swing - rate * rate) * far * rock
    assert velocity.real == pytest.approx(0.11 * piston_velocity(np, alpha, 0.22), abs=1e-5)
    assert acceleration.real == pytest.approx(0.11 * piston_acceleration(np, alpha, 0.22), abs=1e-5)


@pytest.mark.parametrize("side", [1, -1])
def test_dead_centres_are_the_extremes(side: int) -> None:
    part = rocker(side)
    alpha = math.tau * np.arange(72000) / 72000
    travel = part.travel(np, alpha)
    top, bottom = part.dead_centres
    assert math.remainder(alpha[np.argmin(travel)] - top, math.tau) == pytest.approx(0.0, abs=2e-4)
    assert math.remainder(alpha[np.argmax(travel)] - bottom, math.tau) == pytest.approx(0.0, abs=2e-4)
    assert part.stroke == pytest.approx(np.ptp(travel), rel=1e-7)
    # out and back take unequal times, 180 degrees and more or less the angle between both lines of crank and coupler
    assert abs(bottom - top - math.pi) > 0.01


@pytest.mark.parametrize("alpha", [0.3, 2.0, 4.4])
def test_derivatives(alpha: float) -> None:
    part, step = rocker(), 1e-5
    near = np.array([alpha - step, alpha, alpha + step])

    def slope(values: np.ndarray) -> float:
        return float(np.real(values[2] - values[0]) / (2 * step))

    motion = part.motion(np, near)
    for _, (place, velocity, acceleration) in motion.points:
        assert velocity[1].real == pytest.approx(slope(place), abs=1e-8)
        assert acceleration[1].real == pytest.approx(slope(velocity), abs=1e-8)
    for _, (rate, swing) in motion.swings:
        assert swing[1] == pytest.approx(slope(rate), abs=1e-8)


def test_scaled_and_without_mass() -> None:
    part = rocker()
    one, other = (
        shaking_loads(Engine("one", Cycle.TWO_STROKE, (p,)), AT).sample(64) for p in (part, scale_part(part, 2.0, 3.0))
    )
    assert other[:, 1:3] == pytest.approx(6.0 * one[:, 1:3], rel=1e-9, abs=1e-6)
    assert other[:, 3:] == pytest.approx(12.0 * one[:, 3:], rel=1e-9, abs=1e-6)
    assert not shaking_loads(Engine("one", Cycle.TWO_STROKE, (part.only({}),)), AT).coefficients.any()


def test_a_locked_linkage_is_refused() -> None:
    with pytest.raises(ModelError, match="the crank does not turn"):
        rocker(crank_radius=0.3)
    with pytest.raises(ModelError, match="does not follow the rocker"):
        rocker(piston_rod_length=0.05)


def file(**changes: Any) -> dict[str, Any]:
    tables = tomllib.loads(PROBLEM.read_text(encoding="utf-8"))
    tables["engine"] |= changes
    return tables


def test_the_ready_problem_has_its_stroke_and_a_proof() -> None:
    result = ready.solved("beam-engine")
    (part,) = result.final.engine.slider_cranks
    assert part.stroke == pytest.approx(0.6, rel=1e-9)
    assert piston_motion(part, math.tau).mean_speed == pytest.approx(1.2, rel=1e-9)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    # two weights that turn both ways leave none of the first order of a force
    balanced = result.final.loads[0].wrench.at(1.0)[1:3]
    before = result.initial.loads[0].wrench.at(1.0)[1:3]
    assert np.abs(balanced).max() < 1e-6 * np.abs(before).max()
    assert not laufruhe.evaluate(file()).designs["initial"].engine.slider_cranks[0].is_balanced_by_share


@pytest.mark.parametrize(("changes", "said"), [
    ({"coupler_length": "500 mm"}, "coupler_length.*lets no crank turn"),
    ({"stroke": "3 m"}, "stroke.*is more than this linkage makes"),
    ({"piston_rod_length": "1 mm"}, "does not follow the rocker"),
    ({"rocker_side": 2}, "rocker_side"),
    ({"rod_length": "1 m"}, "rod_length.*means nothing with drive 'crank-rocker'"),
    ({"drive": "scotch-yoke"}, "means nothing with drive 'scotch-yoke'"),
])  # fmt: skip
def test_complaints(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        laufruhe.load(file(**changes))


@pytest.mark.parametrize("drive", ["crank-rocker", "swinging-yoke"])
@pytest.mark.parametrize("key", ["rod_length", "rod_inertia_deficit", "offset"])
def test_no_cylinder_has_a_rod_of_its_own(drive: str, key: str) -> None:
    tables = file(layout="inline", throws=[0, 180], cylinder_spacing="1 m", single_cylinders=[{"cylinders": 2}])
    del tables["engine"]["slider_cranks"]
    if drive == "swinging-yoke":
        rest = {key: value for key, value in tables["engine"].items() if key in SHARED}
        tables["engine"] = {**rest, "drive": drive, "pivot_distance": "500 mm", "return_ratio": 1.5}
    assert len(laufruhe.load(tables).engine.slider_cranks) == 2
    tables["engine"]["single_cylinders"][0][key] = "1 kg m^2" if key == "rod_inertia_deficit" else "2 m"
    with pytest.raises(InputError, match=rf"single_cylinders.1..{key}: .* with drive '{drive}'"):
        laufruhe.load(tables)


def test_no_crank_of_a_free_list_has_a_rod_of_its_own() -> None:
    tables = file()
    tables["engine"]["slider_cranks"][0]["rod_inertia_deficit"] = "1 kg m^2"
    with pytest.raises(InputError, match=r"rod_inertia_deficit.*means nothing with drive"):
        laufruhe.load(tables)


def test_a_missing_length_is_named() -> None:
    tables = file()
    del tables["engine"]["rocker_arm"]
    with pytest.raises(InputError, match="rocker_arm: is missing"):
        laufruhe.load(tables)


def test_gas_in_line() -> None:
    """Cylinders in line fire at their true dead centres, and the mean torque is the work of the gas."""
    tables = file(layout="inline", cycle="four-stroke", bore="300 mm", firing_order=[1, 2, 3], cylinder_spacing="1 m")
    del tables["engine"]["slider_cranks"]
    tables |= {
        "gas": {"model": "seiliger", "peak_pressure": "60 bar", "imep": "5 bar"},
        "objective": {"minimise": "rms roll moment"},
    }
    tables.pop("counterweights")
    tables.pop("balancer_shafts")
    problem = laufruhe.load(tables)
    facts = torque_facts(problem.engine, problem.points[0])
    assert facts.mean * 2 * math.tau == pytest.approx(3 * math.pi / 4 * 0.3**2 * 0.6 * 5e5, rel=1e-6)
    firing = sorted(part.firing_angle for part in problem.engine.slider_cranks)
    assert np.diff(firing) == pytest.approx(2 * math.tau / 3)
