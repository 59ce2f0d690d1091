"""Many designs of a block on elastic mounts at once: six motions, order by order, and what is at rest.

Written from docs/theory/elastic-mounts.md, apart from the package and from the plain model. The first axis of every
array counts designs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from attack.own_loads import Table, si

GRAVITY = 9.80665
KEYS = ("stiffness", "loss_factor", "damping", "damping_per_stiffness", "stop", "fluid_track")
MIRROR = np.diag([1.0, -1.0, 1.0])


def numbers(entry: Any, count: int) -> np.ndarray:
    """Return an array (count, ...) of a number, a list of them, or what was put in for open ones."""
    if isinstance(entry, np.ndarray):
        return entry
    if isinstance(entry, list):
        return np.stack([numbers(v, count) for v in entry], axis=1)
    return np.full(count, si(entry))


def crossed(r: np.ndarray) -> np.ndarray:
    """Return an array (..., 3, 3) with crossed(r) v = r x v."""
    out = np.zeros((*r.shape, 3))
    x, y, z = np.moveaxis(r, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    return out - np.swapaxes(out, -1, -2)


def rotation(angles: np.ndarray) -> np.ndarray:
    """Return the own axes as columns: about x, then y, then z, by (count, 3) [rad]."""
    turned = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for axis in range(3):
        e = np.zeros((len(angles), 3))
        e[:, axis] = 1.0
        k, a = crossed(e), angles[:, axis, None, None]
        turned = (np.eye(3) + np.sin(a) * k + (1.0 - np.cos(a)) * k @ k) @ turned
    return turned


@dataclass(frozen=True)
class Blocks:
    """Designs of one file.

    Attributes
    ----------
    mass
        (6, 6), about the centre of gravity, the same for all.
    moves
        (count, mounts, 3, 6), travel of a mount by motions of the centre of gravity.
    axes
        (count, mounts, 3, 3), own axes as columns.
    stiff, loss, damping
        (count, mounts, 3) along own axes.
    tracks
        Mount, axis, and mass, bulge, chamber and damping of fluid tracks.
    stops
        (mounts, 2) gap and stiffness of bump stops; endless without one.
    place
        Mount with whose force that of each mount counts as one.
    """

    mass: np.ndarray
    centre: np.ndarray
    moves: np.ndarray
    axes: np.ndarray
    stiff: np.ndarray
    loss: np.ndarray
    damping: np.ndarray
    tracks: list[tuple[int, int, tuple[float, float, float, float]]]
    stops: np.ndarray
    place: list[int]

    def along(self, along_axes: np.ndarray) -> np.ndarray:
        """Return an array (..., mounts, 3, 3) of values along own axes (..., mounts, 3)."""
        return (self.axes * along_axes[..., None, :]) @ np.swapaxes(self.axes, -1, -2)

    def summed(self, parts: np.ndarray) -> np.ndarray:
        """Return an array (count, 6, 6) of (count, mounts, 3, 3)."""
        return (np.swapaxes(self.moves, -1, -2) @ parts @ self.moves).sum(axis=1)

    @cached_property
    def at_rest(self) -> np.ndarray:
        """Return the stiffness along own axes, what fluid tracks add at rest counted."""
        out = self.stiff.copy()
        for m, axis, (_, bulge, chamber, _) in self.tracks:
            out[:, m, axis] += bulge * chamber / (bulge + chamber)
        return out

    @cached_property
    def firmness(self) -> np.ndarray:
        """Return an array (count, 6, 6)."""
        return self.summed(self.along(self.at_rest))

    @cached_property
    def _laws(self) -> list[np.ndarray]:
        """Return the stiffness at rest, what is lost of it, damping: (count, mounts, 3, 3)."""
        return [self.along(along_axes) for along_axes in (self.at_rest, self.loss, self.damping)]

    @cached_property
    def _sums(self) -> list[np.ndarray]:
        return [self.summed(law)[:, None] for law in self._laws]

    def _track(self, m: int, axis: int, fluid: tuple[float, ...], w: np.ndarray) -> np.ndarray:
        """Return an array (count, n, 3, 3) of what a fluid track adds at w to what it has at rest."""
        mass, bulge, chamber, drag = fluid
        z = chamber - mass * w**2 + 1j * w * drag
        more = bulge * z / (bulge + z) - bulge * chamber / (bulge + chamber)
        a = self.axes[:, None, m, :, axis]
        return more[:, None, None] * (a[..., :, None] * a[..., None, :])

    def about_centre(self, wrench: np.ndarray) -> np.ndarray:
        """Return a wrench about the centre of gravity, from one about the origin, shape (count, 6)."""
        out = wrench.copy()
        out[..., 3:] -= np.cross(self.centre, wrench[..., :3])
        return out

    def answer(self, w: np.ndarray, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces and travel (count, n, mounts, 3) of orders at w (n,) [rad/s], wrench (count, n, 6)."""
        lost, speed = 1j * (w > 0.0)[:, None, None], w[:, None, None]
        k, h, c = self._sums
        left = k + lost * h + 1j * speed * c - speed**2 * self.mass
        tracks = [(m, self._track(m, axis, fluid, w)) for m, axis, fluid in self.tracks]
        for m, more in tracks:
            g = self.moves[:, None, m]
            left = left + np.swapaxes(g, -1, -2) @ more @ g
        q = np.linalg.solve(left, self.about_centre(wrench)[..., None])
        travel = (self.moves[:, None] @ q[:, :, None])[..., 0]
        k, h, c = (np.einsum("bmij,bnmj->bnmi", law, travel) for law in self._laws)
        forces = k + lost * h + 1j * speed * c
        for m, more in tracks:
            forces[:, :, m] += (more @ travel[:, :, m, :, None])[..., 0]
        return self.joined(forces), travel

    def joined(self, forces: np.ndarray) -> np.ndarray:
        """Return the forces of springs that stand in one place added up, those of others nought."""
        out = np.zeros_like(forces)
        for m, to in enumerate(self.place):
            out[..., to, :] += forces[..., m, :]
        return out

    def firm(self, wrench: np.ndarray) -> np.ndarray:
        """Return the forces if the block did not accelerate, by stiffness at rest."""
        return self.answer(np.zeros(wrench.shape[1]), wrench)[0]

    # --- at rest

    @cached_property
    def _root(self) -> np.ndarray:
        """Return the inverse root of the mass, symmetric."""
        values, vectors = np.linalg.eigh(self.mass)
        return (vectors / np.sqrt(values)) @ vectors.T

    @cached_property
    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the frequencies (count, 6) [Hz], and shares (count, motion, mode) of kinetic energy."""
        squares, turned = np.linalg.eigh(self._root @ self.firmness @ self._root)
        v = self._root @ turned
        return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi), v * (self.mass @ v)

    @property
    def sag(self) -> np.ndarray:
        down = np.zeros((len(self.moves), 6, 1))
        down[:, 2] = GRAVITY * self.mass[0, 0]
        return np.linalg.solve(self.firmness, down)[:, 2, 0]

    def torque_roll(self, frequency: float) -> np.ndarray:
        turning = np.concatenate([np.zeros(3), np.linalg.inv(self.mass[3:, 3:])[:, 0]])
        t = np.linalg.solve(self._root, turning)
        t /= np.linalg.norm(t)
        left = self._root @ self.firmness @ self._root @ t / (2.0 * math.pi * frequency) ** 2 - t
        return np.linalg.norm(left, axis=-1)

    def raw_torque_roll(self, band: tuple[float, float]) -> np.ndarray:
        """Return the least over squares of frequencies in a band [Hz]."""
        turning = np.concatenate([np.zeros(3), np.linalg.inv(self.mass[3:, 3:])[:, 0]])
        turning /= np.linalg.norm(turning)
        pulled, inert = self.firmness @ turning, self.mass @ turning
        s = np.clip(pulled @ inert / (inert @ inert), *((2.0 * math.pi * f) ** 2 for f in band))
        return np.linalg.norm(pulled - s[:, None] * inert, axis=-1)

    def static_answer(self, wrench: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return travel and forces (count, mounts, 3) of least energy under a load (6,) about the centre of gravity."""
        gap, hard = self.stops[:, 0, None], self.stops[:, 1, None]
        count = len(self.moves)
        along_axes = np.einsum("bmki,bmkj->bmij", self.axes, self.moves)
        q = np.zeros((count, 6))

        def parts(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            u = np.einsum("bmij,bj->bmi", along_axes, q)
            beyond = np.sign(u) * np.maximum(np.abs(u) - gap, 0.0)
            energy = 0.5 * np.sum(self.at_rest * u**2 + hard * beyond**2, axis=(1, 2)) - q @ wrench
            return u, beyond, energy

        for _ in range(200):
            u, beyond, energy = parts(q)
            force = self.at_rest * u + hard * beyond
            slope = np.einsum("bmij,bmi->bj", along_axes, force) - wrench
            stiff = self.at_rest + hard * (np.abs(u) > gap)
            step = np.linalg.solve(np.einsum("bmki,bmk,bmkj->bij", along_axes, stiff, along_axes), -slope[..., None])[
                ..., 0
            ]
            share = np.ones(count)
            for _ in range(40):
                worse = parts(q + share[:, None] * step)[2] > energy + 1e-4 * share * np.sum(
                    slope * step, axis=1
                ) + 1e-12 * abs(energy)
                if not worse.any():
                    break
                share[worse] *= 0.5
            q = q + share[:, None] * step
            if np.all(np.abs(share[:, None] * step) <= 1e-15 + 1e-13 * np.abs(q)):
                break
        u, beyond, _ = parts(q)
        force = self.at_rest * u + hard * beyond
        return (self.moves @ q[:, None, :, None])[..., 0], self.joined((self.axes @ force[..., None])[..., 0])


def blocks(table: Table, count: int) -> Blocks:
    """Return the designs of a file whose open numbers are arrays (count,)."""
    block, mounts = table["block"], table["mounts"]
    centre = np.array([si(v) for v in block.get("centre_of_gravity", [0.0, 0.0, 0.0])])
    mass = si(block["mass"]) * np.eye(6)
    xx, yy, zz = (si(v) for v in block["inertia"])
    xy, xz, yz = (si(v) for v in block.get("inertia_products", [0.0, 0.0, 0.0]))
    mass[3:, 3:] = [[xx - si(block.get("turning_inertia", 0.0)), xy, xz], [xy, yy, yz], [xz, yz, zz]]
    names = [entry.get("name", f"mount {k + 1}") for k, entry in enumerate(mounts["places"])]
    defaults = {key: mounts[key] for key in KEYS if key in mounts}
    columns: dict[str, Any] = {key: [] for key in ("at", "axes", "stiff", "loss", "damping", "place")}
    tracks, stops, wholes = [], [], []
    for k, entry in enumerate(mounts["places"]):
        mirrored = "mirror_of" in entry
        if "like" in entry or mirrored:
            leader = wholes[names.index(entry.get("like", entry.get("mirror_of")))]
            entry = {**({key: v for key, v in leader.items() if mirrored or key in KEYS}), **entry}
        wholes.append(entry)
        whole = {**defaults, **entry}
        to = names.index(whole["joined_to"]) if "joined_to" in whole else k
        at = columns["at"][to] if to != k else numbers(whole["position"], count)
        axes = (
            rotation(np.radians(numbers(whole["turned"], count)))
            if "turned" in whole
            else rotation(np.zeros((count, 3)))
        )
        if mirrored:
            at, axes = at @ MIRROR, MIRROR @ axes @ MIRROR
        stiff = numbers(whole["stiffness"], count)
        after = numbers(whole.get("damping_per_stiffness", 0.0), count)
        columns["at"].append(at)
        columns["axes"].append(axes)
        columns["stiff"].append(stiff)
        columns["loss"].append(numbers(whole.get("loss_factor", 0.0), count)[:, None] * stiff)
        columns["damping"].append(numbers(whole.get("damping", [0.0] * 3), count) + after[:, None] * stiff)
        columns["place"].append(to)
        stop = whole.get("stop")
        stops.append((si(stop["gap"]), si(stop["stiffness"])) if stop else (1e9, 0.0))
        if "fluid_track" in whole:
            f = whole["fluid_track"]
            fluid = tuple(si(f.get(key, 0.0)) for key in ("mass", "bulge_stiffness", "chamber_stiffness", "damping"))
            tracks.append((k, "xyz".index(f["axis"]), fluid))
    at, axes, stiff, loss, damping = (
        np.stack(columns[key], axis=1) for key in ("at", "axes", "stiff", "loss", "damping")
    )
    moves = np.concatenate([np.broadcast_to(np.eye(3), axes.shape), -crossed(at - centre)], axis=-1)
    return Blocks(mass, centre, moves, axes, stiff, loss, damping, tracks, np.array(stops), columns["place"])  # type: ignore[arg-type]
