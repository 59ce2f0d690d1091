"""Machines of geared cranks of the textbook, chapters 3 and 4, against masses on their ways and printed statements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import moving_masses as mm
from laufruhe.errors import InputError
from laufruhe.files.reader import load
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.problem.evaluation import evaluate
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from one_cylinder import cylinder_pressure
from problem_files import PROBLEMS, changed, loaded
from ready import solved

TWIN = (PROBLEMS / "geared-twin.toml").read_text(encoding="utf-8")
RADIUS, ROD, PISTON, PIN, SPEED = 0.04, 0.04 / 0.2857, 0.6, 0.8, 100.0 * np.pi


def twin(factor: float) -> list[mm.Mass]:
    """Return the masses of Fig. 4.1 on their paths."""
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
        # the remaining force is of second order, and upright
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
        """Compare the torque with pressure times the rate of both volumes (eq. 20)."""
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
    """Compare one factor for every shaft with a weight for each, by factor and by unbalance."""
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


OPPOSED = (PROBLEMS / "opposed-pistons-lead.toml").read_text(encoding="utf-8")
O_RADIUS, O_ROD, O_PISTON, O_APART, O_SPEED = 0.05, 0.2, 2.0, 0.64, 2000.0 * np.pi / 30.0


def facing(lead: float, ratio: float = -1.0) -> tuple[mm.Complex, mm.Complex]:
    """Return the paths of the lower and the upper piston of a cylinder, the upper one with a lead [rad]."""
    lower = mm.piston(mm.crank_pin(O_RADIUS), O_ROD, 0.0)
    pin = mm.crank_pin(O_RADIUS, np.pi + ratio * lead, ratio, O_APART)
    return lower, mm.piston(pin, O_ROD, np.pi, O_APART)


def charge(volume: np.ndarray, steps: int) -> np.ndarray:
    """Return the pressure of the mixed cycle over a turn from the least volume, with its cut-off by halving [Pa]."""
    swept = volume.max() - volume.min()
    clearance = swept / 15.0
    whole = volume - volume.min() + clearance
    low, high = 1.0, 16.0
    closing = np.arange(steps) > np.argmax(volume)
    for _ in range(60):
        middle = 0.5 * (low + high)
        compressed = 101325.0 * (whole.max() / whole) ** GAS.compression_exponent
        burnt = 9e6 * np.minimum(1.0, middle * clearance / whole) ** GAS.expansion_exponent
        pressure = np.where(closing, compressed, burnt)
        work = np.sum(0.5 * (pressure + np.roll(pressure, -1)) * (np.roll(whole, -1) - whole))
        low, high = (middle, high) if work < 7e5 * swept else (low, middle)
    return pressure


GAS = load(PROBLEMS / "opposed-pistons-lead.toml").points[0].gas


class TestOpposedPistons:
    """Fig. 3.5: "complete balance since the two pistons have exactly the same acceleration ... at all times"."""

    @pytest.mark.parametrize("ratio", [1, -1])
    def test_no_force_remains_in_step(self, ratio: int, tmp_path: Path) -> None:
        text = changed(OPPOSED, "crank_lead = 12", f"crank_ratio = {ratio}")
        shaken = evaluate(loaded(tmp_path, text)).loads[0].wrench
        one = O_PISTON * O_RADIUS * O_SPEED**2
        assert float(order_amplitude(shaken.coefficients[:, :3]).max()) < 1e-12 * one

    @pytest.mark.parametrize("ratio", [1, -1])
    def test_with_a_lead_the_forces_are_those_of_the_masses(self, ratio: int, tmp_path: Path) -> None:
        text = changed(OPPOSED, "crank_lead = 12", f"crank_lead = 12\ncrank_ratio = {ratio}")
        wrench = evaluate(loaded(tmp_path, text)).loads[0].wrench.sample(mm.STEPS)
        paths = facing(np.radians(12.0), ratio)
        force = mm.force([mm.Mass(O_PISTON, 0.0, path) for path in paths], O_SPEED)
        one = O_PISTON * O_RADIUS * O_SPEED**2
        np.testing.assert_allclose(wrench[:, 2] + 1j * wrench[:, 1], force, atol=1e-6 * one)
        first = np.abs(np.fft.fft(force)[1]) * 2.0 / mm.STEPS
        assert first == pytest.approx(2.0 * np.sin(np.radians(6.0)) * one, rel=1e-9)

    @pytest.mark.parametrize(("ratio", "lead"), [(-1, 12.0), (1, 12.0), (-1, -20.0), (-1, 0.0)])
    def test_gas_works_in_one_chamber_of_both(self, ratio: int, lead: float, tmp_path: Path) -> None:
        """Torque of the gas is its pressure times the rate of the volume between the pistons."""
        lower, upper = facing(np.radians(lead), ratio)
        gap = mm.finer(upper - lower).real * np.pi * 0.04**2
        first = int(np.argmin(gap))
        turned = np.roll(gap, -first)
        pressure = np.roll(charge(turned, len(gap)), first)
        rate = mm.finer(mm.differentiated(upper - lower, times=1)).real * np.pi * 0.04**2
        expected = np.fft.rfft((pressure - 101325.0) * rate)[:13] / len(gap) * 2.0
        text = changed(OPPOSED, "crank_lead = 12", f"crank_lead = {lead}\ncrank_ratio = {ratio}")
        with_gas, without = (
            np.array([evaluate(loaded(tmp_path, one)).loads[0].wrench.at(h)[3] for h in range(13)])
            for one in (text, changed(text, 'speed = "2000 rpm"', 'speed = "2000 rpm"\ngas = false'))
        )
        expected[0] /= 2.0
        # a step of the volume's samples is what the angle of the least one may be off
        np.testing.assert_allclose(with_gas - without, expected, atol=1e-4 * np.abs(expected).max())
        assert (with_gas - without)[0].real == pytest.approx(7e5 * (gap.max() - gap.min()) / (2.0 * np.pi), rel=1e-4)

    def test_gas_gives_no_force(self, tmp_path: Path) -> None:
        texts = (OPPOSED, changed(OPPOSED, 'speed = "2000 rpm"', 'speed = "2000 rpm"\ngas = false'))
        forces = [evaluate(loaded(tmp_path, text)).loads[0].wrench.sample(64)[:, :3] for text in texts]
        np.testing.assert_allclose(forces[0], forces[1], atol=1e-9 * np.abs(forces[1]).max())

    @pytest.mark.slow
    def test_weights_on_both_cranks_take_off_what_the_lead_leaves(self) -> None:
        """2 sin(delta / 2) m r goes to and fro: half of it on each of two cranks that turn against each other."""
        result = solved("opposed-pistons-lead")
        assert result.certificate is not None
        assert result.certificate.kind is Proof.GLOBAL
        sizes = {d.name: d.value for d in result.decisions}
        expected = O_PISTON * O_RADIUS * np.sin(np.radians(6.0)) / 0.05
        assert [sizes["lower.mass"], sizes["upper.mass"]] == pytest.approx([expected] * 2, rel=1e-5)

    def test_the_second_mass_is_the_cosine_of_the_lead_times_the_first(self, tmp_path: Path) -> None:
        """Compare the second mass with cos(lead) in order 1, and with the mean of cos(h lead) over all orders."""
        text = (PROBLEMS / "opposed-pistons-masses.toml").read_text(encoding="utf-8")
        path = mm.piston(mm.crank_pin(O_RADIUS), O_ROD, 0.0)
        squares = np.abs(np.fft.fft(mm.differentiated(path))[: mm.STEPS // 2]) ** 2
        orders = np.arange(mm.STEPS // 2)
        for lead in (0.0, 12.0):
            own = changed(text, "crank_lead = 12", f"crank_lead = {lead}")
            whole = "".join(line for line in own.splitlines(keepends=True) if not line.startswith("orders"))
            first, every = (solve(loaded(tmp_path, one)).decisions[0].value for one in (own, whole))
            assert first == pytest.approx(O_PISTON * np.cos(np.radians(lead)), rel=1e-6)
            mean = squares @ np.cos(orders * np.radians(lead)) / squares.sum()
            assert every == pytest.approx(O_PISTON * mean, rel=1e-5)

    def test_masses_of_a_list_of_parts_are_open_one_by_one(self, tmp_path: Path) -> None:
        """Two pistons opposite each other, their axes in one line: the second is to be as heavy as the first."""
        text = (
            'title = "two"\n[engine]\nlayout = "parts"\ncycle = "two-stroke"\nstroke = "100 mm"\nrod_ratio = 0.25\n'
            'reciprocating_mass = "1 kg"\n[[engine.slider_cranks]]\nx = "0 mm"\nbank_angle = 90\nthrow = 90\n'
            '[[engine.slider_cranks]]\nx = "0 mm"\nbank_angle = -90\nthrow = -90\n'
            'reciprocating_mass = { between = ["0.5 kg", "2 kg"] }\n[[operating_points]]\nspeed = "1000 rpm"\n'
            '[objective]\nminimise = "rms shaking force"\n'
        )
        result = solve(loaded(tmp_path, text))
        assert [d.name for d in result.decisions] == ["reciprocating mass of cylinder 2"]
        assert result.decisions[0].value == pytest.approx(1.0, rel=1e-6)

    @pytest.mark.parametrize(
        ("old", "new", "said"),
        [
            (
                "crank_lead = 12",
                "crank_lead = 115",
                "is beyond the ports, which are open for 110 deg",
            ),
            ("crank_lead = 12\nport_arc = 110", "crank_lead = 95", "dead centres 95 deg apart; bring them within 90"),
            (
                '"640 mm"',
                '"480 mm"',
                "leaves no chamber between cylinder 1 upper and cylinder 1, because their pins meet",
            ),
            ("rod_ratio = 0.25", "rod_ratio = 1.25", "blocks the crank"),
        ],
    )
    def test_machines_that_cannot_be(self, old: str, new: str, said: str, tmp_path: Path) -> None:
        with pytest.raises(InputError) as caught:
            loaded(tmp_path, changed(OPPOSED, old, new))
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)

    def test_a_list_of_parts_shares_its_chamber_too(self, tmp_path: Path) -> None:
        """Compare an opposed-piston engine with the same engine as a list of parts."""
        head, tail = OPPOSED[: OPPOSED.index("throws =")], OPPOSED[OPPOSED.index("[[operating_points]]") :]
        parts = (
            '[[engine.shafts]]\nname = "second crankshaft"\nratio = -1\nposition = ["0 mm", "640 mm"]\n'
            '[[engine.slider_cranks]]\nx = "0 mm"\n'
            '[[engine.slider_cranks]]\nx = "0 mm"\nshaft = "second crankshaft"\nbank_angle = 180\nthrow = 168\n'
            "firing_angle = -12\n"
        )
        text = changed(head, '"opposed-piston"', '"parts"') + parts + tail
        moments = [evaluate(loaded(tmp_path, one)).loads[0].wrench.sample(180) for one in (OPPOSED, text)]
        np.testing.assert_allclose(moments[1], moments[0], atol=1e-9 * np.abs(moments[0]).max())
