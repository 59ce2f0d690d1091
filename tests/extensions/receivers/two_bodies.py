"""Engine on its mounts on a frame, by twelve equations of motion of its own, and random engines for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from laufruhe.extensions.receivers.channels import ACCELERATION
from laufruhe.extensions.receivers.machine import Frame, Receiver, Receivers
from laufruhe.machine import Block, Cycle, Engine, Mount, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.loads import PointLoads

SPEED = math.tau * 25.0


def skew(v: np.ndarray) -> np.ndarray:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def arm(place: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the motion of a point per translation and rotation of its body."""
    return np.hstack([np.eye(3), -skew(np.asarray(place) - np.asarray(centre))])


def stiffness(mount: Mount, w: float) -> np.ndarray:
    axes = np.array(mount.orientation)
    k = np.array(mount.stiffness) * (1.0 + 1j * mount.loss_factor) + 1j * w * np.array(mount.damping)
    return axes.T @ np.diag(k) @ axes


def mass(body: Block) -> np.ndarray:
    out = np.zeros((6, 6))
    out[:3, :3], out[3:, 3:] = body.mass * np.eye(3), np.array(body.inertia)
    return out


@dataclass
class Answer:
    engine: np.ndarray
    frame: np.ndarray
    forces: np.ndarray


def answer(engine: Engine, frame: Frame, load: np.ndarray, on_frame: np.ndarray, w: float) -> Answer:
    """Return the motion of both centres and mount forces under a load on the engine and forces at the frame's feet."""
    assert engine.block is not None
    centres = engine.block.centre_of_gravity, frame.body.centre_of_gravity
    z = np.zeros((12, 12), dtype=complex)
    z[:6, :6] -= w**2 * mass(engine.block)
    z[6:, 6:] -= w**2 * mass(frame.body)
    right = np.concatenate([load, np.zeros(6)]).astype(complex)
    for mount, force in zip(engine.mounts, on_frame, strict=True):
        g, b = (arm(mount.position, centre) for centre in centres)
        stretch = np.hstack([g, -b])
        z += stretch.T @ stiffness(mount, w) @ stretch
        right[6:] += b.T @ force
    for spring in frame.springs:
        b = arm(spring.position, centres[1])
        z[6:, 6:] += b.T @ stiffness(spring, w) @ b
    x = np.linalg.solve(z, right)
    forces = [
        stiffness(m, w) @ (arm(m.position, centres[0]) @ x[:6] - arm(m.position, centres[1]) @ x[6:])
        for m in engine.mounts
    ]
    return Answer(x[:6], x[6:], np.array(forces))


def body(rng: np.random.Generator, heaviest: float) -> Block:
    shape = np.diag(rng.uniform(0.3, 0.5, 3)) + 0.02 * (lambda a: a + a.T)(rng.normal(size=(3, 3)))
    kilograms = float(rng.uniform(0.3, 1.0) * heaviest)
    inertia = kilograms * 0.1 * shape
    return Block(kilograms, tuple(map(tuple, inertia.tolist())), tuple(rng.uniform(-0.2, 0.2, 3).tolist()))


def spring(rng: np.random.Generator, name: str, stiffest: float) -> Mount:
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return Mount(
        name, tuple(rng.uniform(-0.6, 0.6, 3).tolist()), tuple(rng.uniform(0.3, 1.0, 3) * stiffest),
        tuple(map(tuple, axes.tolist())), float(rng.uniform(0.02, 0.2)), tuple(rng.uniform(10.0, 300.0, 3).tolist()),
    )  # fmt: skip


def scene(seed: int) -> tuple[Engine, Frame]:
    rng = np.random.default_rng(seed)
    mounts = tuple(spring(rng, f"m{k}", 4e5) for k in range(int(rng.integers(3, 5))))
    springs = tuple(spring(rng, f"s{k}", 2e5) for k in range(int(rng.integers(0, 5))))
    engine = Engine("two bodies", Cycle.FOUR_STROKE, (), mounts=mounts, block=body(rng, 100.0))
    return engine, Frame(body(rng, 200.0), springs)


def wrenches(seed: int, orders: int = 6) -> np.ndarray:
    """Return the random loads about the origin in orders 0, 1/2, 1 ..., shape (orders, 6)."""
    rng = np.random.default_rng(1000 + seed)
    loads = rng.normal(size=(orders, 6)) + 1j * rng.normal(size=(orders, 6))
    loads[0] = loads[0].real
    return loads


def at_centre(load: np.ndarray, centre: tuple[float, float, float]) -> np.ndarray:
    return np.concatenate([load[:3], load[3:] - np.cross(np.array(centre), load[:3])])


def response(engine: Engine, receivers: Receivers, loads: np.ndarray) -> np.ndarray:
    """Return the acceleration of the receivers by the channel, shape (orders, receivers, 3)."""
    return response_at(engine, receivers, loads, SPEED / 2.0)


def response_at(engine: Engine, receivers: Receivers, loads: np.ndarray, w: float) -> np.ndarray:
    """Return the acceleration under loads at multiples of an angular frequency [rad/s]."""
    point = OperatingPoint("p", w)
    loaded = PointLoads(point, Spectrum(Fraction(1), loads), None, moving_parts=engine.with_extra(receivers))
    return ACCELERATION.signal(loaded).coefficients


def point(name: str, place: tuple[float, float, float], on_frame: bool) -> Receiver:
    return Receiver(name, "acceleration", place, on_frame)
