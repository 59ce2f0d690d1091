"""Delay from an input event of the served page to the frame with the new optimum, drawn by headless Chromium.

Writes results/benchmarks/served-page.md.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pages import PAGES, ROOT, publish, skip

from browser.chromium import MISSING, executable, launched, watched

OUT = PAGES / "served-page.md"
MOVES, SPACING, PATIENCE = 60, 120, 120_000
"""Input events, milliseconds between them, and for a whole solve."""
SCENES = (
    ("tractor-four-lanchester", "constraints.1.max", "limit of balancer mass"),
    ("locomotive-two-cylinder", "constraints.1.max", "limit of the surging force"),
    ("tractor-four-bearings", "constraints.1.max", "limit of counterweight mass"),
    ("tractor-four-lanchester", "engine.rod_ratio", "rod ratio: loads anew"),
    ("vee-six-90", "operating_points.1.mean_piston_speed", "engine speed: loads anew"),
)
SLIDE = """async ({ control, moves, spacing }) => {
    const range = document.querySelector(`[data-control="${control}"]`);
    const low = Number(range.min), wide = Number(range.max) - low;
    for (let k = 0; k < moves; k++) {
        range.value = low + wide * (0.05 + 0.45 * Math.abs(Math.sin(0.05 * k)));
        range.dispatchEvent(new Event("input", { bubbles: true }));
        await new Promise(done => setTimeout(done, spacing));
    }
    return laufruhePage.latencies.splice(0);
}"""
RUN = "from laufruhe.cli import main; main()"
PAGE = """# Served page: from a slider to the optimum that follows

Headless Chromium {chromium} without a graphics card. Milliseconds by the clock from the input event to the end of the
frame that shows the answer, the wait for the next frame of the screen included, {moves} events each.

| problem | slider | least | median | 95 % | to the answer, median | processor time of the server, median |
| --- | --- | ---: | ---: | ---: | ---: | ---: |
{rows}

While a limit slides all pictures follow in that frame; where loads are others they are made anew, and drawn when
the slider rests if that takes long. Processor time of the server is that of one cone program at 48 angles, its
bound, and the reading of the changed problem, whatever else runs on the machine.
"""


def measured(name: str, control: str, folder: Path) -> np.ndarray:
    """Return the milliseconds to the frame, to the answer, and of the server's processor, shape (events, 3)."""
    path = folder / f"{name}.toml"
    path.write_bytes((ROOT / "problems" / path.name).read_bytes())
    words = [sys.executable, "-c", RUN, "page", str(path), "--no-browser"]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    address = server.stdout.readline().partition(": ")[2].strip()
    try:
        with launched() as browser, watched(browser, viewport={"width": 1400, "height": 1000}) as seen:
            page = seen.page
            page.goto(address)
            page.locator('#claim[data-last="true"]').wait_for(timeout=PATIENCE)
            arguments = {"control": control, "moves": MOVES, "spacing": SPACING}
            page.evaluate(SLIDE, {**arguments, "moves": 10})
            times = page.evaluate(SLIDE, arguments)
            assert not seen.refused
    finally:
        server.terminate()
        server.wait()
    return np.array(times)


def chromium_version() -> str:
    """Return the version that Chromium prints."""
    with launched() as browser:
        return browser.version


def main() -> None:
    """Measure all scenes in turn, and write the page."""
    if executable() is None:
        skip(MISSING)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, control, words in SCENES:
            drawn, answered, spent = measured(name, control, Path(folder)).T
            numbers = (drawn.min(), np.median(drawn), np.quantile(drawn, 0.95), np.median(answered), np.median(spent))
            rows.append(f"| {name} | {words} | " + " | ".join(f"{number:.0f}" for number in numbers) + " |")
    text = PAGE.format(chromium=chromium_version(), moves=MOVES, rows="\n".join(rows))
    publish(OUT, text)


if __name__ == "__main__":
    main()
