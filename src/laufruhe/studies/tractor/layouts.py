"""Two, three, four and six cylinders: equal cylinders (Fig. 12) and equal total power (Fig. 13)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from laufruhe.machine import Engine, OperatingPoint, Rotor
from laufruhe.machine.similarity import equal_power_scale
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.tractor import shafts
from laufruhe.studies.tractor.designs import ASSUMED, Design, bars, free_webs, given, opened, optimum
from laufruhe.studies.verdict import Verdict

CYLINDERS = (2, 3, 4, 6)
MOUNTINGS = {"short, k = 0": 0.0, "long, k = 6a": 6.0}
SHORT, LONG = MOUNTINGS
REFERENCE = 4


def equal_cylinders() -> xr.Dataset:
    """Mean and maximum mount forces with equal cylinders, short and long mounting (Fig. 12)."""
    return xr.concat(
        [xr.concat([_one(z, extra) for z in CYLINDERS], dim=_cylinders()) for extra in MOUNTINGS.values()],
        dim=xr.DataArray(list(MOUNTINGS), dims="mounting", name="mounting"),
    ).assign_attrs(title="Mount forces with equal cylinders", assumptions=ASSUMED)


def _one(cylinders: int, extra: float) -> xr.Dataset:
    point = study.running(study.gas(study.FULL_LOAD))
    how = study.Build(extra=extra)
    webs = free_webs(cylinders)
    return bars(
        [
            given("webs for half the couple", study.inline_engine(cylinders, crank_webs(cylinders), how), point),
            optimum("webs at the optimum", study.inline_engine(cylinders, webs, how), point, opened(webs)),
        ],
        "",
    )


def crank_webs(cylinders: int) -> tuple[Rotor, ...]:
    """What counterweights can do for a crank star: half of an oscillating couple, nothing where there is none."""
    throws = study.THROWS[cylinders]
    return shafts.crank_weights(throws) if abs(shafts.couple_star(throws)) > 1e-9 else ()


def _cylinders() -> xr.DataArray:
    return xr.DataArray(list(CYLINDERS), dims="cylinders", name="cylinders", attrs={"units": "1"})


def equal_cylinder_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 12, on the webs that are usual."""
    usual = data.sel(design="webs for half the couple")
    mean = usual["mean_of_mounts"] / study.KILOPOND
    most = usual["maximum"].max(dim="mount") / study.KILOPOND
    front = usual["mean"].sel(mount=["front left", "front right"]).mean(dim="mount") / study.KILOPOND
    short, long = ({z: float(mean.sel(mounting=m, cylinders=z)) for z in CYLINDERS} for m in MOUNTINGS)
    peaks = {z: float(most.sel(mounting=LONG, cylinders=z)) for z in CYLINDERS}
    fronts = [float(front.sel(mounting=m, cylinders=4)) for m in MOUNTINGS]
    return (
        *_six_verdicts(short, long, peaks),
        *_four_verdicts(short, long, fronts),
        Verdict(
            "Three cylinders come off well, long mounting (Fig. 12)",
            "relatively good",
            long[3],
            "kp, mean",
            long[3] < min(long[2], long[4]),
            "less than two and than four cylinders",
        ),
        Verdict(
            "Three cylinders: the long mounting lowers the forces (Fig. 12)",
            "lower",
            100.0 * (long[3] / short[3] - 1.0),
            "% change",
            long[3] < short[3],
            "couples act on a longer arm",
        ),
        Verdict(
            "Two cylinders, long mounting: second order loads the front mounts (Fig. 12)",
            "front mounts chiefly",
            _front_share(usual, 2),
            "front over rear, mean",
            _front_share(usual, 2) > 1.5,
            "half as much again counts as chiefly",
        ),
    )


def _six_verdicts(
    short: Mapping[int, float], long: Mapping[int, float], peaks: Mapping[int, float]
) -> tuple[Verdict, ...]:
    """Of six cylinders: mean forces on both mountings and the largest on the long one, by number of cylinders [kp]."""
    listed = "; ".join(f"{z}: {short[z]:.0f} and {long[z]:.0f}" for z in CYLINDERS)
    behind = min(long[z] for z in (2, 3, 4)) / long[6] - 1.0
    return (
        Verdict(
            "Six cylinders are best, short mounting (Fig. 12)",
            "best",
            short[6],
            "kp, mean",
            all(short[6] < short[z] for z in (2, 3, 4)),
            f"mean forces by number of cylinders, short and long: {listed} kp",
        ),
        Verdict(
            "Six cylinders are best, long mounting, largest force (Fig. 12)",
            "best",
            peaks[6],
            "kp, largest",
            all(peaks[6] < peaks[z] for z in (2, 3, 4)),
            f"three cylinders: {peaks[3]:.0f} kp",
        ),
        Verdict(
            "Six cylinders are best, long mounting, mean force (Fig. 12)",
            "best",
            long[6],
            "kp, mean",
            behind > 0.0,
            f"three cylinders have {long[3]:.1f} kp, {100.0 * behind:.1f} % more. On traces of compression ratios "
            "16 to 20.5 they stay behind by 6 to 8 %",
        ),
        Verdict(
            "Six cylinders: the length of the mounting does not matter (Fig. 12)",
            "the same",
            100.0 * (long[6] / short[6] - 1.0),
            "% change",
            abs(long[6] / short[6] - 1.0) < 1e-3,
            "a pure roll moment; 0.1 % is below what a bar shows",
        ),
    )


