"""Channels of receivers: weighted acceleration, velocity and sound pressure (Q1-Q6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from laufruhe.extensions.receivers.machine import Quantity, receivers_of
from laufruhe.extensions.receivers.physics import response
from laufruhe.machine import Engine
from laufruhe.problem.channels import Display, LoadChannel, Need, crankcase_signal


def _channel(quantity: Quantity, unit: str, title: str, *keys: str) -> LoadChannel:
    def places(engine: Engine) -> Sequence[str]:
        return [receiver.name for receiver in receivers_of(engine, quantity)]

    name = f"receiver {quantity}"
    needs = Need(places, f"a receiver with unit {unit}", "add one to [[receivers]]")
    signal = crankcase_signal(name, lambda engine, loads: response(engine, loads, quantity))
    narrowing = ("operating_points", "orders", *keys, "receivers")
    return LoadChannel(name, unit, narrowing, needs, signal=signal, places=places, display=Display(title, "receiver"))


ACCELERATION = _channel("acceleration", "m/s^2", "Acceleration at receivers", "direction_weights")
VELOCITY = _channel("velocity", "m/s", "Velocity at receivers", "direction_weights")
PRESSURE = _channel("pressure", "Pa", "Sound pressure at receivers")
CHANNELS: Mapping[Quantity, LoadChannel] = {
    "acceleration": ACCELERATION, "velocity": VELOCITY, "pressure": PRESSURE,
}  # fmt: skip
"""Channels by the quantity of their receivers."""
