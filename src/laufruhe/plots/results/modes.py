"""Natural modes of a block on elastic mounts."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from laufruhe.physics.modes import MOTIONS
from laufruhe.plots.style import finish_page, page, series_of, styled
from laufruhe.plots.words import SMALL, ink_on
from laufruhe.present.mounting import facts_of, is_elastic, stiffness_sentence
from laufruhe.present.numbers import number
from laufruhe.solvers.result import Result

applies = is_elastic


@styled()
def figure(result: Result) -> Figure:
    """Draw the kinetic-energy share of every motion in every mode."""
    series = series_of(result)
    drawn = page(1, len(series), (3.5, 3.0), gap=1.0)
    for axes, item in zip(drawn.panels, series, strict=True):
        facts, shades = facts_of(item.design), colormaps["Blues"]
        energy = 100.0 * facts.modes.energy
        axes.imshow(np.clip(energy, 0.0, 100.0), cmap=shades, vmin=0.0, vmax=115.0, aspect="auto")
        for i, j in np.argwhere(np.abs(energy) >= 0.5):
            colour, words = ink_on(to_hex(shades(energy[i, j] / 115.0))), f"{energy[i, j]:.0f}".replace("-", "−")
            axes.text(j, i, words, ha="center", va="center", size=SMALL, color=colour)
        axes.set_xticks(range(6), [number(f, 3) for f in facts.modes.frequencies])
        for j, label in enumerate(axes.get_xticklabels()):
            label.set_fontweight("bold" if j in facts.excited else "normal")
        axes.set_yticks(range(6), MOTIONS)
        axes.set_xlabel("natural frequency [Hz]")
        axes.grid(visible=False)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_title(item.name, loc="left", size=10, pad=8, parse_math=False)
    lines = "Share of each motion in the kinetic energy of a mode [%]; a decoupled motion has 100. Bold: excited modes."
    lines += stiffness_sentence(facts_of(result.final))
    return finish_page(drawn, result, "Natural modes", lines, [])
