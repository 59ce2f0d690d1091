"""Problem files that phasing tests write for themselves."""

from pathlib import Path

from laufruhe.problem.problem import Problem
from problem_files import loaded

MOUNTS = """
[mounts]
positions = [
    ["300 mm", "250 mm", "0 mm"], ["300 mm", "-250 mm", "0 mm"],
    ["-500 mm", "250 mm", "0 mm"], ["-500 mm", "-250 mm", "0 mm"],
]
"""
WEIGHTS = """
[[counterweights]]
name = "front"
x = "200 mm"
unbalance = { between = ["0 kg m", "0.2 kg m"] }
angle = { between = [0, 360] }
[[counterweights]]
name = "rear"
x = "-200 mm"
unbalance = { between = ["0 kg m", "0.2 kg m"] }
angle = { between = [0, 360] }
"""
OPEN = 'throws = "open"\nfiring_order = "open"\nrotating_mass = "0.7 kg"\n'
COUPLE = '[objective]\nminimise = "rms rocking couple"\norders = [1, 2]\n'
MOUNT_FORCE = '[objective]\nminimise = "mean mount force"\n'


def shaft(name: str, ratio: float, reach: str = "250 mm", mass: str = "0 kg") -> str:
    """Return an optional shaft with opposite unbalances at its ends."""
    return f"""
[[balancer_shafts]]
name = "{name}"
optional = true
shaft_mass = "{mass}"
ratio = {ratio}
position = ["0 mm", "0 mm"]
[[balancer_shafts.unbalances]]
name = "front"
x = "{reach}"
unbalance = {{ between = ["0 kg m", "0.1 kg m"] }}
angle = {{ between = [0, 360] }}
[[balancer_shafts.unbalances]]
name = "rear"
x = "-{reach}"
coupled = {{ to = "{name}.front", as = "opposite" }}
"""


def problem(
    folder: Path,
    cylinders: int,
    cycle: str = "two-stroke",
    engine: str = 'throws = "open"\nfiring_order = "open"',
    phasing: str = "",
    rest: str = COUPLE,
    layout: str = "inline",
    samples: int = 192,
) -> Problem:
    """Return an engine of small pistons with what is asked of it."""
    text = f"""title = "test"
[engine]
layout = "{layout}"
cycle = "{cycle}"
cylinders = {cylinders}
bore = "100 mm"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
cylinder_spacing = "125 mm"
{engine}

[phasing]
{phasing}

[fidelity]
samples = {samples}

[[operating_points]]
speed = "2000 rpm"

{rest}"""
    return loaded(folder, text)
