"""Hasselgruber 1964, figure by figure: the study file is computed, judged and drawn."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.extensions.replication.conftest import PROBLEMS, parts_of

from laufruhe import load
from laufruhe.extensions.replication.judging import CONFIRMED, count_confirmed
from laufruhe.extensions.replication.part import Replication
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.plots.picture import draw

Data = Callable[[str], xr.Dataset]
Worth = Callable[..., Any]

# a figure takes seconds to compute, whichever test needs it first
pytestmark = pytest.mark.slow

FIGURES = list(parts_of("tractor-study"))
SIZED = ["fig-12", "fig-15", "fig-17", "fig-22", "fig-25", "fig-28"]

PRINTED, MEANT = "1.25 kg as printed", "2.25 kg"
# statements that are not confirmed with the printed mass, and with the other; docs/findings/tractor-study.md says why
NEVER = {"fig-25": ["Share of the force that frees the front mounts (eq. 29)"]}
NOT_CONFIRMED = {
    PRINTED: {
        "fig-02-05-07": ["Largest mount force of the reciprocating mass (Fig. 5)"],
        "fig-22": [
            "The moment pair at Φ = 50 % lowers what is left (Fig. 22)",
            "Best share of the moment pair at 10 m/s (Fig. 22)",
            "Torques of second order of gas and inertia cancel (text on the four-cylinder)",
        ],
        "free-force": [
            "Free force of second order of a four-cylinder vehicle diesel",
            "The same over the worst sum of tolerances, 100 kp",
        ],
        **NEVER,
    },
    MEANT: NEVER,
    "": {},
}
# ours, statement by statement, as first computed; figures that do not hang on the mass have one reading without a name
OURS = {
    PRINTED: {
        "fig-02-05-07": [263.318121310259, 339.0836729272133, 1.6121422343224967, 98.29904025086172],
        "fig-08-09": [0.0, 2.528597114157708],
        "fig-10": [47.113838898801234, 1.4457592509702382],
        "fig-12": [
            41.24200808887832, 105.18408636080929, 41.24200808887832, 0.0, 93.98026811405771, 51.98858505355983,
            44.47907467756473, -36.631378853918065, 2.3100063205936463,
        ],
        "fig-13": [0.6310413248815714, 0.5198580797574464, 2 / 3],
        "fig-15": [-4.793256240112576, -3.817539939834702],
        "fig-17": [-15.921266056892335, -15.181117612129269],
        "fig-22": [-74.22455023133854, -1.5237936232872062, 27.5, 8.952590779894562, -14.527680112311847],
        "fig-25": [-62.17875199464562, -62.081738933259686, 80.95238095238095],
        "fig-28": [0.8595107879027108, 0.9246624063125677, 0.0, 1.058155924817644],
        "fig-30": [0.0, 554.6608451821702, 169.98014929392903, 1 / 22],
        "free-force": [554.6608451821702, 5.546608451821702],
    },
    MEANT: {
        "fig-02-05-07": [263.318121310259, 610.3506112689839, 1.6121422343224967, 98.29904025086172],
        "fig-08-09": [0.0, 3.163526038966434],
        "fig-10": [49.3908108262555, 1.7179745379669975],
        "fig-12": [
            40.1785714288935, 82.71587280255737, 40.1785714288935, 0.0, 167.06735239085938, 51.227005739335006,
            56.899230739970704, -48.96783040324263, 2.7976644629008547,
        ],
        "fig-13": [0.454102129368739, 0.4037461522935525, 2 / 3],
        "fig-15": [-5.089795983063638, -3.930112921674256],
        "fig-17": [-31.30849684807442, -30.830632595862472],
        "fig-22": [-74.30738893003502, -49.78490051756616, 57.5, 6.682179028629071, -55.11513880598022],
        "fig-25": [-60.68359640735056, -70.08460627692732, 80.95238095238095],
        "fig-28": [0.7532647165314582, 0.8092242268072816, 0.0, 1.058155924817644],
        "fig-30": [0.0, 998.3895213279064, 305.9642687290723, 1 / 22],
        "free-force": [998.3895213279064, 9.983895213279064],
    },
    "": {
        "fig-29": [90.0, 0.0],
        "fig-31": [1.41],
        "fig-32": [5.589120293809492, 1.397280073452373, 800.0],
    },
}  # fmt: skip
JUDGED = [name for name in FIGURES if any(name in ours for ours in OURS.values())]


@pytest.mark.parametrize("name", JUDGED)
def test_statements(figure: Data, name: str) -> None:
    """Check all statements in every reading of the reciprocating mass."""
    data = figure(name)
    assert data["by_reading"].values.tolist() == [reading for reading, ours in OURS.items() if name in ours]
    for reading in data["by_reading"].values.tolist():
        own = data.sel(by_reading=reading)
        np.testing.assert_allclose(own["ours"], OURS[reading][name], rtol=2e-5, atol=1e-9)
        assert all(own["why"].values)
        held = own["verdict"].values != "not confirmed"
        assert own["statement"].values[~held].tolist() == NOT_CONFIRMED[reading].get(name, [])


def test_all_are_counted(figure: Data) -> None:
    assert [*JUDGED, "reciprocating-mass"] == FIGURES
    counts = f"{PRINTED}: 38 of 45 statements are confirmed. {MEANT}: 44 of 45 statements are confirmed."
    assert count_confirmed([figure(name) for name in FIGURES]) == counts


@pytest.mark.parametrize("name", FIGURES)
def test_a_dataset_that_was_read_again_knows_all_that_its_picture_says(figure: Data, name: str, tmp_path: Path) -> None:
    figure(name).to_netcdf(tmp_path / "f.nc")
    with xr.open_dataset(tmp_path / "f.nc") as again:
        np.testing.assert_equal(asdict(Replication.picture(again)), asdict(Replication.picture(figure(name))))


@pytest.mark.parametrize("name", SIZED)
def test_optima_are_proven(figure: Data, name: str) -> None:
    """Check that every decided design is within 1e-4 of its bound."""
    data = figure(name)
    decided = data["bound"].notnull()
    assert decided.any()
    gap = (data["mean"] - data["bound"]).where(decided)
    assert float(gap.min()) >= -1e-9 * float(data["mean"].max())
    assert float((gap / data["mean"].max()).max()) <= 1e-4


class TestSingle:
    """Figs. 2 to 10."""

    def test_gas_loads_both_mounts_alike_and_opposed(self, worth: Worth) -> None:
        """Check eq. 1: a moment and no force."""
        force = worth("fig-02-05-07", "at(force['gas'], direction='vertical')")
        np.testing.assert_allclose(
            force.sel(mount="left"), -force.sel(mount="right"), atol=1e-9 * float(abs(force).max())
        )

    def test_reciprocating_force_of_fig_5(self, worth: Worth) -> None:
        """Check the force of half of m r w^2 (1 + lambda) at dead centre, eq. 7.

        "doppelt so gross" as the 300 kp of Fig. 2: 2.25 kg make it, 1.25 kg do not.
        """
        half = worth("fig-02-05-07", "piston * (1 + lam) / 2 / kp")
        first = worth(
            "fig-02-05-07", "at(force['reciprocating mass'], angle=0, mount='left', direction='vertical') / kp"
        )
        assert first == pytest.approx(half, rel=1e-12)
        assert half < worth("fig-02-05-07", "mass") < 1.05 * half
        assert worth("fig-02-05-07", "mass", reading=MEANT) == pytest.approx(2.0 * 300.0, rel=0.02)
        assert worth("fig-02-05-07", "mass") == pytest.approx(1.13 * 300.0, rel=0.02)

    def test_rod_inertia_of_fig_7(self, worth: Worth) -> None:
        """Check dTheta lambda w^2 / b to a few percent, the effect of cos psi in the denominator."""
        assert worth("fig-02-05-07", "rod / (abs(deficit) * lam * w**2 / b / kp)") == pytest.approx(1.0, rel=0.08)

    def test_polar_diagrams(self, worth: Worth) -> None:
        """Check figs. 8, 9: vertical without balance, more across than up with full balance."""
        across = worth("fig-08-09", "lateral").values
        assert across[0] == 0.0
        assert across[0] < across[1] < 1.0 < across[2]

    def test_optima_of_fig_10_are_proven_and_below_the_sweep(self, worth: Worth) -> None:
        best, bound = (worth("fig-10", f"{name}['best']") for name in ("mean", "bound"))
        given = worth("fig-10", "mean['given']")
        assert (best <= given.min("kappa") * (1.0 + 1e-9)).all()
        assert (best - bound <= 1e-4 * best).all()
        assert (best >= bound).all()
        assert float(given.sel(cm=10.0, kappa=0.5)) < 1.005 * float(best.sel(cm=10.0))
        assert (np.diff(given.values, axis=0) > 0.0).all()


class TestSeveralCylinders:
    """Figs. 12 to 17."""

    def test_six_are_best(self, worth: Worth) -> None:
        def mean(z: int, mounting: str) -> float:
            return float(worth("fig-12", f"mean['{z} {mounting}']"))

        assert mean(6, "short") < 0.7 * min(mean(z, "short") for z in (2, 3, 4))
        assert mean(6, "long") / mean(3, "long") == pytest.approx(0.927, abs=0.005)
        assert mean(6, "long") == pytest.approx(mean(6, "short"), rel=1e-6)
        assert mean(3, "long") < 0.7 * mean(3, "short")
        assert mean(3, "long") < 0.8 * min(mean(2, "long"), mean(4, "long"))

    @pytest.mark.parametrize("mounting", ["short", "long"])
    def test_largest_force_of_six_is_least_and_of_four_worst(self, worth: Worth, mounting: str) -> None:
        maximum = {z: float(worth("fig-12", f"max(most['{z} {mounting}'])")) for z in (2, 3, 4, 6)}
        mean = {z: float(worth("fig-12", f"mean['{z} {mounting}']")) for z in (2, 3, 4, 6)}
        assert min(maximum, key=maximum.__getitem__) == 6
        assert max(mean, key=mean.__getitem__) == 4

    def test_long_mounting_loads_the_front_of_four_more(self, worth: Worth) -> None:
        """The force acts in the middle: 8.5 / 11 of it in front instead of 1/2; roll moments are left as they were."""
        assert worth("fig-12", "front_long / front_short") == pytest.approx(2.0 * 8.5 / 11.0, rel=0.03)

    def test_two_load_the_front(self, worth: Worth) -> None:
        row = worth("fig-12", "each['2 long']").values
        assert row[:2].min() > 1.5 * row[2:].max()

    @pytest.mark.parametrize("z", [2, 3, 4, 6])
    def test_optimal_webs_gain_little(self, worth: Worth, z: int) -> None:
        """Check that a crank takes half of the couple of order 1, and that other loads move the optimum by 2 %."""
        for mounting in ("short", "long"):
            ratio = worth("fig-12", f"mean['{z} {mounting}, best'] / mean['{z} {mounting}']")
            assert 0.97 <= ratio <= 1.0 + 1e-4

    def test_equal_power(self, worth: Worth) -> None:
        """Check fig. 13: three beat four, and two by more; eq. 23 holds for rebuilt engines."""
        two, three, four, _ = worth("fig-13", "built")
        assert three < 0.7 * four < 0.7 * two
        np.testing.assert_allclose(worth("fig-13", "built"), worth("fig-13", "converted"), rtol=1e-9)

    @pytest.mark.parametrize(("name", "throws", "root", "low", "high"), [
        ("fig-15", "[0, 180]", 1.0, 0.0, 0.07), ("fig-17", "[0, 240, 120]", 3.0**0.5, 0.15, 0.5),
    ])  # fmt: skip
    def test_first_order_shafts(
        self, worth: Worth, name: str, throws: str, root: float, low: float, high: float
    ) -> None:
        """Check 'vernachlaessigbar', and 'merklich, wenn auch nicht sehr gross' (7 % is 1 mm of a printed bar)."""
        assert worth(name, f"abs(couple_star({throws}))") == pytest.approx(root)
        assert low < -worth(name, "change") < high
        assert low < -worth(name, "best") < high
        if name == "fig-17":
            assert worth(name, "mean['shaft'] / mean['shaft, best']") == pytest.approx(1.0, rel=0.01)


class TestFourCylinder:
    """Figs. 22 and 25."""

    def test_printed_mass_contradicts_fig_22(self, worth: Worth) -> None:
        """Gas at 5.5 kp/cm2 takes four fifths of the second order of 1.25 kg: half a pair is too much."""
        assert 0.0 < worth("fig-22", "1 - mean['both'] / mean['force']") < 0.05
        assert worth("fig-22", "share") == pytest.approx(0.275, abs=0.05)

    def test_2_25_kg_meet_fig_22(self, worth: Worth) -> None:
        """Check printed -70 % and -53 % within five points; about 50 % of Φ the curve is flat."""
        assert worth("fig-22", "1 - mean['force'] / mean['none']", reading=MEANT) == pytest.approx(0.70, abs=0.05)
        assert worth("fig-22", "1 - mean['both'] / mean['force']", reading=MEANT) == pytest.approx(0.53, abs=0.05)
        assert worth("fig-22", "at(part_load, phi=0.5) / min(part_load)", reading=MEANT) < 1.06

    def test_torques_cancel_where_the_roll_moment_is_least(self, worth: Worth) -> None:
        """Compare the speed from three amplitudes at 10 m/s with the exact model."""
        problem = load(PROBLEMS / "tractor-four-lanchester.toml")
        cranks = tuple(replace(part, reciprocating_mass=2.25) for part in problem.engine.slider_cranks)
        engine = replace(problem.engine, slider_cranks=cranks, rotors=())

        def roll(cm: float) -> float:
            point = replace(problem.points[0], speed=math.pi * cm / 0.12)
            return float(abs(shaking_loads(engine, point).at(2)[3]))

        result = worth("fig-22", "cancel", reading=MEANT)
        assert roll(result) < 0.1 * roll(10.0)
        assert roll(result) < min(roll(result - 0.2), roll(result + 0.2))

    def test_best_pairs(self, worth: Worth) -> None:
        """The optimum is below every point of the sweep: angles and the force pair are free there too."""
        best = worth("fig-22", "mean['both, best']")
        assert best < worth("fig-22", "min(mean['5.5 kp/cm²'])")
        assert best < worth("fig-22", "mean['force, best']")

    def test_front_pair(self, worth: Worth) -> None:
        """Fig. 25: marked, but less than the pairs in the middle; eq. 29 by leverage in the plane assumed."""
        assert 0.5 < worth("fig-25", "1 - mean['force'] / mean['none']") < 0.74
        assert 0.5 < worth("fig-25", "1 - mean['both'] / mean['none']") < -worth("fig-25", "middle")
        assert worth("fig-25", "-rear / (0.25 - rear)") == pytest.approx(1062.5 / 1312.5)


def test_two_stroke_four(worth: Worth) -> None:
    """Check fig. 28: the best crank, its rest, and eqs. 30 and 31 within 0.1 % of the proven optimum."""
    for figure in ("Fig. 26", "Fig. 27"):
        ratio = worth("fig-28", f"mean['{figure}, shaft'] / mean['{figure}, best']")
        assert ratio == pytest.approx(1.0, rel=1e-3)
    assert worth("fig-28", "at(couple['Fig. 26, shaft'], order=2) / (piston * a)") > 1.0


def test_vee_by_angle(worth: Worth) -> None:
    """Check fig. 29: |cos alpha| and 1; |cos alpha/2| and |cos 3 alpha/2| times amplitude for order 2."""
    force = worth("fig-29", "force")
    alpha = np.radians(force["bank"].values)
    np.testing.assert_allclose(force.sel(order=1, turns="with the crank"), 1.0, atol=1e-12)
    np.testing.assert_allclose(force.sel(order=1, turns="against the crank"), abs(np.cos(alpha)), atol=1e-12)
    second = force.sel(order=2)
    amplitude = float(second.sel(bank=0.0, turns="with the crank"))
    assert amplitude == pytest.approx(worth("fig-29", "lam"), rel=0.02)
    with_it, against = (second.sel(turns=t) / amplitude for t in ("with the crank", "against the crank"))
    np.testing.assert_allclose(with_it, abs(np.cos(alpha / 2)), atol=1e-12)
    np.testing.assert_allclose(against, abs(np.cos(1.5 * alpha)), atol=1e-12)


def test_boxer_against_inline(worth: Worth) -> None:
    """Check fig. 30: force in line, couple opposed, no order 1; four forces, two arms of one stagger."""
    assert max(worth("fig-30", f"at(force['{name}'], order=1)") for name in ("inline", "boxer")) == 0.0
    assert max(worth("fig-30", f"at(couple['{name}'], order=1)") for name in ("inline", "boxer")) < 1e-9
    assert worth("fig-30", "max(force['boxer'])") == 0.0
    assert worth("fig-30", "max(couple['inline'])") < 1e-9
    assert worth("fig-30", "moment / (second / 4 * 2 * a / 2)") == pytest.approx(1.0)


def test_isolation_from_root_two(worth: Worth) -> None:
    """Check fig. 31 for any damping."""
    np.testing.assert_allclose(worth("fig-31", "at_root_two"), 1.0, rtol=1e-12)


def test_free_force(worth: Worth) -> None:
    """Check 4 m r w^2 (lambda + lambda^3/4): "about 1000 kp" with 2.25 kg, little over half with 1.25 kg."""
    for reading, force in ((PRINTED, 555.0), (MEANT, 998.0)):
        result = worth("free-force", "force", reading=reading)
        closed = worth("free-force", "4 * piston * (lam + lam**3 / 4) / kp", reading=reading)
        assert result == pytest.approx(closed, rel=2e-3)
        assert result == pytest.approx(force, rel=1e-3)


def test_no_compression_ratio_saves_the_printed_mass(worth: Worth) -> None:
    """Check that no compression ratio from 16 to 21 (253 to 305 kp of gas force) fits the printed mass (Fig. 2)."""
    for name, low, high in (("cancel", 6.5, 7.5), ("rest", -58.0, -48.0), ("share", 40.0, 60.0)):
        values = worth("reciprocating-mass", f"{name}_by")
        printed, meant = values.sel(m=1.25), values.sel(m=2.25)
        assert not ((low <= printed) & (printed <= high)).any()
        assert low <= float(meant.sel(eps=17.0)) <= high
        own = worth("reciprocating-mass", name).sel(m=[1.25, 2.25]).values
        assert own == pytest.approx([float(printed.sel(eps=17.0)), float(meant.sel(eps=17.0))], rel=1e-9)


def test_one_trace_meets_all_five_with_2_25_kg(worth: Worth) -> None:
    """Compression ratio 18, as docs/findings/tractor-study.md says; 1.25 kg meet the fall by the force pair alone."""
    allowed = {"twice": (1.7, 2.3), "cancel": (6.5, 7.5), "force": (-75, -65), "rest": (-58, -48), "share": (40, 60)}
    met = {
        mass: [low <= float(worth("reciprocating-mass", f"{name}_by").sel(m=mass, eps=18.0)) <= high
               for name, (low, high) in allowed.items()]
        for mass in (1.25, 2.25)
    }  # fmt: skip
    assert met == {1.25: [False, False, True, False, False], 2.25: [True] * 5}


def test_bars_carry_their_numbers(figure: Data) -> None:
    """Check four series of five groups: the mean inside, the largest above."""
    words = [text.get_text() for text in draw(Replication.picture(figure("fig-13"))).axes[0].texts]
    assert "59.3" in words
    assert figure("fig-13")["verdict"].values.tolist() == [[CONFIRMED] * 2] * 3
