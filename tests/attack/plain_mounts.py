"""Forces on mounts: rigid ones by least energy of their springs, elastic ones by the six motions of the block."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg

from attack.plain_loads import SAMPLES, number

GRAVITY = 9.80665


def arm(r: np.ndarray) -> np.ndarray:
    """Return the wrench about the origin of a force at r, (6, 3); its transpose is the motion of that point."""
    x, y, z = r
    return np.vstack([np.eye(3), [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]])


def turned_axes(degrees: list[Any]) -> np.ndarray:
    """Return the own axes of a mount as columns, turned about x, then y, then z."""
    a, b, c = (math.radians(float(v)) for v in degrees)
    rx = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    ry = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    rz = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    return rz @ ry @ rx


@dataclass(frozen=True)
class Rigid:
    """Mounts far below resonance, shape of forces (mounts, 3) per wrench."""

    transfer: np.ndarray

    def forces(self, orders: np.ndarray, wrench: np.ndarray, speed: float) -> np.ndarray:
        """Return the coefficients (n, mounts, 3) of those of the wrench (n, 6)."""
        return np.einsum("mij,nj->nmi", self.transfer, wrench)


def rigid(mounts: dict[str, Any]) -> Rigid:
    places = mounts.get("places") or [{"position": p} for p in mounts["positions"]]
    common = mounts.get("relative_stiffness", [0.0, 1.0, 1.0])
    maps, springs = [], []
    for place in places:
        axes = turned_axes(place.get("turned", [0, 0, 0]))
        k = axes @ np.diag([float(v) for v in place.get("relative_stiffness", common)]) @ axes.T
        maps.append(arm(np.array([number(v) for v in place["position"]])))
        springs.append(k)
    # motion that carries the wrench with the least energy; lengths of rotation are metres
    total = sum(g @ k @ g.T for g, k in zip(maps, springs, strict=True))
    motion = np.linalg.pinv(total, rcond=1e-11)
    return Rigid(np.array([k @ g.T @ motion for g, k in zip(maps, springs, strict=True)]))


@dataclass(frozen=True)
class Elastic:
    """A rigid block on springs with loss; everything about its centre of gravity."""

    mass: np.ndarray
    centre: np.ndarray
    maps: tuple[np.ndarray, ...]
    springs: tuple[np.ndarray, ...]
    losses: tuple[np.ndarray, ...]
    dampers: tuple[np.ndarray, ...]
    diagonal: tuple[np.ndarray, ...]

    def _sum(self, parts: tuple[np.ndarray, ...]) -> np.ndarray:
        return sum(g @ p @ g.T for g, p in zip(self.maps, parts, strict=True))

    @cached_property
    def stiffness(self) -> np.ndarray:
        return self._sum(self.springs)

    @cached_property
    def _loss(self) -> np.ndarray:
        return self._sum(self.losses)

    @cached_property
    def _damping(self) -> np.ndarray:
        return self._sum(self.dampers)

    def motion(self, orders: np.ndarray, wrench: np.ndarray, speed: float) -> np.ndarray:
        """Return the coefficients (n, 6) of the motion of the centre of gravity."""
        w = (orders * speed)[:, None, None]
        about = wrench.copy()
        about[:, 3:] -= np.cross(self.centre, wrench[:, :3])
        dynamic = self.stiffness + 1j * self._loss * (w > 0) + 1j * w * self._damping - w**2 * self.mass
        return np.linalg.solve(dynamic, about[:, :, None])[:, :, 0]

    def travel(self, orders: np.ndarray, wrench: np.ndarray, speed: float) -> np.ndarray:
        q = self.motion(orders, wrench, speed)
        return np.stack([q @ g for g in self.maps], axis=1)

    def forces(self, orders: np.ndarray, wrench: np.ndarray, speed: float) -> np.ndarray:
        travel = self.travel(orders, wrench, speed)
        w = (orders * speed)[:, None, None]
        parts = zip(self.springs, self.losses, self.dampers, strict=True)
        return np.stack(
            [
                np.einsum("nij,nj->ni", k + 1j * h * (w > 0) + 1j * w * c, travel[:, m])
                for m, (k, h, c) in enumerate(parts)
            ],
            axis=1,
        )

    def firm(self, wrench: np.ndarray) -> np.ndarray:
        """Return the forces of a block that does not accelerate."""
        about = wrench.copy()
        about[:, 3:] -= np.cross(self.centre, wrench[:, :3])
        q = np.linalg.solve(self.stiffness, about.T).T
        return np.stack([q @ g @ k.T for g, k in zip(self.maps, self.springs, strict=True)], axis=1)

    @cached_property
    def frequencies(self) -> np.ndarray:
        """Return the natural frequencies [Hz]."""
        squared = scipy.linalg.eigh(self.stiffness, self.mass, eigvals_only=True)
        return np.sqrt(np.maximum(squared, 0.0)) / (2.0 * math.pi)

    @property
    def sag(self) -> float:
        weight = np.zeros(6)
        weight[2] = -GRAVITY * self.mass[0, 0]
        return float(-np.linalg.solve(self.stiffness, weight)[2])

    @property
    def total(self) -> float:
        return float(sum(d.sum() for d in self.diagonal))

    def torque_roll(self, frequency: float) -> float:
        """Return the size of A t / w^2 - t at unit mass, t the unit rotation of the free block under a roll torque."""
        torque = np.zeros(6)
        torque[3] = 1.0
        root = np.real(scipy.linalg.sqrtm(self.mass))
        inverse = np.linalg.inv(root)
        t = root @ np.linalg.solve(self.mass, torque)
        t /= np.linalg.norm(t)
        return float(np.linalg.norm(inverse @ self.stiffness @ inverse @ t / (2 * math.pi * frequency) ** 2 - t))


def elastic(mounts: dict[str, Any], block: dict[str, Any]) -> Elastic:
    centre = np.array([number(v) for v in block.get("centre_of_gravity", [0, 0, 0])])
    mass = np.zeros((6, 6))
    mass[:3, :3] = number(block["mass"]) * np.eye(3)
    xx, yy, zz = (number(v) for v in block["inertia"])
    xy, xz, yz = (number(v) for v in block.get("inertia_products", [0, 0, 0]))
    mass[3:, 3:] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    maps, springs, losses, dampers, diagonal = [], [], [], [], []
    for place in mounts["places"]:
        axes = turned_axes(place.get("turned", [0, 0, 0]))
        k = np.array([number(v) for v in place["stiffness"]])
        c = np.array([number(v) for v in place.get("damping", [0, 0, 0])])
        loss = float(place.get("loss_factor", mounts.get("loss_factor", 0.0)))
        maps.append(arm(np.array([number(v) for v in place["position"]]) - centre))
        springs.append(axes @ np.diag(k) @ axes.T)
        losses.append(loss * springs[-1])
        dampers.append(axes @ np.diag(c) @ axes.T)
        diagonal.append(k)
    return Elastic(mass, centre, tuple(maps), tuple(springs), tuple(losses), tuple(dampers), tuple(diagonal))


def over_cycle(coefficients: np.ndarray) -> np.ndarray:
    """Return the samples of a real signal from coefficients of the transform, first axis."""
    return np.fft.irfft(coefficients * SAMPLES, n=SAMPLES, axis=0)
