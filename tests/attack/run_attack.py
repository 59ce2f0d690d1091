"""Random problems of every family, what is claimed of each, and the page that says what came out.

    python tests/attack/run_attack.py run FAMILY[,FAMILY ...] --from 0 --number 100 --log results/attack/run.jsonl
    python tests/attack/run_attack.py page results/attack/*.jsonl

`make attack` does both. A line of the log is one problem; what the log has is not run again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from attack.claims import Verdict, tried, try_problem
from attack.crossings import CROSSINGS, OWN_CROSSINGS
from attack.driven_families import FAMILIES as DRIVEN_FAMILIES
from attack.families import FAMILIES, problem, toml
from attack.newer_families import FAMILIES as NEWER_FAMILIES
from attack.own_families import OWN_FAMILIES
from attack.page import lines_of, page
from attack.plain_loads import SAMPLES
from attack.plain_scene import Table
from attack.ranged_families import FAMILIES as RANGED_FAMILIES
from attack.single_families import FAMILIES as SINGLE_FAMILIES
from attack.skipped_families import STUDIES
from attack.variations import VARIATIONS

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "results" / "attack" / "README.md"
VARIED = {
    "prices": ("inline", "vee", "points", "gas", "stars", "elastic-balance", "convex-mounts", "elastic-few"),
    "monotony": ("inline", "boxer", "stars", "open-vees", "elastic-balance", "joint"),
    "invariance": ("inline", "vee", "radial", "parts", "stars", "elastic-balance", "convex-mounts", "elastic-few"),
}
NAMES = [
    *FAMILIES,
    *SINGLE_FAMILIES,
    *DRIVEN_FAMILIES,
    *RANGED_FAMILIES,
    *NEWER_FAMILIES,
    *OWN_FAMILIES,
    *CROSSINGS,
    *STUDIES,
    *(f"{variation} of {family}" for variation, families in VARIED.items() for family in families),
]
GROUPS = {
    "all": NAMES,
    "crossings": [*CROSSINGS],
    "alone": [
        *FAMILIES,
        *SINGLE_FAMILIES,
        *DRIVEN_FAMILIES,
        *RANGED_FAMILIES,
        *NEWER_FAMILIES,
        *OWN_FAMILIES,
        *STUDIES,
    ],
}
"""Families by one word."""
FINER = 32768
EFFORT = 6
"""Stars that are solved one by one, at most ten times as many, and hundreds of calls of a local search."""


def commit() -> str:
    """Return the commit of the attacked source; empty if it is unknown."""
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip()


def drawn(family: str, seed: int) -> tuple[Table, np.random.Generator]:
    """Return a problem of any family, and the generator that goes on from there."""
    made = OWN_FAMILIES.get(family) or CROSSINGS.get(family)
    if made is None:
        return problem(family, seed)
    rng = np.random.default_rng([*family.encode(), seed])
    return {"title": f"{family} {seed}", **made(rng)}, rng


def attacked(name: str, seed: int, effort: int = EFFORT) -> Verdict:
    """Attack one problem of a family, or a variation of one: "prices of inline"."""
    variation, _, family = name.rpartition(" of ")
    if name in STUDIES:
        rng = np.random.default_rng([*name.encode(), seed])
        with tempfile.TemporaryDirectory(prefix="attack-") as folder:
            return tried(Verdict(name, seed), lambda: STUDIES[name](rng, Path(folder)))
    table, rng = drawn(family, seed)
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        if variation:
            vary = VARIATIONS[variation]
            return tried(Verdict(name, seed), lambda: vary(table, rng, Path(folder)))
        verdict = try_problem(family, seed, table, rng, Path(folder), effort)
        if verdict.wrong and SAMPLES < FINER and family not in OWN_FAMILIES and family not in OWN_CROSSINGS:
            return finer(family, seed, Path(folder), effort)
        return verdict


def finer(family: str, seed: int, folder: Path, effort: int) -> Verdict:
    """Return the verdict of a plain model that resolves peaks and bends of gas torque, from its own process."""
    log = folder / "finer.jsonl"
    words = ["run", family, "--from", str(seed), "--number", "1", "--log", str(log), "--effort", str(effort)]
    subprocess.run(
        [sys.executable, __file__, *words], env={**os.environ, "ATTACK_SAMPLES": str(FINER)}, capture_output=True,
        check=True,
    )  # fmt: skip
    line = lines_of([log])[0]
    return Verdict(**{key: value for key, value in line.items() if key != "commit"})


def run(arguments: argparse.Namespace) -> None:
    """Attack each family in turn, seed by seed, until the number or the time is reached."""
    arguments.log.parent.mkdir(parents=True, exist_ok=True)
    families = GROUPS.get(arguments.families) or arguments.families.split(",")
    known, until, at = (
        lines_of([arguments.log] if arguments.log.exists() else []),
        time.monotonic() + arguments.seconds,
        commit(),
    )
    done = {(line["family"], line["seed"]) for line in known}
    firsts = [int(first) for first in arguments.first.split(",")]
    todo = [(name, first + k) for k in range(arguments.number) for first in firsts for name in families]
    if arguments.again:
        todo = [(line["family"], line["seed"]) for line in known if line["wrong"] and line["family"] in families]
        done = set()
    for name, seed in todo:
        if (name, seed) in done:
            continue
        if time.monotonic() > until:
            return
        try:
            verdict = attacked(name, seed, arguments.effort)
        except ValueError as error:
            # the plain model has no cycle of such a load
            print(name, seed, f"is not drawn: {error}", sep=" | ", flush=True)
            continue
        with arguments.log.open("a", encoding="utf-8") as out:
            out.write(json.dumps({**verdict.line, "commit": at}) + "\n")
        if verdict.wrong:
            print(name, seed, verdict.status, *verdict.wrong, sep=" | ", flush=True)


def summary(lines: list[Table]) -> str:
    """Tell how many problems there are, what of them is false, and of how many nothing is known."""
    solved = [line for line in lines if line["kind"]]
    blank = [line for line in solved if line["kind"] == "local" and not line.get("bound", 1.0) > 0.0]
    text = [f"{len(lines)} problems, {sum(bool(line['wrong']) for line in lines)} with a false claim or a defect"]
    text += [f"  {line['family']} {line['seed']}: {'; '.join(line['wrong'])}" for line in lines if line["wrong"]]
    text.append(f"{len(blank)} of {len(solved)} designs are local with bound 0")
    for family in dict.fromkeys(line["family"] for line in lines):
        of_family = [line for line in lines if line["family"] == family]
        kinds = Counter(line["kind"] or line["status"] for line in of_family)
        share = sum(line in blank for line in of_family)
        text.append(f"  {family}: {dict(kinds)}, bound 0: {share}, {sum(line['seconds'] for line in of_family):.0f} s")
    return "\n".join(text)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run")
    running.add_argument("families", help="comma-separated, or all, crossings, alone")
    running.add_argument("--from", dest="first", default="0,100000,200000", help="first seeds, comma-separated")
    running.add_argument("--number", type=int, default=2000, help="of each kind from each first seed")
    running.add_argument("--log", type=Path, default=PAGE.with_name("run.jsonl"))
    running.add_argument("--seconds", type=float, default=1e9)
    running.add_argument("--again", action="store_true", help="what the log has as wrong, once more")
    running.add_argument("--effort", type=int, default=EFFORT)
    show = commands.add_parser("show", help="the problem file of a family and a seed")
    show.add_argument("families")
    show.add_argument("--from", dest="first", type=int, default=0)
    summed = commands.add_parser("sum", help="what logs say, in short")
    summed.add_argument("logs", nargs="+", type=Path)
    paged = commands.add_parser("page", help="write results/attack/README.md from logs")
    paged.add_argument("logs", nargs="+", type=Path)
    arguments = parser.parse_args()
    if arguments.command == "page":
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        PAGE.write_text(page(arguments.logs, NAMES), encoding="utf-8")
        return
    if arguments.command == "sum":
        print(summary(lines_of(arguments.logs)))
        return
    if arguments.command == "show":
        print(toml(drawn(arguments.families, arguments.first)[0]))
        return
    run(arguments)


if __name__ == "__main__":
    main()
