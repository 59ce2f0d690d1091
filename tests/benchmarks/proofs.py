"""Proofs of all ready problems: value, bound, gap, kind, and the processor time of the solution.

Writes results/proofs/README.md, beside the answers of an earlier version (results/proofs/<version>.csv);
`--keep VERSION` writes such a table of the package that is imported. `--only NAME` takes some alone.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, fields
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "results" / "proofs"
BEFORE = "v0.2.0"
# a problem may take so long [s]
LONGEST = 3600.0
KINDS = {"global": 0, "global within gap": 1, "local": 2, "none": 3}


@dataclass(frozen=True)
class Answer:
    """Answer of one version to one problem; processor seconds of one process."""

    name: str
    status: str
    value: float
    unit: str
    bound: float
    gap: float
    kind: str
    seconds: float


def answered(path: Path) -> Answer:
    """Return the answer of this process on one processor."""
    # libraries are loaded before the clock starts, so that versions are compared and not imports
    for library in ("casadi", "clarabel", "cvxpy"):
        import_module(library)
    from laufruhe import load, solve

    problem = load(path)
    began = time.process_time()
    result = solve(problem)
    seconds = time.process_time() - began
    proof, objective = result.certificate, result.objective
    value, unit = (objective.value, objective.unit) if objective is not None else (math.nan, "")
    proof_cells = (proof.lower_bound, proof.gap, str(proof.kind)) if proof is not None else (math.nan, math.nan, "")
    return Answer(path.stem, str(result.status), value, unit, *proof_cells, seconds)


def answer_of(path: Path) -> Answer:
    """Return the answer of a new process that starts no others."""
    if hasattr(os, "sched_getaffinity"):
        one = {max(os.sched_getaffinity(0))}
        pinned = f"import os; os.sched_setaffinity(0, {one}); "
    else:
        pinned = ""
    script = f"{pinned}import runpy, sys; sys.argv = {[__file__, '--solve', str(path)]!r}; "
    script += f"runpy.run_path({__file__!r}, run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=LONGEST)
    if done.returncode:
        return Answer(path.stem, "error", math.nan, "", math.nan, math.nan, done.stderr.strip().splitlines()[-1], 0.0)
    return Answer(**json.loads(done.stdout.splitlines()[-1]))


def ready() -> list[Path]:
    """Return the ready problems without files of studies."""
    import tomllib

    paths = sorted((ROOT / "problems").glob("*.toml"))
    return [path for path in paths if "study" not in tomllib.loads(path.read_text(encoding="utf-8"))]


def saved_answers(path: Path) -> dict[str, Answer]:
    """Return a table of an earlier version."""
    if not path.exists():
        return {}
    types = {field.name: field.type for field in fields(Answer)}
    with path.open(encoding="utf-8", newline="") as file:
        rows = [{k: float(v) if types[k] == "float" else v for k, v in row.items()} for row in csv.DictReader(file)]
    return {str(row["name"]): Answer(**row) for row in rows}  # type: ignore[arg-type]


def write(path: Path, answers: list[Answer]) -> None:
    """Write the answers as a CSV table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Answer)], lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: f"{v:.10g}" if isinstance(v, float) else v for k, v in asdict(a).items()} for a in answers)


def page(answers: list[Answer], before: dict[str, Answer]) -> str:
    """Return the page: proofs of all problems, now and before."""
    proven = [a for a in answers if a.kind]
    counts = {kind: sum(a.kind == kind for a in proven) for kind in KINDS}
    both = [(before[a.name], a) for a in proven if a.name in before and before[a.name].kind]
    now, then = sum(a.seconds for _, a in both), sum(b.seconds for b, _ in both)
    counted_kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    lines = [
        "# What is proven of the ready problems",
        "",
        f"Of {len(answers)} problems {len(proven)} have something open that has a proof: "
        f"{counted_kinds}. `global` says that no",
        "design is better by more than the tolerance that the problem asks for (a thousandth unless it says so),",
        "`global within gap` that none is better by more than the gap, `local` that the bound is far from the value.",
        "Values and bounds in SI; processor seconds of one process, libraries loaded before, beside those of",
        f"{BEFORE}, which were measured earlier and on a machine that may be another:",
        f"{now:.0f} s in all against {then:.0f} s. Made by `make proofs`.",
        "",
        f"| problem | value | bound | gap | kind | s | bound of {BEFORE} | gap | s |",
        "| --- | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: |",
    ]
    for a in proven:
        b = before.get(a.name)
        earlier = f"{number(b.bound)} | {share(b.gap)} | {b.seconds:.2f}" if b is not None and b.kind else "- | - | -"
        cells = f"{number(a.value)} {a.unit} | {number(a.bound)} | {share(a.gap)} | {a.kind} | {a.seconds:.2f}"
        lines.append(f"| {a.name} | {cells} | {earlier} |")
    rest = ", ".join(a.name for a in answers if not a.kind)
    return "\n".join([*lines, "", f"Without a proof, for nothing is open or nothing is minimised: {rest}.", ""])


def number(value: float) -> str:
    """Return a number with six digits."""
    return f"{value:.6g}" if math.isfinite(value) else "-"


def share(gap: float) -> str:
    """Return a gap as a share of the value."""
    return f"{gap:.1e}" if math.isfinite(gap) else "-"


def main() -> None:
    """Solve one after the other, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solve", type=Path)
    parser.add_argument("--keep")
    parser.add_argument("--only", nargs="*", default=[])
    arguments = parser.parse_args()
    if arguments.solve is not None:
        print(json.dumps(asdict(answered(arguments.solve))))
        return
    path = FOLDER / f"{arguments.keep or 'now'}.csv"
    known = saved_answers(path) if arguments.only else {}
    for problem in ready():
        if not arguments.only or problem.stem in arguments.only:
            known[problem.stem] = answer_of(problem)
            print(known[problem.stem], flush=True)
            write(path, sorted(known.values(), key=lambda a: a.name))
    if arguments.keep is None:
        text = page(sorted(known.values(), key=lambda a: a.name), saved_answers(FOLDER / f"{BEFORE}.csv"))
        (FOLDER / "README.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
