"""Loads of a machine from where its masses are, differentiated by a transform: no formula of the package is used.

The plane across the crank is z + i y; a mass at place p(phi) loads the block with -m p'' w^2. Positions are sampled
over a period, and their derivatives are exact as far as the samples resolve them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
STEPS = 512


@dataclass(frozen=True)
class Mass:
    """A mass on its way.

    Attributes
    ----------
    x
        Place along the crank [m].
    path
        z + i y over the period, shape (STEPS,) [m].
    """

    mass: float
    x: float
    path: Complex


def angles(turns: int = 1) -> NDArray[np.float64]:
    return 2.0 * np.pi * turns * np.arange(STEPS) / STEPS


def differentiated(path: Complex, turns: int = 1, times: int = 2) -> Complex:
    """Return the derivative by the crank angle of samples over whole turns."""
    orders = np.fft.fftfreq(STEPS, 1.0 / STEPS) / turns
    return np.fft.ifft(np.fft.fft(path) * (1j * orders) ** times)


def finer(values: Complex, times: int = 32) -> Complex:
    """Return the signal at so many times as many angles."""
    half = STEPS // 2
    result = np.fft.fft(values)
    padded = np.concatenate([result[:half], np.zeros((times - 1) * STEPS, complex), result[half:]])
    return np.fft.ifft(padded) * times


def crank_pin(radius: float, angle: float = 0.0, ratio: float = 1.0, centre: complex = 0.0) -> Complex:
    """Return a point that turns about a centre."""
    return centre + radius * np.exp(1j * (angle + ratio * angles()))


def piston(pin: Complex, length: float, bank: float, centre: complex = 0.0) -> Complex:
    """Return the other end of a rod, on the line through a centre at an angle from upright."""
    local = (pin - centre) * np.exp(-1j * bank)
    return centre + (local.real + np.sqrt(length**2 - local.imag**2)) * np.exp(1j * bank)


def force(masses: list[Mass], speed: float) -> Complex:
    """Return the force on the block, Fz + i Fy, over the period [N]."""
    return sum((-each.mass * speed**2 * differentiated(each.path) for each in masses), np.zeros(STEPS, complex))


def couple(masses: list[Mass], speed: float) -> Complex:
    """Return the couple My - i Mz = -x (Fz + i Fy) of all masses over the period [N m]."""
    return sum((-each.x * force([each], speed) for each in masses), np.zeros(STEPS, complex))


def roll(masses: list[Mass], speed: float) -> NDArray[np.float64]:
    """Return the roll moment on the block, y Fz - z Fy, without torques of shafts, over the period [N m]."""
    total = np.zeros(STEPS)
    for each in masses:
        own = force([each], speed)
        total += each.path.imag * own.real - each.path.real * own.imag
    return total


def rigid(mass: float, inertia: float, x: float, centre: Complex, direction: Complex) -> list[Mass]:
    """Return a body as two half masses on a line through its centre of gravity that turns with it."""
    arm = np.sqrt(inertia / mass) * direction / np.abs(direction)
    return [Mass(0.5 * mass, x, centre + arm), Mass(0.5 * mass, x, centre - arm)]


def energy(masses: list[Mass]) -> NDArray[np.float64]:
    """Return the kinetic energy at unit speed of the crank, over the period [J s2]."""
    return sum((0.5 * each.mass * np.abs(differentiated(each.path, times=1)) ** 2 for each in masses), np.zeros(STEPS))


def wrench(masses: list[Mass], speed: float) -> NDArray[np.float64]:
    """Return the wrench (Fy, Fz, roll moment) on the block of masses on a crank over the period, shape (3, STEPS).

    The block holds the shaft that takes the energy of the masses.
    """
    drive = speed**2 * differentiated(energy(masses).astype(complex), times=1).real
    total = force(masses, speed)
    return np.stack([total.imag, total.real, roll(masses, speed) - drive])
