"""Pictures that README.md and docs/ show, as the commands draw them. Writes docs/pictures.

`--live` draws the moving picture of the live page alone; it needs Chromium, and is left out where there is none.
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pages import ROOT
from PIL import Image
from playwright.sync_api import Page

from browser import chromium

PICTURES = ROOT / "docs" / "pictures"
COLOURS = 64
LIVE, STEPS = "tractor-four-lanchester.toml", 12
VIEW = {"viewport": {"width": 1280, "height": 900}, "device_scale_factor": 0.7}
# arguments of the command; picture that it draws; name under docs/pictures
CHOSEN_PICTURES = {
    ("solve", "tractor-four-lanchester"): {"bars": "tractor-four-lanchester-bars"},
    ("balance", "vee-eight-balance-job"): {"planes": "balance-job"},
    ("solve", "tractor-seat"): {"receivers": "tractor-seat-receivers"},
    ("solve", "tractor-seat-speeds"): {"speed_ranges": "tractor-seat-speeds"},
    ("study", "tractor-study"): {name: f"tractor-study-{name}" for name in ("fig-10", "fig-22", "reciprocating-mass")},
    ("study", "torsion-pareto"): {"firing-order": "torsion-pareto"},
    ("study", "bearing-pareto"): {"mount-force": "bearing-pareto"},
    ("solve", "single-crank-weight"): {"bodies": "single-crank-weight-bodies"},
    ("trade", "tractor-four-lanchester"): {"tractor-four-lanchester": "tractor-four-lanchester-trade"},
}


def shrunk(source: Path, target: Path) -> None:
    """Reduce a picture to few colours, a third of the bytes."""
    with Image.open(source) as picture:
        picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)


def live_page() -> None:
    """Draw the live page of the ready four moved by hand, shaft by shaft from the initial to the final design."""
    with tempfile.TemporaryDirectory() as folder:
        words = [
            sys.executable,
            "-m",
            "laufruhe",
            "solve",
            "-q",
            ROOT / "problems" / LIVE,
            "--no-plots",
            "--out",
            folder,
        ]
        subprocess.run(words, check=True)
        with chromium.launched() as browser, chromium.watched(browser, **VIEW) as seen:
            page = seen.page
            page.goto((Path(folder) / "report.html").as_uri())
            page.locator("[data-decision]").first.wait_for()
            page.locator("#live").evaluate("live => live.scrollIntoView()")
            pictures, times = zip(*_moves(page), strict=True)
    # one set of colours for all, or they would flicker
    some = Image.fromarray(np.concatenate([np.asarray(picture) for picture in pictures[:: len(pictures) // 4]]))
    colours = some.quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    frames = [picture.quantize(palette=colours, dither=Image.Dither.NONE) for picture in pictures]
    path = PICTURES / "live-page.gif"
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True)


def _moves(page: Page) -> Iterator[tuple[Image.Image, int]]:
    """Yield all frames, each with the time that it is shown [ms]."""
    best = page.evaluate("laufruheLive.page.then(page => page.design())")
    at = {**best, "left.unbalance": 0.0, "right.unbalance": 0.0}
    yield _screenshot(page, at, None), 1200
    for name in ("left.unbalance", "right.unbalance"):
        # too far, and back
        for share in (*np.linspace(0.0, 1.5, STEPS)[1:], *np.linspace(1.5, 1.0, STEPS // 2)[1:]):
            yield _screenshot(page, at | {name: share * best[name]}, name), 90
        at[name] = best[name]
    yield _screenshot(page, best, None), 2400


def _screenshot(page: Page, design: dict[str, float], name: str | None) -> Image.Image:
    """Return a picture of the page with a design, with the moved slider marked."""
    page.evaluate(
        """async ({ design, name }) => {
            const page = await laufruheLive.page;
            page.setDesign(design, { quiet: true });
            page.drawNow();
            document.activeElement.blur();
            const slider = document.querySelector(`[data-decision="${name}"]`);
            slider?.focus({ preventScroll: true, focusVisible: true });
        }""",
        {"design": design, "name": name},
    )
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def main() -> None:
    """Run the commands and keep what is shown."""
    PICTURES.mkdir(exist_ok=True)
    if chromium.executable():
        live_page()
    else:
        print(chromium.MISSING)
    if "--live" in sys.argv[1:]:
        return
    for (command, name), pictures in CHOSEN_PICTURES.items():
        with tempfile.TemporaryDirectory() as folder:
            problem = ROOT / "problems" / f"{name}.toml"
            subprocess.run(
                [sys.executable, "-m", "laufruhe", command, problem, "--out", folder, "--format", "png"],
                check=True,
            )
            for drawn, path in pictures.items():
                shrunk(Path(folder) / f"{drawn}.png", PICTURES / f"{path}.png")


if __name__ == "__main__":
    main()
