"""Motion felt at points of an engine, or of a frame under it: twelve equations of motion, weighted by formulas."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from attack.plain_loads import number
from attack.plain_mounts import Elastic, arm

QUANTITIES = {"receiver acceleration": ("m/s^2", 2), "receiver velocity": ("m/s", 1)}
# corners of high and low pass, transition and its quality, and step of ISO 8041 [Hz]
FILTERS = {
    "Wk": (0.4, 100.0, 12.5, 12.5, 0.63, (2.37, 0.91, 3.35, 0.91)), "Wd": (0.4, 100.0, 2.0, 2.0, 0.63, None),
    "Wh": (10**0.8, 10**3.1, 50.0 / math.pi, 50.0 / math.pi, 0.64, None),
}  # fmt: skip


def weight(name: str, f: np.ndarray) -> np.ndarray:
    """Return the factor of a weighting at frequencies above zero."""
    if name == "none":
        return np.ones(len(f), complex)
    f1, f2, f3, f4, q4, step = FILTERS[name]
    out = f**2 / (f**2 - 1j * math.sqrt(2.0) * f1 * f - f1**2)
    out = out * f2**2 / (f2**2 + 1j * math.sqrt(2.0) * f2 * f - f**2)
    out = out * (1.0 + 1j * f / f3) / (1.0 + 1j * f / (q4 * f4) - (f / f4) ** 2)
    if step:
        f5, q5, f6, q6 = step
        out = out * (f5**2 + 1j * f * f5 / q5 - f**2) / (f6**2 + 1j * f * f6 / q6 - f**2)
    return out


def on_frame(block: Elastic, mounts: dict[str, Any], frame: dict[str, Any], w: np.ndarray, load: np.ndarray) -> Any:
    """Return the motion of engine and frame about their centres, and the frame's centre."""
    centre = np.array([number(v) for v in frame.get("centre_of_gravity", [0, 0, 0])])
    mass = np.zeros((12, 12))
    mass[:6, :6], mass[6:9, 6:9] = block.mass, number(frame["mass"]) * np.eye(3)
    xx, yy, zz = (number(v) for v in frame["inertia"])
    xy, xz, yz = (number(v) for v in frame.get("inertia_products", [0, 0, 0]))
    mass[9:, 9:] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    still, moving = np.zeros((12, 12), complex), np.zeros((12, 12))
    places = [np.array([number(v) for v in place["position"]]) for place in mounts["places"]]
    parts = zip(block.maps, places, block.springs, block.losses, block.dampers, strict=True)
    for g, place, spring, loss, damper in parts:
        stretch = np.vstack([g, -arm(place - centre)])
        still += stretch @ (spring + 1j * loss) @ stretch.T
        moving += stretch @ damper @ stretch.T
    for one in frame.get("springs", []):
        b = np.vstack([np.zeros((6, 3)), arm(np.array([number(v) for v in one["position"]]) - centre)])
        stiff = np.diag([number(v) for v in one["stiffness"]]) * (1.0 + 1j * float(one.get("loss_factor", 0.0)))
        still += b @ stiff @ b.T
        moving += b @ np.diag([number(v) for v in one.get("damping", [0, 0, 0])]) @ b.T
    rate = w[:, None, None]
    drive = np.concatenate([load, np.zeros((len(w), 6))], axis=1)
    q = np.linalg.solve(still + 1j * rate * moving - rate**2 * mass, drive[:, :, None])[:, :, 0]
    return q[:, :6], q[:, 6:], centre


def responses(
    table: dict[str, Any], block: Elastic, channel: str, orders: np.ndarray, wrench: np.ndarray, speed: float
):
    """Return response coefficients (n, receivers, 3) in orders; a steady load moves nothing."""
    unit, derivative = QUANTITIES[channel]
    w, about = orders * speed, wrench.copy()
    about[:, 3:] -= np.cross(block.centre, wrench[:, :3])
    at = w > 0.0
    receivers = [one for one in table["receivers"] if one.get("unit", "m/s^2") == unit]
    out = np.zeros((len(w), len(receivers), 3), complex)
    if "frame" in table:
        engine, below, foot = on_frame(block, table["mounts"], table["frame"], w[at], about[at])
    else:
        engine, below, foot = block.motion(orders[at], wrench[at], speed), None, None
    for k, one in enumerate(receivers):
        point = np.array([number(v) for v in one["point"]])
        body, centre = (below, foot) if one.get("on") == "frame" else (engine, block.centre)
        weightings = one.get("weighting", "none")
        weightings = [weightings] * 3 if isinstance(weightings, str) else weightings
        moved = (1j * w[at, None]) ** derivative * (body @ arm(point - centre))
        out[at, k] = moved * np.stack([weight(name, w[at] / (2.0 * math.pi)) for name in weightings], axis=1)
        if "band" in one:
            low, high = (number(v) for v in one["band"])
            out[(w / (2.0 * math.pi) < low) | (w / (2.0 * math.pi) > high), k] = 0.0
    return out
