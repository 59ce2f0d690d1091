"""Random engines whose pistons a linkage drives, as problems of the other families and of their crossings."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np

from attack import crossings, families, single_families
from attack.driven_engines import DRIVES
from attack.families import Generator, Table
from attack.ranged_families import QUICK

CHOICES = {
    **{name: families.FAMILIES[name] for name in (
        "inline", "vee", "boxer", "opposed-piston", "parts", "points", "gas", "states", "crankcase", "chambers",
        "stars", "open-vees", "elastic-few", "convex-mounts", "joint", "elastic-balance", "uneven",
        "uneven crankcase", "places", "leads", "bank angle", "shared leads", "sizes", "worst means",
        "root mean quads",
    )},
    **{name: single_families.FAMILIES[name] for name in ("single gas", "single stars")},
    **crossings.PLAIN_CROSSINGS,
}  # fmt: skip
"""Families with pistons that a drive may move."""
COSTLY = {"leads": 0.2, "shared leads": 0.2, "sizes": 0.2, "uneven crankcase": 0.3, "sizes and places": 0.1,
          "leads and places": 0.2, "joint": 0.5, "elastic-few": 0.5, "uneven throws and stiffness": 0.3,
          "stars on mounts": 0.4, "robust and star": 0.4, "places and bearings": 0.4}  # fmt: skip
"""Shares of those whose rivals take long; others have one."""
SEARCHED = ("elastic-few", "elastic-many", "joint", "uneven", "places", "leads", "stars on mounts",
            "uneven throws and stiffness", "places and bearings", "leads and places",
            "optional shafts and uneven throws")  # fmt: skip
"""Not convex: few starts and boxes are enough, because claims count, not how far a search came."""
INSIDE = ("main-bearing force", "crank-pin force")


def driven(drive: str) -> Callable[[Generator], Table]:
    """Return a problem of a drive from any family with pistons, mostly without crankcase loads."""

    def made(rng: Generator) -> Table:
        while True:
            shares = np.array([COSTLY.get(name, 1.0) for name in CHOICES])
            family = str(rng.choice(list(CHOICES), p=shares / shares.sum()))
            table = copy.deepcopy(CHOICES[family](rng))
            if table["engine"]["layout"] not in ("radial", "rotary") and "drive" not in table["engine"]:
                break
        table["engine"] = DRIVES[drive](rng, table["engine"])
        if "search" in table or family in SEARCHED:
            table |= QUICK
        if rng.random() < 0.9:
            outside(rng, table)
        # what a random design of another drive had
        if rng.random() < 0.8:
            keep = ("degree of irregularity", "rms crank torque", "peak to peak stored work", "rms shaft twist")
            table["constraints"] = [c for c in table.get("constraints", []) if c["limit"] in keep]
        return {key: value for key, value in table.items() if value != []} | {"title": f"{drive} with {family}"}

    return made


def outside(rng: Generator, table: Table) -> None:
    """Replace what is asked of pins and bearings, which these drives do not have."""
    entries = table["objective"] if isinstance(table["objective"], list) else [table["objective"]]
    for entry in entries:
        for term in entry.get("terms", [entry]):
            key = "minimise" if "minimise" in term else "quantity"
            if any(term[key].endswith(name) for name in INSIDE):
                norm = term[key].rsplit(" ", 2)[0]
                term[key] = f"{norm} {rng.choice(['mount force', 'shaking force'])}"
            if term[key] == "running-gear mass":
                term[key] = "rms shaking force"


FAMILIES = {"crank-rockers": driven("crank-rocker"), "rhombic drives": driven("rhombic")}