def _four_verdicts(
    short: Mapping[int, float], long: Mapping[int, float], fronts: Sequence[float]
) -> tuple[Verdict, ...]:
    """Of four cylinders: mean forces by number of cylinders, and on the front mounts, short and long [kp]."""
    return (
        Verdict(
            "Four cylinders come off badly (Fig. 12)",
            "relatively bad",
            long[4],
            "kp, mean",
            short[4] == max(short.values()) and long[4] == max(long.values()),
            "the worst of all, short and long",
        ),
        Verdict(
            "Four cylinders: the long mounting loads the front mounts more (Fig. 12)",
            "more",
            100.0 * (fronts[1] / fronts[0] - 1.0),
            "% on the front mounts",
            fronts[1] > fronts[0],
            f"from {fronts[0]:.0f} to {fronts[1]:.0f} kp; 77 % of the free force goes there instead of 50 %",
        ),
    )


def _front_share(usual: xr.Dataset, cylinders: int) -> float:
    row = usual["mean"].sel(mounting=LONG, cylinders=cylinders)
    front = row.sel(mount=["front left", "front right"]).sum()
    return float(front / row.sel(mount=["rear left", "rear right"]).sum())


def equal_power() -> xr.Dataset:
    """The same at equal total power, the four-cylinder for reference, long mounting (Fig. 13; eqs. 14-23)."""
    data = xr.concat([bars([_scaled(z)], "") for z in CYLINDERS], dim=_cylinders()).isel(design=0, drop=True)
    scales = [equal_power_scale(z, REFERENCE) for z in CYLINDERS]
    similar = [given("", *_reference(z)).mean * s.force for z, s in zip(CYLINDERS, scales, strict=True)]
    volume = 4 * np.pi / 4 * study.BORE**2 * study.STROKE
    speed = study.speed_of(study.PISTON_SPEED)
    return data.assign(
        displacement=(("cylinders",), [volume * s.displacement for s in scales], {"units": "m3"}),
        crank_speed=(("cylinders",), [speed * s.speed for s in scales], {"units": "rad/s"}),
        similar_mean=(("cylinders",), similar, {"units": "N", "long_name": "mean of Fig. 12 converted by eq. 23"}),
        force_factor=(("cylinders",), [s.force for s in scales], {"units": "1", "long_name": "eq. 23"}),
    ).assign_attrs(title="Mount forces at equal power", assumptions=ASSUMED)


def _reference(cylinders: int) -> tuple[Engine, OperatingPoint]:
    return study.inline_engine(cylinders, crank_webs(cylinders)), study.running(study.gas(study.FULL_LOAD))


def _scaled(cylinders: int) -> Design:
    scale = equal_power_scale(cylinders, REFERENCE)
    how = study.Build(length=scale.length, mass=scale.mass)
    webs = tuple(_scaled_rotor(rotor, scale.length, scale.mass) for rotor in crank_webs(cylinders))
    point = study.running(study.gas(study.FULL_LOAD), length=scale.length)
    return given("webs for half the couple", study.inline_engine(cylinders, webs, how), point)


def _scaled_rotor(rotor: Rotor, length: float, mass: float) -> Rotor:
    return Rotor(rotor.name, rotor.x * length, rotor.unbalance * mass * length, rotor.shaft, rotor.role, rotor.radius)


def equal_power_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 13."""
    mean = {z: float(data["mean_of_mounts"].sel(cylinders=z)) / study.KILOPOND for z in CYLINDERS}
    listed = ", ".join(f"{z}: {mean[z]:.0f}" for z in CYLINDERS)
    return (
        Verdict(
            "At equal power three cylinders shake less than four (Fig. 13)",
            "better",
            mean[3] / mean[4],
            "three over four, mean",
            mean[3] < mean[4],
            f"mean forces by number of cylinders: {listed} kp",
        ),
        Verdict(
            "At equal power three cylinders shake much less than two (Fig. 13)",
            "all the more",
            mean[3] / mean[2],
            "three over two, mean",
            mean[3] / mean[2] < mean[3] / mean[4],
            "a smaller ratio than against four",
        ),
        Verdict(
            "Forces of two and three rise against Fig. 12, those of six fall (Fig. 13)",
            "2, 4/3, 2/3",
            float(data["force_factor"].sel(cylinders=6)),
            "factor of six",
            bool(np.allclose(data["mean_of_mounts"], data["similar_mean"], rtol=1e-9)),
            "eq. 23 to 1e-9: engines built anew at their size and speed against the converted forces of Fig. 12",
        ),
    )
