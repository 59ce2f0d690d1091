"""A command is interrupted whatever it is at, and says in one line how it ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import chdir
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli import scenes
from laufruhe.cli import app
from problem_files import written

PATIENT = "import laufruhe.cli.supervised as own; own.PATIENCE = {}\n"
STANDS = "import laufruhe.solvers as s; s.solve = lambda *_, **__: open('begun', 'w').close() or {}\n"
# counts on without ever looking at a signal, as a solver may; nobody is patient with it for as long as with users
DEAF = PATIENT.format(1) + STANDS.format("sum(range(10**14))")
# patience with a listener on a slow machine [s]
ASLEEP = PATIENT.format(300) + STANDS.format("__import__('time').sleep(1e4)")
RUN = "from laufruhe.cli import main; main()"
LONG = 300.0
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "fork"), reason="needs another process")]


def started(folder: Path, code: str) -> subprocess.Popen[str]:
    """Start a solve, and return it when it has reached its solver."""
    path = written(folder, scenes.TIGHT)
    words = [sys.executable, "-c", code + RUN, "solve", str(path), "--no-plots"]
    running = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (folder / "begun").exists() and running.poll() is None:
        time.sleep(0.02)
    (folder / "begun").unlink(missing_ok=True)
    return running


@pytest.mark.parametrize(
    ("code", "number", "message"),
    [(DEAF, signal.SIGTERM, "interrupted\n"), (ASLEEP, signal.SIGINT, "interrupted, nothing was written\n")],
)
def test_a_signal_ends_a_process_or_kills_it(code: str, number: signal.Signals, message: str, tmp_path: Path) -> None:
    """Check that a signal ends a process that counts for days, and one that sleeps for hours."""
    running = started(tmp_path, code)
    running.send_signal(number)
    out, err = running.communicate(timeout=LONG)
    assert (running.returncode, out, err) == (130, "", f"laufruhe: {message}")
    assert not list(tmp_path.glob("results/[!.]*"))
    with chdir(tmp_path):
        assert CliRunner().invoke(app, ["solve", "scene.toml", "--no-plots"]).exit_code == 0
    assert {entry.name for entry in (tmp_path / "results").iterdir()} == {"scene"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None)])
def test_a_signal_to_the_whole_group_is_an_interrupt(number: signal.Signals, tmp_path: Path) -> None:
    """Check that a signal to both processes, as from a closed terminal, is an interrupt."""
    running = started(tmp_path, "import os; os.setpgid(0, 0)\n" + ASLEEP)
    os.killpg(running.pid, number)
    out, err = running.communicate(timeout=LONG)
    assert (running.returncode, out, err) == (130, "", "laufruhe: interrupted, nothing was written\n")
    assert {entry.name for entry in tmp_path.rglob("*")} == {"scene.toml"}


# before anything is told to be loaded, while signals are held, before the command is known, while pydantic makes
# something else of it
EARLY = {
    "loading": """
import builtins
here = builtins.__import__
def stop(name, *rest):
    if name == "laufruhe.cli":
        raise KeyboardInterrupt
    return here(name, *rest)
builtins.__import__ = stop
""",
    "held": """
import os, signal, laufruhe.cli.supervised as own
own.end_with_parent = lambda _: os.kill(os.getpid(), signal.SIGINT)
""",
    "typed": """
import os, signal, typer.main
typer.main.get_command = lambda *_: os.kill(os.getpid(), signal.SIGINT)
""",
    "wrapped": """
import os, signal, laufruhe.files.reader
def load(*_):
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        raise RuntimeError("schema") from None
laufruhe.files.reader.load = load
""",
}


@pytest.mark.parametrize("code", EARLY.values(), ids=EARLY)
def test_an_interrupt_at_any_moment_is_one_line(code: str, tmp_path: Path) -> None:
    path = written(tmp_path, scenes.TIGHT)
    words = [sys.executable, "-c", code + "from laufruhe.__main__ import main; main()", "solve", str(path)]
    process = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=LONG, check=False)
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr == "laufruhe: interrupted, nothing was written\n"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("end", "said"), [("os.abort()", "signal 6"), ("(_ for _ in ()).throw(MemoryError())", "more memory")]
)
def test_a_sudden_end_is_reported(end: str, said: str, tmp_path: Path) -> None:
    running = started(tmp_path, f"import os; import laufruhe.solvers as s; s.solve = lambda *_, **__: {end}\n")
    out, err = running.communicate(timeout=LONG)
    assert running.returncode == 1
    assert out == ""
    assert said in err
    assert len(err.splitlines()) == 1


def test_a_killed_command_leaves_no_process(tmp_path: Path) -> None:
    running = started(tmp_path, DEAF)
    (child,) = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
    running.kill()
    running.communicate(timeout=LONG)
    for _ in range(1000):
        if not Path(f"/proc/{child}").exists():
            break
        time.sleep(0.1)
    assert not Path(f"/proc/{child}").exists() or "Z" in Path(f"/proc/{child}/stat").read_text()
