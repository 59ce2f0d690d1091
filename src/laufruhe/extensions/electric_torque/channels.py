"""Channel of the torque of electric machines (T16)."""

from __future__ import annotations

from functools import partial

import numpy as np

from laufruhe.extensions.electric_torque.machine import machines_of
from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.channels import LoadChannel, Need, crankcase_signal
from laufruhe.problem.loads import PointLoads

NAME = "electric torque"


def _torques(engine: Engine, loads: PointLoads) -> Spectrum:
    machines = machines_of(engine)
    torques = (machine.torque(loads.point.name, engine.cycle.base_order) for machine in machines)
    first, *others = (
        torque.mapped(lambda values: values[:, None, None]).mapped(partial(np.multiply, column))
        for torque, column in zip(torques, np.eye(len(machines))[..., None], strict=True)
    )
    return sum(others, first)


ELECTRIC_TORQUE = LoadChannel(
    NAME, "N m", ("operating_points", "orders", "alternating", "electric_machines"),
    Need(machines_of, "an electric machine", "add one to [[electric_machines]]"),
    signal=crankcase_signal(NAME, _torques), places=lambda engine: [one.name for one in machines_of(engine)],
    depends_on_gas=False, depends_on_unbalances=False,
)  # fmt: skip
