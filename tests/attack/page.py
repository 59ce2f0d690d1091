"""The page that says what was attacked, with what figures, and what an attack of this kind cannot see."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from attack.crossings import CROSSINGS

TARGET = 2000
SEEDS = 3
"""Least number of problems of every family, and of the first seeds among them."""
VARIED = 30
"""Least number of each variation of a kind."""

FAMILIES = {
    "rigid mounts": (
        "inline",
        "vee",
        "boxer",
        "opposed-piston",
        "radial",
        "parts",
        "points",
        "gas",
        "places",
        "worst means",
        "root mean quads",
    ),
    "crank stars": ("stars",),
    "staggered and split vees": ("open-vees",),
    "uneven throws": ("uneven", "uneven crankcase"),
    "elastic mounts, one to four numbers open": ("elastic-few", "elastic-many"),
    "convex mounts": ("convex-mounts", "elastic-balance"),
    "mounts and unbalances together": ("joint",),
    "any number of elastic mounts": ("any mounts", "run-ups"),
    "crank-rockers and rhombic drives": ("crank-rockers", "rhombic drives", "driven mounts", "driven run-ups"),
    "ranges of speed": ("speed ranges", "speed ranges crossed"),
    "electric machines": ("electric machines",),
    "receivers": ("receivers",),
    "motion of pistons": ("piston motion",),
    "patterns of firings": ("skip fire",),
    "sizes of the running gear with unbalances": ("sizes",),
    "two kinds together": tuple(CROSSINGS),
}
"""A family is of one method of proof; its kinds differ in what is drawn."""

HEAD = """# Random problems against an independent model

Written by `python tests/attack/run_attack.py page`, from the logs of `make attack`. Nothing here is edited by hand.

A seed makes a problem of a family: sizes, speeds, mounts, what is open, asked and limited. The package solves it. A
plain model under `tests/attack` reads the same file and shares no code with the package: positions of masses,
momentum and energy differentiated by transforms, least energy of springs, six motions of a block, a gas cycle found
by trying. It evaluates the design that was returned and looks for a better one: cutting planes of linear programs
where unbalances alone are open (a bound of its own), every even star one by one, else random designs, evolution and a
simplex. **Wrong** is: a value or a limit's value off by more than the stated error and what the plain model resolves;
a design below a bound by more than the stated error of the samples; a `global` value above a rival by more than that
and the gap; "infeasible" where a rival keeps all
limits with 2e-5 to spare; a limit passed by more than 3e-5; a result worse than the design as given; `failed`, an
error, a warning, or anything on the screen. **Beaten**: a `local` design that a rival beats by more than 1e-3; it
claims nothing else, and is not counted as wrong.

Of elastic mounts an **own model** judges as well: written again from the equations, many designs at once, means and
root mean squares to 1e-9 of the package's. Evolution, sequential quadratic programs and simplexes look at some
thousands of its designs. It alone judges *any mounts* (places, angles, dampers, loss, mirrored and joined springs,
fluid tracks, load cases on bump stops, decoupling, windows of frequencies) and *run-ups*.

*Crank-rockers* and *rhombic drives* take the place of the slider-cranks of any other family; a problem that cannot be
stated with them must be refused in one line, and counts as *refused*. A *range of speed* is judged by a program of our
own at some of its speeds and by values at many, with the peaks between them. *Patterns of firings* are all words of
their length, one by one, as pulses of torque added over time.

- *Prices* lie between the gain of a limit loosened by 1 % and the loss of one tightened by 1 %.
- *Monotony*: a limit loosened by 5 %, or one weight more, is not worse.
- *Invariance*: parts in another order, front and back swapped, units of mass from 1e-6 to 1e6 and of length and time
  from 1e-2 to 1e2 keep value and kind of proof.
"""

FOOT = """
## What this attack cannot see

- What the plain model shares with the documentation: both take its conventions, so a wrong convention is right to both.
- Where a problem is not convex, that a rival was not found proves nothing: some 600 to 1,000 designs are looked at, few
  for more than four numbers.
- Stars are enumerated up to 60; firing orders, optional shafts and uneven intervals of open throws are not drawn.
- Gas is the mixed cycle alone. The plain model resolves 4096 steps of a cycle, 32768 where gas is complained of: peaks
  to 1e-5, with gas to 1e-4, of rotors with gas to 2e-4.
- Of elastic mounts, bump stops in run-ups, measured stiffness, mounts that are `like` others and open crank stars are
  not drawn. Run-ups are read at steps, to 1e-3.
