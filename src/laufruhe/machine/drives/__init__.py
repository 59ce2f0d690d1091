"""Drives: how a crank moves a piston rod or a ram."""

from collections.abc import Mapping

from laufruhe.extension import extended
from laufruhe.machine.drives.base import DriveKind, Klein, RodDrive, ScotchYoke, Sizes

DRIVES: Mapping[str, DriveKind] = extended("drives", DriveKind, (RodDrive(), ScotchYoke(), Klein()))

__all__ = ["DRIVES", "DriveKind", "Sizes"]
