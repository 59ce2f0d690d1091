"""Functions of replication files, by name: of arrays, and a few of engines."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.extension import object_at
from laufruhe.machine.layouts import stations
from laufruhe.physics.elastic_mounts import single_transmissibility
from laufruhe.physics.modes import GRAVITY, sag_for_critical_speed, sag_frequency
from laufruhe.studies.text import NEGLIGIBLE, NOTICEABLE

if TYPE_CHECKING:
    import xarray as xr


def _reduced(how: str) -> Callable[..., Any]:
    def reduce(values: Any, *dims: str) -> Any:
        if not hasattr(values, "dims"):
            return getattr(np, how)(np.asarray(values, dtype=float)).item()
        result = getattr(values, how)(list(dims) or None)
        return result if result.dims else result.item()

    return reduce


def at(values: xr.DataArray, **places: Any) -> Any:
    """Return values at coordinates: the nearest to a number, several for a list."""
    for dim, place in places.items():
        exact = isinstance(place, str | list)
        values = values.sel({dim: place}) if exact else values.sel({dim: float(place)}, method="nearest")
    return values if values.dims else values.item()


def _arg(how: str) -> Callable[..., Any]:
    def position(values: Any, dim: str | None = None) -> Any:
        answer = getattr(values, f"idx{how}")(dim or values.dims[0])
        return answer if answer.dims else answer.item()

    return position


def orders(values: xr.DataArray) -> Any:
    """Return the amplitude of every order of a signal over the crank angle [deg]."""
    import xarray as xr

    angle = values["angle"].values
    amplitudes = np.abs(np.fft.rfft(values.values, axis=values.dims.index("angle"))) * 2.0 / len(angle)
    turns = (angle[1] - angle[0]) * len(angle) / 360.0
    at_orders = {"order": np.arange(amplitudes.shape[values.dims.index("angle")]) / turns}
    dims = ["order" if dim == "angle" else dim for dim in values.dims]
    return xr.DataArray(amplitudes, {**at_orders, **{d: values[d] for d in dims if d in values.coords}}, dims)


def couple_star(throws: Sequence[float], order: float = 1.0) -> complex:
    """Return the sum of x_k e^{i h theta_k} of throws [deg], x in cylinder spacings about the middle."""
    turns = [cmath.exp(1j * order * math.radians(throw)) for throw in throws]
    return sum((x * turn for x, turn in zip(stations(len(throws), 1.0), turns, strict=True)), 0j)


def join(*parts: Any) -> NDArray[np.float64]:
    """Return all numbers as one list."""
    return np.concatenate([np.ravel(np.asarray(part, dtype=float)) for part in parts])


def excursion(torques: Any, angle: float) -> float:
    """Return the range of the work of a torque about its mean; each value holds over a step of `angle` [rad] (T2)."""
    steps = np.ravel(np.asarray(torques, dtype=float))
    if not steps.size:
        raise ValueError("excursion() computes the range of work of a list of torques, and this list is empty")
    work = np.cumsum(steps - steps.mean()) * angle
    return float(np.ptp(np.append(work, 0.0)))


def lever_share(bearings: Sequence[float], place: float, number: int) -> float:
    """Return the share of a load that a bearing carries, the shaft cut in its bearings (B4)."""
    if len(set(bearings)) < len(bearings):
        raise ValueError("two bearings of the shaft have the same position")
    shares = object_at("laufruhe.extensions.bearing_loads.physics:lever_shares")(bearings, [place])
    return float(shares[number - 1, 0])


def transmissibility(ratio: Any, loss_factor: Any) -> Any:
    """Return foundation over exciting force of one mass on one spring (E11), also for labelled arrays."""
    import xarray as xr

    # without damping the ratio is infinite at the critical speed
    with np.errstate(divide="ignore"):
        return xr.apply_ufunc(single_transmissibility, ratio, loss_factor)


FUNCTIONS: Mapping[str, Any] = {
    **{name: _reduced(name) for name in ("min", "max", "mean", "sum", "all", "any")},
    **{name: getattr(np, name) for name in ("sqrt", "log", "exp", "sin", "cos", "minimum", "maximum", "round", "diff")},
    "abs": abs, "len": len, "at": at, "argmin": _arg("min"), "argmax": _arg("max"), "orders": orders,
    "join": join, "rising": lambda values: bool(np.all(np.diff(np.asarray(values)) > 0.0)),
    "degrees": lambda z: math.degrees(cmath.phase(z)), "conjugate": lambda z: z.conjugate(),
    "couple_star": couple_star, "excursion": excursion, "lever_share": lever_share,
    "transmissibility": transmissibility,
    "sag_for_critical_speed": sag_for_critical_speed, "sag_frequency": sag_frequency,
}  # fmt: skip
"""Every function that an expression may call."""
CONSTANTS: Mapping[str, float] = {
    "pi": math.pi, "tau": math.tau, "g": GRAVITY, "negligible": NEGLIGIBLE, "noticeable": NOTICEABLE,
}  # fmt: skip
