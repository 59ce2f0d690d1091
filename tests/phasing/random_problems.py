"""Random valid problems with open throws, firing orders, banks and shafts, as texts of problem files."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

CHANNELS = ("shaking force", "rocking couple", "roll moment", "mount force")
NORMS = ("rms", "mean", "maximum", "peak to peak")
RIGID, GIVEN, OPEN = "rigid mounts", "elastic mounts", "open elastic mounts"


class Writer:
    """A problem file that a generator of random numbers fills in."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.seed = seed
        self.mounts = (RIGID, RIGID, GIVEN, OPEN)[int(self.rng.integers(0, 4))]

    def pick(self, *values: Any) -> Any:
        return values[int(self.rng.integers(0, len(values)))]

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def number(self, low: float, high: float) -> float:
        return float(round(self.rng.uniform(low, high), 4))

    def text(self) -> str:
        gas = self.chance(0.4)
        engine = self._engine()
        parts = [f'title = "seed {self.seed}"\n[engine]\n{engine}', self._phasing()]
        if gas:
            parts.append(f'[gas]\nmodel = "seiliger"\npeak_pressure = "60 bar"\nimep = "{self.number(4, 9)} bar"')
        parts += [self._points(), self._mounting(), self._rotors(), self._objective()]
        return "\n".join(parts) + "\n"

    def _engine(self) -> str:
        layout = self.pick("inline", "inline", "vee", "vee", "boxer", "radial")
        cycle = self.pick("two-stroke", "four-stroke")
        turns = 2 if cycle == "four-stroke" else 1
        small = self.mounts == OPEN
        count = {
            "inline": int(self.rng.integers(2, 4 if small else 7)),
            "vee": 2 * int(self.rng.integers(1, 3 if small else 5)),
            "boxer": 2 * int(self.rng.integers(1, 4)),
            "radial": self.pick(3, 5, 7),
        }[layout]
        self.count, self.layout, self.even = count, layout, 360.0 * turns / count
        keys = [f'layout = "{layout}"', f'cycle = "{cycle}"', f"cylinders = {count}", 'bore = "80 mm"',
                'stroke = "90 mm"', f"rod_ratio = {self.number(0.2, 0.3)}", 'reciprocating_mass = "0.6 kg"',
                f'rotating_mass = "{self.pick(0.0, 0.4)} kg"']  # fmt: skip
        if layout != "radial":
            keys.append('cylinder_spacing = "100 mm"')
        if self.chance(0.2):
            keys.append('offset = "3 mm"')
        self.uneven = False
        if layout == "inline":
            keys += self._throws(count)
        elif layout == "vee":
            keys += self._throws(count // 2)
            step = 360.0 / (count // math.gcd(turns, count))
            bank = self.pick(45.0, 60.0, 90.0, 72.0)
            split = round((step * self.pick(0, 1, 2) - bank + 180.0) % 360.0 - 180.0, 6)
            kind = self.pick("fits", "fits", "bank", "split", "crooked")
            if kind == "bank" and self.open_throws:
                keys += ["bank_angle = { between = [30, 130] }", "split_pin_angle = 0"]
            elif kind == "split" and self.open_throws:
                keys += [f"bank_angle = {bank}", "split_pin_angle = { between = [-60, 60] }"]
            elif kind == "crooked" and self.uneven:
                keys += [f"bank_angle = {bank}"]
            else:
                keys += [f"bank_angle = {bank}", f"split_pin_angle = {split}"]
        if (layout == "vee" and self.chance(0.3)) or layout == "boxer":
            keys.append('bank_stagger = "25 mm"')
        if layout == "radial":
            keys.append('knuckle_radius = "40 mm"')
            keys.append('firing_order = "open"')
        return "\n".join(keys)

    def _throws(self, throws: int) -> list[str]:
        self.open_throws = self.chance(0.7)
        order = self.pick('firing_order = "open"', 'firing_order = "open"', "")
        if self.open_throws:
            self.uneven = self.chance(0.4)
            return ['throws = "open"', order]
        if self.chance(0.4):
            self.uneven = True
            pairs = [f"{{ between = [{low}, {low + 90}] }}" for low in (60 * k for k in range(1, throws))]
            return [f"throws = [0{''.join(', ' + pair for pair in pairs)}]", order]
        self.uneven = True
        angles = [0.0, *(self.number(5, 355) for _ in range(throws - 1))]
        return [f"throws = {angles}", 'firing_order = "open"']

    def _phasing(self) -> str:
        keys = [f"best = {self.pick(1, 3, 10)}"]
        if self.uneven:
            share = 0.98 if not self.open_throws else self.pick(0.05, 0.3, 0.9)
            keys.append(f'intervals = {{ largest_deviation = "{round(share * self.even, 3)} deg" }}')
        self.shafts = int(self.rng.integers(0, 3)) if self.chance(0.4) else 0
        self.optional = self.shafts > 0 and self.chance(0.6)
        if self.optional and self.chance(0.5):
            keys.append("most_shafts = 1")
        return "[phasing]\n" + "\n".join(keys)

    def _points(self) -> str:
        self.points = 2 if self.chance(0.3) else 1
        return "\n".join(
            f'[[operating_points]]\nname = "p{k}"\nspeed = "{self.number(900, 5000)} rpm"\n'
            f"weight = {self.number(0.5, 2)}"
            for k in range(self.points)
        )

    def _mounting(self) -> str:
        places = [("250 mm", "200 mm"), ("250 mm", "-200 mm"), ("-300 mm", "0 mm")]
        if self.mounts == RIGID:
            rows = ", ".join(f'["{x}", "{y}", "-50 mm"]' for x, y in places)
            return f"[mounts]\npositions = [{rows}]"
        out = ['[block]\nmass = "130 kg"\ninertia = ["4 kg m^2", "9 kg m^2", "8 kg m^2"]',
               '[mounts]\nkind = "elastic"\nloss_factor = 0.1', "[search]\nstarts = 2\nboxes = 200"]  # fmt: skip
        for k, (x, y) in enumerate(places):
            upright = '"250 N/mm"'
            if self.mounts == OPEN and k == 2:
                upright = '{ between = ["100 N/mm", "400 N/mm"] }'
            out.append(f'[[mounts.places]]\nname = "m{k}"\nposition = ["{x}", "{y}", "-50 mm"]\n'
                       f'stiffness = ["200 N/mm", "200 N/mm", {upright}]')  # fmt: skip
        return "\n".join(out)

    def _rotors(self) -> str:
        out = []
        if self.layout in ("inline", "vee", "boxer") and self.chance(0.25):
            out.append('[[counterweights]]\nname = "webs"\nbalance_factor = { between = [0, 1] }')
        for k in range(int(self.rng.integers(0, 3)) if self.chance(0.6) else 0):
            angle = self.pick("{ between = [0, 360] }", "{ between = [20, 150] }", "45")
            place = f'x = "{self.number(-250, 250)} mm"'
            if self.layout in ("inline", "vee") and self.chance(0.3):
                place, angle = "opposite_throw = 1", ""
            angle = angle and f"\nangle = {angle}"
            maximum = self.pick("0.001", "0.05", "0.3")
            out.append(f'[[counterweights]]\nname = "c{k}"\n{place}\nradius = "60 mm"\n'
                       f'unbalance = {{ between = ["0 kg m", "{maximum} kg m"] }}{angle}')  # fmt: skip
        for k in range(self.shafts):
            out.append(f'[[balancer_shafts]]\nname = "s{k}"\nratio = {self.pick(-1, 2, -2)}\n'
                       f'position = ["{self.number(-90, 90)} mm", "-80 mm"]\n'
                       + ('optional = true\nshaft_mass = "1 kg"\n' if self.optional else "")
                       + f'[[balancer_shafts.unbalances]]\nname = "w"\nx = "{self.number(-200, 200)} mm"\n'
                       'unbalance = { between = ["0 kg m", "0.05 kg m"] }\nangle = { between = [0, 360] }')  # fmt: skip
        return "\n".join(out)

    def _measure(self) -> str:
        return f"{self.pick(*NORMS)} {self.pick(*CHANNELS)}"

    def _objective(self) -> str:
        terms = []
        for _ in range(int(self.rng.integers(1, 3))):
            orders = self.pick("", "", "\norders = [1]", "\norders = [1, 2]", "\norders = [2]")
            at = '\noperating_points = ["p1"]' if self.points == 2 and self.chance(0.3) else ""
            terms.append(
                f'[[objective.terms]]\nquantity = "{self._measure()}"\nweight = {self.number(0.2, 3)}{orders}{at}'
            )
        out = ["[objective]", *terms]
        if self.chance(0.3):
            measure = self._measure()
            unit = "N" if "force" in measure else "N m"
            out.append(f'[[constraints]]\nlimit = "{measure}"\nmax = "{self.pick(1, 100, 1000, 10000)} {unit}"')
        if self.mounts != RIGID and self.chance(0.3):
            out.append('[[constraints]]\nlimit = "static sag"\nmax = "4 mm"')
        return "\n".join(out)


def random_text(seed: int) -> str:
    """Return a problem file."""
    return Writer(seed).text()
