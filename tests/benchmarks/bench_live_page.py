"""A frame of the live page, and what an update takes beside a dashboard framework, in one run.

Writes results/benchmarks/live-page.md. `--dash PYTHON` or LAUFRUHE_DASH names a Python that has Dash (`pip install
dash` in an environment of its own); without it those rows are left out, and said to be.
"""

from __future__ import annotations

import argparse
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from live_in_dash import __file__ as IN_DASH
from pages import PAGES, ROOT, publish, skip
from playwright.sync_api import CDPSession, Page

from browser.chromium import MISSING, executable, launched, watched
from laufruhe import load, solve
from laufruhe.extensions.served_page.live.section import sliders
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.report.result_report import result_document
from laufruhe.report.web_page import as_html

OUT = PAGES / "live-page.md"
FRAME = 16.0
"""Time of one of 60 pictures a second [ms]."""
MOVES, UPDATES = 240, 40
FOUR = ROOT / "problems" / "tractor-four-lanchester.toml"
TWELVE = ROOT / "problems" / "inline-twelve.toml"
SECOND_POINT = '[[operating_points]]\nname = "idle"\nspeed = "700 rpm"\n\n'
# a slider goes to and fro, a step a frame; what a frame takes is the script, style, layout and paint list of it
DRAG = """async count => {
    const page = await laufruheLive.page, range = document.querySelectorAll("input[data-decision]")[SLIDER];
    const low = Number(range.min), wide = Number(range.max) - low, work = [];
    document.getElementById("live").scrollIntoView();
    for (let k = 0; k < count; k++) {
        await new Promise(requestAnimationFrame);
        const began = performance.now();
        range.value = low + wide * Math.abs(Math.sin(0.05 * k));
        range.dispatchEvent(new Event("input", { bubbles: true }));
        // what it would draw at the next frame is drawn in this one
        cancelAnimationFrame(page.frame);
        page.frame = 0;
        page.drawNow();
        document.body.getBoundingClientRect();
        work.push(performance.now() - began);
    }
    return work;
}"""
# from the event to the end of the frame that shows it
UPDATE = """async ({ selector, told, share }) => {
    const range = document.querySelectorAll(selector)[SLIDER], shown = document.querySelector(told);
    const low = Number(range.min), wide = Number(range.max) - low;
    const changed = new Promise(done => {
        const seen = new MutationObserver(() => { seen.disconnect(); done(); });
        seen.observe(shown, { childList: true, characterData: true, subtree: true });
    });
    const graphs = [...document.querySelectorAll(".js-plotly-plot")];
    const plotted = Promise.all(graphs.map(graph => new Promise(done => graph.once("plotly_afterplot", done))));
    const began = performance.now();
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(range, low + wide * share);
    range.dispatchEvent(new Event("input", { bubbles: true }));
    await changed;
    await plotted;
    await new Promise(requestAnimationFrame);
    await new Promise(done => {
        const channel = new MessageChannel();
        channel.port1.onmessage = done;
        channel.port2.postMessage(0);
    });
    return performance.now() - began;
}"""


def twelve() -> Problem:
    """Return twelve cylinders at two operating points with two counterweights, angles open."""
    text = TWELVE.read_text(encoding="utf-8")
    return load(text.replace("[gas]", SECOND_POINT + "[gas]", 1))


def report(problem: Problem, folder: Path) -> Path:
    """Return the HTML report of the solved problem, without pictures."""
    result = solve(problem)
    path = folder / f"{problem.name}.html"
    page = as_html(result_document(result, [], "laufruhe"), {}, sliders(result))
    path.write_text(page, encoding="utf-8")
    return path


def frames(page: Page, path: Path) -> tuple[list[float], float]:
    """Return milliseconds of work in every frame of a drag, and processor time of the page's thread for one of them."""
    page.goto(path.as_uri())
    page.locator("[data-decision]").first.wait_for()
    script = DRAG.replace("SLIDER", "0")
    page.evaluate(script, 30)
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    before = spent_by(session)
    intervals = page.evaluate(script, MOVES)
    return intervals, 1e3 * (spent_by(session) - before) / MOVES


def spent_by(session: CDPSession) -> float:
    """Return the processor time of all tasks of the page's thread until now: script, style, layout, painting [s]."""
    metrics = {metric["name"]: metric["value"] for metric in session.send("Performance.getMetrics")["metrics"]}
    return float(metrics["TaskDuration"])


