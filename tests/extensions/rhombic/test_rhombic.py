"""Rhombic drive: places of its masses from geometry, Meijer's condition of perfect balance, and the ready problem."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import laufruhe
import moving_masses as moving
import ready
from laufruhe.errors import InputError
from laufruhe.extensions.rhombic.mechanism import RhombicHalf
from laufruhe.machine import Cycle, Engine, OperatingPoint, Rotor, Shaft
from laufruhe.machine.rotor import CRANKSHAFT, GearedInertia, Role
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.prove.certificate import Proof
from problem_files import PROBLEMS

SPEED = 100.0
AT = OperatingPoint("run", SPEED)
PROBLEM = PROBLEMS / "rhombic-stirling.toml"


def halves(power: float, displacer: float, deficit: float = 0.0, radius: float = 0.024, rod: float = 0.08,
           offset: float = 0.045, turning: float = 0.3) -> tuple[RhombicHalf, RhombicHalf]:  # fmt: skip
    """Return the two cranks at both sides of the cylinder, with half of each mass."""
    second = Shaft("second crank", -1.0, 2.0 * offset, 0.0)
    first, other = (
        RhombicHalf(
            name=name, x=0.1, crank_radius=radius, rod_length=rod, reciprocating_mass=power, offset=side * offset,
            displacer_mass=displacer, rotating_mass=turning, rod_inertia_deficit=deficit, shaft=shaft,
        )
        for name, side, shaft in (("one", 1.0, CRANKSHAFT), ("two", -1.0, second))
    )  # fmt: skip
    return first, other


def places(part: RhombicHalf) -> list[moving.Mass]:
    """Return the masses of one crank; rods are rhombus sides, without inertia of their own."""
    centre, alpha = part.shaft.z + 1j * part.shaft.y, part.shaft.ratio * moving.angles()
    pin = part.crank_radius * np.exp(1j * alpha)
    height = np.sqrt(part.rod_length**2 - (pin.imag - part.offset) ** 2)
    masses = (part.reciprocating_mass, height), (part.displacer_mass, -height)
    yokes = [moving.Mass(mass, part.x, centre + pin.real + rise + 1j * part.offset) for mass, rise in masses]
    return [*yokes, moving.Mass(part.rotating_mass, part.x, centre + pin)]


@pytest.mark.parametrize("k", [0, 1])
def test_loads_of_one_crank_are_those_of_its_masses(k: int) -> None:
    part = halves(0.9, 0.7)[k]
    loads = shaking_loads(Engine("one", Cycle.TWO_STROKE, (part,)), AT).sample(moving.STEPS)
    expected = moving.wrench(places(part), SPEED)
    assert pytest.approx(expected, abs=1e-8 * np.abs(expected).max()) == loads[:, [1, 2, 3]].T


def test_rods_turn_against_each_other() -> None:
    """The reaction to the drive alone is left of the inertia of both rods: they swing in opposite directions."""
    part = halves(0.0, 0.0, 4e-4, turning=0.0)[0]
    loads = shaking_loads(Engine("one", Cycle.TWO_STROKE, (part,)), AT).sample(moving.STEPS)
    pin = part.crank_radius * np.exp(1j * moving.angles())
    lean = np.arcsin((pin.imag - part.offset) / part.rod_length)
    rate = moving.differentiated(lean.astype(complex), times=1).real
    energy = moving.differentiated((4e-4 * rate**2).astype(complex), times=1).real
    assert loads[:, 3] == pytest.approx(-(SPEED**2) * energy, abs=1e-8 * np.abs(loads[:, 3]).max())


@given(st.floats(0.2, 3.0), st.floats(0.01, 0.03), st.floats(0.002, 0.045), st.floats(-1e-3, 1e-3), st.floats(0.0, 1.0))
def test_equal_masses_and_weights_on_both_cranks_leave_no_load(
    mass: float, radius: float, offset: float, deficit: float, turning: float
) -> None:
    """Check Meijer 1959: equal masses of piston and displacer move their centre as the crank pins."""
    parts = halves(mass, mass, deficit, radius, 0.08, offset, turning)
    weights = tuple(
        Rotor(part.name, part.x, -(2.0 * mass + turning) * radius, part.shaft, Role.COUNTERWEIGHT) for part in parts
    )
    flywheels = GearedInertia("second", -1.0, 0.5)
    engine = Engine("rhombic", Cycle.TWO_STROKE, parts, rotors=weights, geared=(flywheels,))
    left = np.abs(shaking_loads(engine, AT).coefficients).max(axis=0)
    scale = mass * radius * SPEED**2
    assert left[:3] == pytest.approx(0.0, abs=1e-9 * scale)
    assert left[3:] == pytest.approx(0.0, abs=1e-9 * scale)


def test_other_masses_leave_the_higher_orders_of_a_slider_crank() -> None:
    """The difference of two masses moves as a piston, on both cranks alike (K4)."""
    parts = halves(0.9, 0.7)
    loads = shaking_loads(Engine("rhombic", Cycle.TWO_STROKE, parts), AT).coefficients
    single = halves(0.2, 0.0)[0]
    rest = shaking_loads(Engine("one", Cycle.TWO_STROKE, (single,)), AT).coefficients
    assert np.abs(loads[2:8, 2]) == pytest.approx(2.0 * np.abs(rest[2:8, 2]), rel=1e-9)
    assert np.abs(loads[:, 1]).max() < 1e-9 * np.abs(loads[:, 2]).max()


def file(**changes: Any) -> dict[str, Any]:
    tables = tomllib.loads(PROBLEM.read_text(encoding="utf-8"))
    tables["engine"] |= changes
    return tables


def test_the_ready_problem_finds_the_condition() -> None:
    result = ready.solved("rhombic-stirling")
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result["displacer mass"] == pytest.approx(0.9, rel=1e-6)
    radius = result.final.engine.slider_cranks[0].crank_radius
    for name in ("first", "second"):
        assert result[f"{name}.unbalance"] == pytest.approx((2 * 0.9 + 0.35) * radius, rel=1e-6)
    left, before = (np.abs(one.loads[0].wrench.coefficients).max() for one in (result.final, result.initial))
    assert left < 1e-6 * before


@pytest.mark.parametrize(("changes", "said"), [
    ({"displacer_mass": None}, "displacer_mass: is missing"),
    ({"rod": {"mass": "0.2 kg", "centre_of_gravity": "30 mm", "inertia": "0.0002 kg m^2"},
      "rod_inertia_deficit": "0 kg m^2"}, "rod.*stands for one of two rods"),
    ({"stroke": "200 mm"}, "stroke|rod_length|offset"),
])  # fmt: skip
def test_complaints(changes: dict[str, Any], said: str) -> None:
    tables = file(**changes)
    tables["engine"] = {key: value for key, value in tables["engine"].items() if value is not None}
    with pytest.raises(InputError, match=said):
        laufruhe.load(tables)


def test_a_radial_engine_needs_plain_rods() -> None:
    tables = tomllib.loads((PROBLEMS / "radial-seven.toml").read_text(encoding="utf-8"))
    tables["engine"] |= {"drive": "rhombic", "displacer_mass": "1 kg"}
    tables["engine"].pop("rod")
    with pytest.raises(InputError, match="drive: moves more than a piston"):
        laufruhe.load(tables)
