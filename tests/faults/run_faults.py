"""Damaged files by command, in any number; writes the findings to results/faults/README.md.

python tests/faults/run_faults.py [FILES] [JOBS] [LOG]

What the log has is not run again.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import laufruhe.cli.solve
import laufruhe.cli.study
import laufruhe.extensions.fidelity.explanation  # noqa: F401
from faults import harness
from laufruhe.numerics.cores import processors

PAGE = Path(__file__).parents[2] / "results" / "faults" / "README.md"
LOG = PAGE.with_name("run.jsonl")
CHUNK = 1000
# `evaluate` and `explain` get one in so many of the files that `check` gets
SAMPLE = 50

ABOUT = f"""# Damaged files

`make faults` damages ready problems, studies and pressure traces, and gives each to a command, in process, with
an alarm. Damage is drawn from seeds (tests/faults/damage.py), so that a number below is a file: tables with one
to three keys removed, misspelt, doubled, swapped, nested, replaced by another type, unit, huge or tiny number,
NaN, text that commands a screen, or lists of thousands of entries; bytes cut, added, overwritten or shuffled;
brackets and dotted keys nested up to 2000 deep; cells of a trace that are no numbers.

A finding is: an exception that the command does not tell of; more than {harness.LONGEST:g} s of processor time;
an exit status other than 0, 1, 2 and 130; a complaint that does not begin with its file, or names neither key
nor place; a line of more than {harness.MOST_CHARACTERS} characters, more than {harness.MOST_LINES} lines; a
control character on the screen; a file beside the damaged one, or that one, changed; a process that dies or
takes more than {harness._MEMORY >> 30} GB.
"""
BLIND = """## What it cannot see

- Only `check`, `evaluate` and `explain` are run: what `solve`, `study` and `trade` make of a strange problem
  that can be read is not.
- A command that answers wrongly but properly is no finding; that is the business of the attack and of the tests
  of physics.
- Damage is drawn about ready files: a key that none of them has is hit by chance only.
- The caller's own environment (locale, full disk, permissions, other versions of libraries) is that of the run.
"""
FOUND = """## What earlier runs found

Each has a test in tests/faults since: recursion on deep tables, where a complaint quoted them; a field of a
trace beyond the limit of Python's reader; whole numbers that no float holds, in sweeps and elsewhere; names
that are no text in replications; control and bidirectional characters on the screen; lines of 5,000 characters
and thousands of lines; units of hundreds of factors, seconds each; a search of even stars for 24 to 48
cylinders that did not end; an empty list of orders; a matplotlibrc of the working folder; a stroke
of 1e-320 mm; a rod ratio that makes a rod longer than floats; an empty firing order; a tab in a title or a name;
keys that begin with a blank; `explain` of a flywheel.
"""


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else processors()
    log = Path(sys.argv[3]) if len(sys.argv) > 3 else LOG
    log.parent.mkdir(parents=True, exist_ok=True)
    tables = {"check": run("check", 0, count, jobs, log)}
    for k, verb in enumerate(("evaluate", "explain"), 1):
        tables[verb] = run(verb, k * 10**7, count // SAMPLE, jobs, log)
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    PAGE.write_text(page(tables), encoding="utf-8")
    wrong = [one for of in tables.values() for one in of if one.wrong]
    print(f"{len(wrong)} finding(s): {PAGE}")
    sys.exit(bool(wrong))


def run(verb: str, first: int, count: int, jobs: int, log: Path) -> list[harness.Found]:
    known = [harness.Found(**json.loads(line)) for line in log.read_text().splitlines()] if log.exists() else []
    found = [one for one in known if one.verb == verb and first <= one.seed < first + count]
    done = {one.seed for one in found}
    todo = [seed for seed in range(first, first + count) if seed not in done]
    with tempfile.TemporaryDirectory() as folder, log.open("a", encoding="utf-8") as out:
        for at in range(0, len(todo), CHUNK):
            new = harness.run(todo[at : at + CHUNK], verb, Path(folder), jobs)
            out.writelines(f"{json.dumps(asdict(one))}\n" for one in new)
            out.flush()
            found += new
            wrong = sum(bool(one.wrong) for one in found)
            print(f"{verb}: {len(found)} of {count}, {wrong} finding(s)", flush=True)
    return sorted(found, key=lambda one: one.seed)


def page(found: dict[str, list[harness.Found]]) -> str:
    rows = ["| command | of a | files | read | refused | infeasible or failed | findings | slowest |",
            "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |"]  # fmt: skip
    for verb, all_of in found.items():
        for kind in ("problem", "study", "trace"):
            own = [one for one in all_of if one.kind == kind]
            count = Counter(one.status for one in own)
            wrong, slowest = sum(bool(one.wrong) for one in own), max((one.seconds for one in own), default=0.0)
            rows.append(
                f"| `{verb}` | {kind} | {len(own)} | {count[0]} | {count[2]} | {count[1]} | {wrong} | {slowest:.1f} s |"
            )
    whole = sum(map(len, found.values()))
    wrong_ones = [one for of in found.values() for one in of if one.wrong]
    minutes = sum(one.seconds for of in found.values() for one in of) / 60.0
    text = f"{whole} files in {minutes:.0f} minutes of one processor: {len(wrong_ones)} finding(s)."
    listed = [f"- `{one.verb}`, seed {one.seed}: {one.wrong}" for one in wrong_ones[:50]]
    parts = [ABOUT, f"## Figures\n\n{text}", "\n".join(rows), "\n".join(listed), FOUND, BLIND]
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


if __name__ == "__main__":
    main()