def updates(page: Page, selector: str, name: str) -> list[float]:
    """Return the milliseconds from an input event to the end of the frame that shows it."""
    script, times = UPDATE.replace("SLIDER", "0"), []
    for k in range(UPDATES + 5):
        times.append(
            page.evaluate(script, {"selector": selector, "told": name, "share": 0.1 + 0.8 * (0.618 * k % 1.0)})
        )
    return times[5:]


def loads(problem: Problem, path: Path) -> None:
    """Write the forces on the mounts, affine in all open numbers, for a page of another framework."""

    def at(x: np.ndarray) -> np.ndarray:
        widths = [decision.set.width for decision in problem.decisions]
        ends = np.cumsum(widths)
        values = [complex(*x[end - width : end]) for end, width in zip(ends, widths, strict=True)]
        design_loads = evaluate(problem, problem.design(values)).loads
        return np.stack(
            [one.mount_forces.sample(720)[:, :, 1:] for one in design_loads if one.mount_forces is not None]
        )

    count = sum(decision.set.width for decision in problem.decisions)
    fixed = at(np.zeros(count))
    columns = np.stack([at(0.01 * row) - fixed for row in np.eye(count)]) / 0.01
    np.savez(path, fixed=fixed, columns=columns, start=np.full(count, 0.01))


def in_dash(python: str, problem: Problem, page: Page, folder: Path) -> list[float]:
    """Return the milliseconds of the same loads on a page of Dash."""
    loads(problem, folder / "loads.npz")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(
        [python, IN_DASH, folder / "loads.npz", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(100):
            time.sleep(0.1)
            with socket.socket() as listener:
                if listener.connect_ex(("127.0.0.1", port)) == 0:
                    break
        page.goto(f"http://127.0.0.1:{port}/")
        page.locator(".js-plotly-plot").nth(2).wait_for()
        page.wait_for_timeout(1000)
        return updates(page, "input[type=range]", "#value")
    finally:
        server.kill()
        server.wait()


def _row(name: str, times: list[float]) -> str:
    steps = statistics.quantiles(times, n=20)
    return f"| {name} | {min(times):.1f} | {statistics.median(times):.1f} | {steps[-1]:.1f} |"


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--dash", default=os.environ.get("LAUFRUHE_DASH", ""), help="a Python that has Dash")
    python = parser.parse_args().dash
    if executable() is None:
        skip(MISSING)
    scenes: dict[str, Callable[[], Problem]] = {
        "ready four-cylinder, four mounts, one point": lambda: load(FOUR),
        "twelve cylinders, four mounts, two points": twelve,
    }
    drags, rows = [], []
    with tempfile.TemporaryDirectory() as name, launched() as browser, watched(browser) as seen:
        page, folder, version = seen.page, Path(name), browser.version
        for scene, make in scenes.items():
            problem = make()
            work, processor = frames(page, report(problem, folder))
            drags.append(f"{_row(scene, work)} {processor:.1f} |")
            rows.append(_row(f"live page, {scene}", updates(page, "[data-decision]", "[data-measure=objective]")))
            if python:
                rows.append(_row(f"Dash, {scene}", in_dash(python, problem, page, folder)))
        assert seen.refused == []
    publish(OUT, TEXT.format(
        drags="\n".join(drags), rows="\n".join(rows), moves=MOVES, updates=UPDATES, frame=FRAME,
        chromium=version,
        left="" if python else WITHOUT,
    ))  # fmt: skip


WITHOUT = "Dash was not at hand: `--dash PYTHON`, or LAUFRUHE_DASH, names a Python that has it.\n\n"
TEXT = """# Live page: what a frame takes

Headless Chromium {chromium} without a graphics card. Milliseconds by the clock but for the last column of the first
table.

## A frame while a slider is dragged

All numbers, polar diagrams, force over angle, bars, orders and limits anew, with style and layout, in each of {moves}
frames. A screen with 60 pictures a second leaves {frame:.0f} ms.

| | least | median | 95 % | processor time |
| --- | ---: | ---: | ---: | ---: |
{drags}

Processor time is that of the page's thread with painting, whatever else runs on the machine.

## From the input event to the end of the frame that shows it

{updates} updates each, the wait for the next frames of the screen included. The page of Dash shows the same loads in
three pictures, computed by NumPy in its server on the loopback.

{left}| | least | median | 95 % |
| --- | ---: | ---: | ---: |
{rows}
"""


if __name__ == "__main__":
    sys.exit(main())
