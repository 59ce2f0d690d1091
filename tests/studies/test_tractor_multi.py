"""Hasselgruber 1964, Figs. 12 to 28: several cylinders, with and without shafts."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from laufruhe.studies.tractor import balancing, four_cylinder, layouts
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.tractor.designs import fall, mean_of

Data = Callable[[str], xr.Dataset]
SIZED = ["fig-12", "fig-15", "fig-17", "fig-22", "fig-25", "fig-28"]


@pytest.mark.parametrize("name", SIZED)
def test_optima_are_proven(figure: Data, name: str) -> None:
    """Every decided design stands within 1e-4 of a bound that no design can pass."""
    data = figure(name)
    decided = data["lower_bound"].notnull()
    assert decided.any()
    gap = (data["mean_of_mounts"] - data["lower_bound"]).where(decided)
    assert float(gap.min()) >= -1e-9 * float(data["mean_of_mounts"].max())
    assert float((gap / data["mean_of_mounts"].max()).max()) <= 1e-4


class TestEqualCylinders:
    """Fig. 12."""

    @pytest.fixture
    def mean(self, figure: Data) -> xr.DataArray:
        return figure("fig-12")["mean_of_mounts"].sel(design="webs for half the couple")

    def test_six_are_best_when_short(self, mean: xr.DataArray) -> None:
        short = mean.sel(mounting=layouts.SHORT)
        assert int(short.idxmin("cylinders")) == 6
        assert float(short.sel(cylinders=6)) < 0.7 * float(short.drop_sel(cylinders=6).min())

    def test_six_are_best_when_long_too(self, mean: xr.DataArray) -> None:
        """As the study has it, three close behind."""
        long = mean.sel(mounting=layouts.LONG)
        assert int(long.idxmin("cylinders")) == 6
        assert float(long.sel(cylinders=6) / long.sel(cylinders=3)) == pytest.approx(0.927, abs=0.005)

    @pytest.mark.parametrize("cylinders", [1, 3, 4, 6])
    def test_study_engines_fire_evenly(self, cylinders: int) -> None:
        """All but two cylinders, which the study says fire 180 and 540 degrees apart."""
        intervals = [math.degrees(angle) for angle in study.inline_engine(cylinders).firing_intervals]
        assert intervals == pytest.approx([720.0 / cylinders] * cylinders)
        two = [math.degrees(angle) for angle in study.inline_engine(2).firing_intervals]
        assert two == pytest.approx([180.0, 540.0])

    def test_largest_force_of_six_is_least(self, figure: Data) -> None:
        usual = figure("fig-12").sel(design="webs for half the couple")
        assert (usual["maximum"].max("mount").idxmin("cylinders") == 6).all()

    def test_six_do_not_mind_the_mounting(self, mean: xr.DataArray) -> None:
        """A roll moment alone: exact."""
        short, long = (float(mean.sel(mounting=m, cylinders=6)) for m in layouts.MOUNTINGS)
        assert long == pytest.approx(short, rel=1e-6)

    def test_four_are_worst(self, mean: xr.DataArray) -> None:
        assert (mean.idxmax("cylinders") == 4).all()

    def test_long_mounting_loads_the_front_of_four_more(self, figure: Data) -> None:
        """The force acts in the middle: 8.5 / 11 of it in front instead of 1/2; roll moments are left as they were."""
        usual = figure("fig-12").sel(design="webs for half the couple", cylinders=4)
        front = usual["mean"].sel(mount=["front left", "front right"]).mean("mount")
        ratio = float(front.sel(mounting=layouts.LONG) / front.sel(mounting=layouts.SHORT))
        assert ratio == pytest.approx(2.0 * 8.5 / 11.0, rel=0.03)

    def test_three_do_well_when_long(self, mean: xr.DataArray) -> None:
        three = mean.sel(cylinders=3)
        assert float(three.sel(mounting=layouts.LONG)) < 0.7 * float(three.sel(mounting=layouts.SHORT))
        assert float(three.sel(mounting=layouts.LONG)) < 0.8 * float(
            mean.sel(mounting=layouts.LONG, cylinders=[2, 4]).min()
        )

    def test_two_load_the_front(self, figure: Data) -> None:
        row = figure("fig-12").sel(design="webs for half the couple", cylinders=2, mounting=layouts.LONG)["mean"]
        assert float(row[:2].min()) > 1.5 * float(row[2:].max())

    def test_optimal_webs_gain_little(self, figure: Data) -> None:
        """Half of the couple is what a crank can do in first order; higher orders and gas move the optimum by 2 %."""
        means = figure("fig-12")["mean_of_mounts"]
        usual, best = means.sel(design="webs for half the couple"), means.sel(design="webs at the optimum")
        assert (best <= usual * (1.0 + 1e-4)).all()
        assert (best >= 0.97 * usual).all()


def test_equal_power(figure: Data) -> None:
    """Fig. 13: three beat four, and two by more; eq. 23 holds for engines built anew."""
    data = figure("fig-13")
    mean = data["mean_of_mounts"]
    assert float(mean.sel(cylinders=3)) < 0.7 * float(mean.sel(cylinders=4)) < 0.7 * float(mean.sel(cylinders=2))
    np.testing.assert_allclose(mean, data["similar_mean"], rtol=1e-9)
    np.testing.assert_allclose(data["force_factor"], [2.0, 4.0 / 3.0, 1.0, 2.0 / 3.0])


def test_shaft_of_two_cylinders_is_negligible(figure: Data) -> None:
    """Fig. 15: 'vernachlaessigbar'. 7 % is a millimetre of a printed bar."""
    data = figure("fig-15")
    assert data.attrs["root"] == pytest.approx(1.0)
    assert 0.0 < fall(data, balancing.WEBS, balancing.SHAFT) < 0.07
    assert 0.0 < fall(data, balancing.BEST_WEBS, balancing.BEST) < 0.07


def test_shaft_of_three_cylinders_is_noticeable(figure: Data) -> None:
    """Fig. 17: 'merklich, wenn auch nicht sehr gross'. The optimum confirms eq. 25 to 1 %."""
    data = figure("fig-17")
    assert data.attrs["root"] == pytest.approx(3.0**0.5)
    assert 0.15 < fall(data, balancing.WEBS, balancing.SHAFT) < 0.5
    assert mean_of(data, balancing.SHAFT) == pytest.approx(mean_of(data, balancing.BEST), rel=0.01)


class TestFourCylinder:
    """Figs. 22 and 25."""

    def test_force_pair(self, figure: Data) -> None:
        """-70 %; rod ratio (0.22: -70, 0.26: -74) and load (9 kp/cm2: -69) are worth five points."""
        assert fall(figure("fig-22"), four_cylinder.BARE, four_cylinder.FORCE) == pytest.approx(0.70, abs=0.05)

    def test_moment_pair_at_part_load_does_not_reach_the_studys_53_percent(self, figure: Data) -> None:
        """Where ours disagrees: gas at 5.5 kp/cm2 takes 81 % of the inertia's second order: half a pair is too much."""
        data = figure("fig-22")
        assert 0.0 < fall(data, four_cylinder.FORCE, four_cylinder.BOTH) < 0.05
        assert float(data["swept_mean"].sel(load="5.5 kp/cm²").idxmin("share")) == pytest.approx(0.275, abs=0.05)

    def test_moment_pair_without_load_all_but_does(self, figure: Data) -> None:
        """-53 % and Phi = 50 % printed; five points each for a trace that is not printed, ten for a flat optimum."""
        idle = figure("fig-22")["swept_mean"].sel(load="no load")
        assert float(idle.idxmin("share")) == pytest.approx(0.5, abs=0.1)
        half = float(idle.sel(share=0.5, method="nearest") / idle.sel(share=0.0))
        assert 1.0 - half == pytest.approx(0.53, abs=0.08)

    def test_best_pairs(self, figure: Data) -> None:
        """The optimum is below every point of the sweep: angles and the force pair are free there too."""
        data = figure("fig-22")
        assert mean_of(data, four_cylinder.BEST_BOTH) < float(data["swept_mean"].sel(load="5.5 kp/cm²").min())
        assert mean_of(data, four_cylinder.BEST_BOTH) < mean_of(data, four_cylinder.BEST_FORCE)

    def test_front_pair(self, figure: Data) -> None:
        """Fig. 25: marked, but less than the pairs in the middle."""
        data = figure("fig-25")
        force = fall(data, four_cylinder.BARE, four_cylinder.FRONT)
        both = fall(data, four_cylinder.BARE, four_cylinder.FRONT_BOTH)
        assert 0.5 < force < 0.74
        assert 0.5 < both < fall(data, four_cylinder.BARE, "both pairs of Fig. 21")

    def test_front_share(self, figure: Data) -> None:
        """Eq. 29 prints 72 %; leverage about the rear mounts gives 1062.5 / 1312.5 in the plane assumed."""
        assert figure("fig-25").attrs["front_share"] == pytest.approx(1062.5 / 1312.5)


class TestTwoStrokeFour:
    """Fig. 28."""

    def test_best_crank(self, figure: Data) -> None:
        mean = figure("fig-28")["mean_of_mounts"]
        assert str(mean.sel(design=balancing.WEBS).idxmin("star").item()) == "Fig. 26"
        assert str(mean.sel(design=balancing.SHAFT).idxmin("star").item()) == "Fig. 27"

    def test_nothing_of_first_and_second_order_left(self, figure: Data) -> None:
        left = figure("fig-28")["inertia_left"].sel(design=balancing.SHAFT)
        assert float(left.sel(star="Fig. 27").max()) < 1e-12
        assert float(left.sel(star="Fig. 26", order=2)) > 1.0

    def test_closed_forms_are_optimal(self, figure: Data) -> None:
        """Eqs. 30 and 31 against the proven optimum: 0.1 %."""
        mean = figure("fig-28")["mean_of_mounts"]
        np.testing.assert_allclose(mean.sel(design=balancing.SHAFT), mean.sel(design=balancing.BEST), rtol=1e-3)
