"""Drives: how a crank moves a piston rod or a ram."""

from laufruhe.machine.drives.base import DriveKind, Sizes
from laufruhe.machine.drives.scotch_yoke import ScotchYoke
from laufruhe.machine.drives.slider_crank import Klein, RodDrive
from laufruhe.machine.drives.swinging_yoke import SwingingYokeDrive

DRIVES: dict[str, DriveKind] = {
    kind.name: kind
    for kind in (
        RodDrive(),
        ScotchYoke(),
        Klein(),
        SwingingYokeDrive(),
    )
}

__all__ = ["DRIVES", "DriveKind", "Sizes"]
