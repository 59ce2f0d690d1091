"""A band that no stiffness leaves is infeasible."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

import laufruhe
from attack.own_loads import si
from laufruhe.solvers.result import Status

INPUTS = Path(__file__).parent / "inputs"


def frequencies(table: dict[str, Any], stiffness: float) -> np.ndarray:
    """Return the natural frequencies of the block on upright springs, with the open one at a stiffness [Hz]."""
    centre = np.array([si(x) for x in table["block"]["centre_of_gravity"]])
    (xx, yy, zz), (xy, xz, yz) = ([si(x) for x in table["block"][key]] for key in ("inertia", "inertia_products"))
    mass = np.zeros((6, 6))
    mass[:3, :3] = si(table["block"]["mass"]) * np.eye(3)
    mass[3:, 3:] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    whole = np.zeros((6, 6))
    for place in table["mounts"]["places"]:
        x, y, z = np.array([si(each) for each in place["position"]]) - centre
        motion = np.hstack([np.eye(3), np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])])
        springs = [stiffness if isinstance(k, dict) else si(k) for k in place["stiffness"]]
        whole += motion.T @ np.diag(springs) @ motion
    return np.sqrt(eigh(whole, mass, eigvals_only=True)) / (2.0 * np.pi)


@pytest.mark.slow
def test_a_band_that_no_stiffness_leaves_is_infeasible() -> None:
    path = INPUTS / "frequency-band-on-any-stiffness.toml"
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    result = laufruhe.solve(path)
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("natural frequencies",)
    # frequencies feel no weight: on every stiffness one stands in the band
    low, high = (si(edge) for edge in table["constraints"][0]["outside"])
    ends = next(k for place in table["mounts"]["places"] for k in place["stiffness"] if isinstance(k, dict))
    for stiffness in np.linspace(*map(si, ends["between"]), 101):
        f = frequencies(table, float(stiffness))
        assert np.any((f > low) & (f < high))
