"""The study command: points, files, and what an interrupt leaves."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

from laufruhe.problem.study_reader import load_study
from laufruhe.report import files
from laufruhe.report.study_report import as_json, file_names, write_study
from laufruhe.studies import run
from laufruhe.studies.kept import NAME


def studied(path: Path, out: Path | None, say: Callable[[str], None]) -> tuple[str, str]:
    """Files of a study in their folder; what to say of them, and all parts as JSON."""
    study = load_study(path)
    folder = out if out is not None else Path("results") / path.stem
    kept = folder / NAME
    datasets, seconds = run(study, path.parent, kept, lambda done, whole: say(f"{done} of {whole} points"))
    with files.staged(folder, "--out" if out is not None else "results", file_names(study)) as stage:
        write_study(study, datasets, seconds, stage, shlex.join(["laufruhe", "study", str(path)]), say)
    kept.unlink(missing_ok=True)
    return f"done: {folder / files.REPORT}\n", as_json(study, datasets, seconds)
