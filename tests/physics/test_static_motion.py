"""A steady load on elastic mounts."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.errors import UncarriedLoadError
from laufruhe.machine import Block, Mount
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.modes import modes_of, static_motion
from laufruhe.physics.time_model import time_model

CUBE = Block(100.0, ((4.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, 6.0)))
HEAVE = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def four_mounts(stiffness: float, **more: float) -> ElasticMounting:
    """Return a block of 50 kg amid four equal mounts, so that it heaves by itself."""
    block = Block(50.0, ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 2.5)))
    places = [(x, y, 0.0) for x in (-0.3, 0.3) for y in (-0.2, 0.2)]
    return elastic_mounting(block, [Mount(f"{k}", at, (stiffness,) * 3, **more) for k, at in enumerate(places)])


def test_a_steady_load_turns_the_block_only_where_mounts_resist() -> None:
    """Check F / k where mounts resist, and the message for a load along a free motion."""
    held = np.diag([4e5, 5e5, 0.0, 2e4, 3e4, 6e4])
    modes = modes_of(np.diag([50.0, 50.0, 50.0, 1.0, 2.0, 3.0]), held)
    wrench = np.array([100.0, -40.0, 0.0, 3.0, 0.0, 9.0])
    expected = [100.0 / 4e5, -40.0 / 5e5, 0.0, 3.0 / 2e4, 0.0, 9.0 / 6e4]
    assert static_motion(modes, wrench) == pytest.approx(expected, rel=1e-9, abs=1e-15)
    with pytest.raises(UncarriedLoadError, match="drives the block in bounce, which no mount resists; add a mount"):
        static_motion(modes, wrench + HEAVE)
    mounting = four_mounts(3e4)
    assert static_motion(mounting.modes, 600.0 * HEAVE) == pytest.approx(600.0 / 1.2e5 * HEAVE, abs=1e-12)
    assert time_model(mounting).size == 6


def test_a_steady_load_is_refused_by_what_no_mount_resists_alone() -> None:
    mounting = elastic_mounting(CUBE, [Mount("only", (0.0, 0.0, 0.0), (1e5, 2e5, 4e5))])
    assert static_motion(mounting.modes, np.array([0.0, 50.0, 80.0, 0.0, 0.0, 0.0])) == pytest.approx(
        [0.0, 50.0 / 2e5, 80.0 / 4e5, 0.0, 0.0, 0.0]
    )
    with pytest.raises(UncarriedLoadError, match="roll"):
        static_motion(mounting.modes, np.array([0.0, 50.0, 0.0, 3.0, 0.0, 0.0]))
