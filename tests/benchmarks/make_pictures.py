"""Pictures that README.md and docs/ show, as the commands draw them. Writes docs/pictures."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from pages import ROOT
from PIL import Image

PICTURES = ROOT / "docs" / "pictures"
COLOURS = 64
# arguments of the command; picture that it draws; name under docs/pictures
WANTED = {
    ("solve", "tractor-four-lanchester"): {"bars": "tractor-four-lanchester-bars"},
    ("study", "tractor-study"): {name: f"tractor-study-{name}" for name in ("fig-10", "fig-22", "reciprocating-mass")},
    ("study", "torsion-pareto"): {"firing-order": "torsion-pareto"},
    ("study", "bearing-pareto"): {"mount-force": "bearing-pareto"},
    ("trade", "tractor-four-lanchester"): {"tractor-four-lanchester": "tractor-four-lanchester-trade"},
}


def shrunk(source: Path, target: Path) -> None:
    """The picture in few colours, which is a third of the bytes."""
    with Image.open(source) as picture:
        picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)


def main() -> None:
    """Run the commands and keep what is shown."""
    PICTURES.mkdir(exist_ok=True)
    for (command, name), pictures in WANTED.items():
        with tempfile.TemporaryDirectory() as folder:
            problem = ROOT / "problems" / f"{name}.toml"
            subprocess.run([sys.executable, "-m", "laufruhe", command, problem, "--out", folder], check=True)
            for drawn, kept in pictures.items():
                shrunk(Path(folder) / f"{drawn}.png", PICTURES / f"{kept}.png")


if __name__ == "__main__":
    main()
