"""Commands of copies of the package, each in a process of its own that finds the libraries imported.

Reads a line of JSON from standard input for each copy: its folder, and the words of each command. Each command writes
`N.status`, `N.out` and `N.err` into the folder; a line on standard output follows the last one.
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import sys
from collections.abc import Callable
from pathlib import Path

LIBRARIES = (
    "casadi", "clarabel", "cvxpy", "jinja2", "matplotlib.pyplot", "numpy", "pandas", "PIL.Image", "pint",
    "pydantic", "rich.console", "scipy.integrate", "scipy.optimize", "scipy.signal", "scipy.sparse", "typer", "xarray",
    "xlsxwriter",
)  # fmt: skip


def forked(work: Callable[[], object]) -> int:
    """Return the exit status of work that a process of its own does."""
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            work()
            status = 0
        except BaseException:
            sys.excepthook(*sys.exc_info())
            sys.stderr.flush()
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def redirect(stream: int, file: Path) -> None:
    """Let a stream of this process write to a file."""
    os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT, 0o644), stream)


def run_copy(folder: Path, commands: list[list[str]]) -> None:
    """Import every module of a copy, except those of extensions without others that they need; run each command."""
    redirect(2, folder / "import.err")
    sys.path.insert(0, str(folder))
    import laufruhe
    from laufruhe.extension import extensions

    present = {one.name for one in extensions()}
    assert Path(laufruhe.__file__).parent == folder / "laufruhe"
    for module in pkgutil.walk_packages(laufruhe.__path__, "laufruhe."):
        _, room, own, *_ = [*module.name.split("."), "", ""]
        if module.name != "laufruhe.__main__" and (room != "extensions" or own in {"", *present}):
            importlib.import_module(module.name)
    for k, words in enumerate(commands):
        status = forked(lambda words=words, k=k: run_command(words, folder / str(k)))
        (folder / f"{k}.status").write_text(str(status), encoding="utf-8")


def run_command(words: list[str], target: Path) -> None:
    """Run a command of this copy, with its streams in files."""
    redirect(1, target.with_suffix(".out"))
    redirect(2, target.with_suffix(".err"))
    sys.argv = ["laufruhe", *words]
    importlib.import_module("laufruhe.cli").main()


if __name__ == "__main__":
    for library in LIBRARIES:
        importlib.import_module(library)
    assert "laufruhe" not in sys.modules
    for line in sys.stdin:
        copy = json.loads(line)
        forked(lambda copy=copy: run_copy(Path(copy["folder"]), copy["commands"]))
        print("done", flush=True)