- Sizes are those of one car or tractor engine before rescaling: no twenty cylinders, no hundred mounts.
- Errors that need two problems in one process, damaged files, memory and time limits have tests of their own.
"""


def entries_of(logs: Iterable[Path]) -> list[dict[str, Any]]:
    """Return all complete lines of the logs."""
    texts = [text for log in logs for text in log.read_text(encoding="utf-8").splitlines()]
    return [json.loads(text) for text in texts if text.endswith("}")]


def lines_of(logs: Iterable[Path]) -> list[dict[str, Any]]:
    """Return the last entry of each problem of the logs."""
    latest = {(line["family"], line["seed"]): line for line in entries_of(logs)}
    return list(latest.values())


def mended(logs: Iterable[Path]) -> list[dict[str, Any]]:
    """Return the entries with something wrong of problems that had nothing wrong when they were run last."""
    entries = entries_of(logs)
    last = {(line["family"], line["seed"]): line for line in entries}
    return [line for line in entries if line["wrong"] and not last[line["family"], line["seed"]]["wrong"]]


def table_of(lines: list[dict[str, Any]]) -> list[str]:
    """Return a table row for each problem with a fault."""
    if not lines:
        return ["Nothing."]
    faults = [re.sub(r"\S*/attack-\w+/", "", "; ".join(line["wrong"]))[:300] for line in lines]
    rows = [f"| {line['family']} | {line['seed']} | {text} |" for line, text in zip(lines, faults, strict=True)]
    return ["| family | seed | what |", "| --- | ---: | --- |", *rows]


def row(name: str, lines: list[dict[str, Any]]) -> str:
    """Return the row of one family, or of one variation."""
    status = Counter(line["kind"] or line["status"] for line in lines)
    text = ", ".join(f"{count} {kind}" for kind, count in status.most_common())
    wrong = sum(bool(line["wrong"]) for line in lines)
    beaten = sum(line["beaten"] > 1e-3 for line in lines)
    noted = sum(bool(line.get("notes")) for line in lines)
    seconds = sum(line["seconds"] for line in lines) / len(lines)
    extra = f"{beaten} beaten" if beaten else ""
    extra += f"{noted} noted" if noted else ""
    return f"| {name} | {len(lines)} | {text} | {wrong} | {extra} | {seconds:.1f} |"


def family_row(family: str, lines: list[dict[str, Any]]) -> str:
    """Return the row of a group of families."""
    firsts = ", ".join(str(sum(line["seed"] // 100000 == k for line in lines)) for k in range(SEEDS))
    wrong = sum(bool(line["wrong"]) for line in lines)
    return f"| {family} | {len(lines)} | {firsts} | {max(0, TARGET - len(lines))} | {wrong} |"


def page(logs: list[Path], names: list[str]) -> str:
    """Return the figures by family, what was wrong, and what cannot be seen."""
    lines = lines_of(logs)
    by_kind = {name: [line for line in lines if line["family"] == name] for name in names}
    every = [line for group in by_kind.values() for line in group]
    wrong = [line for line in every if line["wrong"]]
    rows = [row(name, group) for name, group in by_kind.items() if group]
    missing = [name for name, group in by_kind.items() if not group]
    commits = Counter(line.get("commit", "") for line in every)
    rivals = sum(line["rivals"] for line in every)
    parts = [
        HEAD,
        "## What was run\n",
        f"{len(every)} problems, {rivals} rival designs or stars; {len(wrong)} problems with something wrong. "
        f"Meant are {TARGET} problems of every family, drawn from {SEEDS} first seeds (0, 100000, 200000), and "
        f"{VARIED} of every variation; *short* is what is left of that.\n",
        f"Commits: {', '.join(f'{name} ({count})' for name, count in commits.most_common())}. "
        "A problem that was run again counts by its last run.\n",
        "| family | problems | from each first seed | short | wrong |",
        "| --- | ---: | --- | ---: | ---: |",
        *(family_row(family, [line for kind in kinds for line in by_kind[kind]]) for family, kinds in FAMILIES.items()),
        "",
        "| kind | problems | ended as | wrong | beside | mean time of a solve [s] |",
        "| --- | ---: | --- | ---: | --- | ---: |",
        *rows,
    ]
    if missing:
        parts += ["", f"Not run at all: {', '.join(missing)}."]
    parts += ["", "## What was wrong\n", *table_of(wrong)]
    parts += ["", "## What was wrong before, and is not at the last run\n"]
    parts += ["The package, the plain model or the rule of what counts as wrong was mended in between.\n"]
    parts += table_of([line for line in mended(logs) if line["family"] in names])
    parts += ["", "`python tests/attack/run_attack.py show FAMILY --from SEED` prints a problem's file.", FOOT]
    return "\n".join(parts)
