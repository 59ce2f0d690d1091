"""Machines of geared cranks of the textbook, chapters 3 and 4, against masses on their ways and printed statements."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import moving_masses as mm
from laufruhe.errors import InputError
from laufruhe.files.reader import load
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.gas_cycle import cylinder_pressure
from laufruhe.problem.evaluation import evaluate
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.result import Result
from problem_files import PROBLEMS, changed, loaded


@cache
def solved(name: str) -> Result:
    return solve(load(PROBLEMS / f"{name}.toml"))


TWIN = (PROBLEMS / "geared-twin.toml").read_text(encoding="utf-8")
RADIUS, ROD, PISTON, PIN, SPEED = 0.04, 0.04 / 0.2857, 0.6, 0.8, 100.0 * np.pi


def twin(factor: float) -> list[mm.Mass]:
    """Fig. 4.1 as masses on their ways."""
    found = []
    for ratio, centre in ((1.0, 0.06j), (-1.0, -0.06j)):
        pin = mm.crank_pin(RADIUS, 0.0, ratio, centre)
        weight = mm.crank_pin(0.05, np.pi, ratio, centre)
        found += [
            mm.Mass(PISTON, 0.0, mm.piston(pin, ROD, 0.0, centre)),
            mm.Mass(PIN, 0.0, pin),
            mm.Mass((PIN + factor * PISTON) * RADIUS / 0.05, 0.0, weight),
        ]
    return found


class TestGearedTwin:
    """Fig. 4.1: two singles back to back, their cranks geared to turn against each other."""

    def test_no_primary_force_is_left(self) -> None:
        """ "There are no out-of-balance primary forces", with weights for the whole of each piston."""
        result = solved("geared-twin")
        assert result.certificate is not None
        assert result.certificate.kind is Proof.GLOBAL
        assert result.decisions[0].value == pytest.approx(1.0, abs=2e-4)
        one = PISTON * RADIUS * SPEED**2
        shaken = result.final.loads[0].wrench
        assert float(order_amplitude(shaken.at(1)[:3])) < 1e-3 * one
        # what is left is of second order, and acts upright
        assert float(order_amplitude(shaken.at(2)[:3])) == pytest.approx(2.0 * 0.2857 * one, rel=0.03)

    def test_forces_are_those_of_the_masses(self, tmp_path: Path) -> None:
        problem = loaded(tmp_path, changed(TWIN, "{ between = [0, 1.5] }", "0.7"))
        wrench = evaluate(problem).loads[0].wrench.sample(2 * mm.STEPS)[: mm.STEPS]
        force = mm.force(twin(0.7), SPEED)
        one = PISTON * RADIUS * SPEED**2
        np.testing.assert_allclose(wrench[:, 2] + 1j * wrench[:, 1], force, atol=1e-6 * one)

    def test_it_fires_evenly(self) -> None:
        assert solved("geared-twin").final.engine.firing_intervals == pytest.approx((2 * np.pi, 2 * np.pi))

    def test_gas_rolls_the_block_with_its_torque(self, tmp_path: Path) -> None:
        """Pressure times the rate of the volume of both cylinders is what the output gets (eq. 20)."""
        problem = loaded(tmp_path, TWIN)
        engine, point = problem.engine, problem.points[0]
        steps = 2 * mm.STEPS
        pressure = cylinder_pressure(point.gas, engine.slider_cranks[0], engine.cycle, steps) - 101325.0
        pin = mm.crank_pin(RADIUS)
        rate = -mm.differentiated(mm.piston(pin, ROD, 0.0), times=1).real
        torque = np.pi * 0.04**2 * pressure * np.tile(rate, 2)
        expected = torque + np.roll(torque, mm.STEPS)
        with_gas, without = (
            evaluate(loaded(tmp_path, text)).loads[0].wrench.sample(steps)[:, 3]
            for text in (TWIN, changed(TWIN, 'speed = "3000 rpm"', 'speed = "3000 rpm"\ngas = false'))
        )
        np.testing.assert_allclose(with_gas - without, expected, atol=1e-4 * np.abs(torque).max())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"every"', '"middle"', "counterweights[1].shaft"),
        ('"every"', '"right"\nthrows = [2]', "is no throw, the right has 1"),
        ('balance_factor = { between = [0, 1.5] }', 'opposite_throw = 1\nmass = "1 kg"', "counterweights[1].shaft"),
    ],
)  # fmt: skip
def test_refusals(old: str, new: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, changed(TWIN, old, new))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_each_shaft_has_its_own_weights(tmp_path: Path) -> None:
    """One factor for every shaft is two of one size; a single weight stands opposite the throw of its shaft."""
    each = "".join(
        f'[[counterweights]]\nname = "{name}"\nshaft = "{name}"\nbalance_factor = 0.5\nradius = "50 mm"\n'
        for name in ("left", "right")
    )
    single = each.replace("balance_factor = 0.5", 'opposite_throw = 1\nunbalance = "0.044 kg m"')
    head, tail = TWIN[: TWIN.index("[[counterweights]]")], TWIN[TWIN.index("[objective]") :]
    whole = changed(TWIN, "{ between = [0, 1.5] }", "0.5")
    loads = [
        evaluate(loaded(tmp_path, text)).loads[0].wrench.sample(64)
        for text in (whole, head + each + tail, head + single + tail)
    ]
    np.testing.assert_allclose(loads[1], loads[0], atol=1e-9 * np.abs(loads[0]).max())
    np.testing.assert_allclose(loads[2], loads[0], atol=1e-9 * np.abs(loads[0]).max())
