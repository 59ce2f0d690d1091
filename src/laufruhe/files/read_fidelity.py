"""The [fidelity] table: choices by hand, or the cheapest that is good enough."""

from __future__ import annotations

import math
from dataclasses import replace

from laufruhe.fidelity.automatic import DEFAULT_TOLERANCE, automatic
from laufruhe.files.complaints import Refused
from laufruhe.files.file_models import FidelityTable
from laufruhe.physics.fidelity import EXACT, MODES, Fidelity
from laufruhe.problem.problem import Problem

_BY_HAND = ("samples", "orders", "rod", "gas", "gas_samples", "mounts", "modes")


def at_fidelity(problem: Problem, table: FidelityTable) -> Problem:
    """The problem at the fidelity that a table describes.

    Raises
    ------
    Refused
        If a key contradicts another.
    """
    _check_mounts(problem, table)
    inertia = math.inf if table.crank_inertia is None else table.crank_inertia
    if table.kinematics != "auto":
        if table.tolerance is not None:
            raise Refused("fidelity.tolerance", table.tolerance, "goes with auto only", 'add kinematics = "auto"')
        if table.crank_inertia is not None and table.kinematics != "exact":
            raise Refused("fidelity.crank_inertia", inertia, "goes with exact kinematics only", "leave kinematics out")
        return replace(problem, fidelity=_by_hand(table, table.kinematics == "exact", inertia))
    for key in _BY_HAND:
        if getattr(table, key) is not None:
            raise Refused(f"fidelity.{key}", getattr(table, key), "is what auto decides", "leave it out")
    uneven = replace(problem, fidelity=replace(EXACT, crank_inertia=inertia))
    return automatic(uneven, table.tolerance or DEFAULT_TOLERANCE)


def _by_hand(table: FidelityTable, exact: bool, inertia: float) -> Fidelity:
    return Fidelity(
        "exact" if exact else "two-order",
        table.samples or EXACT.samples,
        orders=table.orders,
        rod=table.rod or EXACT.rod,
        gas=table.gas is not False,
        gas_samples=table.gas_samples,
        crank_inertia=inertia,
        mounts=table.mounts or EXACT.mounts,
        modes=None if table.modes is None else tuple(table.modes),
    )


def _check_mounts(problem: Problem, table: FidelityTable) -> None:
    """How mounts answer is a choice of elastic ones, and only one of it leaves them to be decided."""
    for key in ("mounts", "modes"):
        value = getattr(table, key)
        if value is None or value == EXACT.mounts:
            continue
        name = f"fidelity.{key}"
        if problem.engine.block is None:
            raise Refused(name, value, "is a choice of elastic mounts", 'leave it out, or add mounts of kind "elastic"')
        if problem.mount_decisions:
            raise Refused(name, value, "would change with the mounts that are open", "leave it out, or fix the mounts")
    modes = table.modes
    if modes is not None and table.mounts in ("rigid", "time"):
        raise Refused("fidelity.modes", modes, "go with mounts in the frequency domain", "leave one of the two out")
    if modes is not None and (len(set(modes)) < len(modes) or not all(1 <= mode <= MODES for mode in modes)):
        raise Refused("fidelity.modes", modes, f"must be different numbers from 1 to {MODES}", "1 is the lowest mode")
