"""Modes between stops that no motion touches, in blocks of steps, compared with single steps."""

from __future__ import annotations

import numpy as np

from laufruhe.extensions.run_ups.linear_run import BLOCK
from laufruhe.extensions.run_ups.stopped_run import _DesignBatch, _followed


def test_free_steps_are_those_of_the_matrix_exponential() -> None:
    """Check z_{k+1} = e^{A h} z_k + b_k through several blocks, for two designs at once."""
    rng = np.random.default_rng(3)
    designs, modes, steps = 2, 3, 3 * BLOCK + 7
    decays = rng.uniform(0.9, 0.999, (designs, modes)) * np.exp(1j * rng.uniform(0.0, 0.5, (designs, modes)))
    driven = rng.normal(size=(designs, modes, steps)) + 1j * rng.normal(size=(designs, modes, steps))
    seen = rng.normal(size=(designs, 1, 2 * modes))
    none = np.zeros((designs, 2 * modes, 1))
    side = _DesignBatch(decays, seen, none, none, np.full((designs, 1, 1), np.inf), np.ones((designs, 1, 1)))
    z, expected = driven[..., 0], [driven[..., 0]]
    for k in range(1, steps):
        z = decays * z + driven[..., k]
        expected.append(z)
    assert np.allclose(_followed(side, driven), np.stack(expected, axis=-1), rtol=1e-12, atol=1e-12)
