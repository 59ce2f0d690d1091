"""Dependence of each channel on each kind of decision.

The table lists known dependences. A channel that is not in it is UNKNOWN for every kind: no bound treats it as affine
or constant, and a problem with it is solved locally. Tests by sampling (`tests/problem/test_dependence.py`) can refute
an entry but not prove it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum

from laufruhe.errors import ModelError
from laufruhe.extension import extensions, objects
from laufruhe.physics.fidelity import EXACT
from laufruhe.problem.channels import CHANNELS, STORED_WORK, Channel
from laufruhe.problem.decision import KINDS, Kind
from laufruhe.problem.problem import Problem


class Dependence(StrEnum):
    """Dependence of a channel on open numbers of one kind while all others are fixed."""

    NONE = "none"
    AFFINE = "affine"
    """Affine; a mass is a sum of lengths of affine vectors."""
    BIAFFINE = "affine while unbalances are fixed"
    KINKED = "affine between supports of the shaft while unbalances are fixed"
    """Affine in the place of a rotor while unbalances are fixed, with a kink where it passes a support (B4)."""
    MASSES = "affine in masses that follow, times a factor that goes one way"
    """Affine in masses that follow from sizes, times a factor of each place that is monotone in each size (Z2)."""
    SHIFT = "a sum of parts, each earlier by its own angle"
    """Sum of parts, each delayed by its own angle: the throws of a crank star, or the loads of geared shafts (P13)."""
    SWING = "a number of a signal that is SHIFT"
    CONVEX = "convex"
    MONOTONE_UP = "never falls"
    MONOTONE_DOWN = "never rises"
    SMOOTH = "smooth"
    """Continuous, without further known properties."""
    UNKNOWN = "unknown"


# letters of the table, in the order of the class
_LETTERS = dict(zip("0abvm>wc+-s?", Dependence, strict=True))
_COLUMNS = (
    Kind.UNBALANCE, Kind.SHARE, Kind.PISTON, Kind.PLACE, Kind.SIZE, Kind.LEAD, Kind.STAR, Kind.STIFFNESS, Kind.MOUNT,
)  # fmt: skip
# for an engine on elastic mounts at an even speed; `dependence` treats other engines
_TABLE = """
                                    U S P  x Z L  *  k M
shaking force                       a a a  b m >  >  0 0
rocking couple                      a a a  b m >  >  0 0
roll moment                         a a a  b m >  >  0 0
surging force                       a a a  b m >  >  0 0
swaying couple                      a a a  b m >  >  0 0
mount force                         a a a  b m >  >  s s
resultant mount force               a a a  b m >  >  s s
mount travel                        a a a  b m >  >  s s
crank torque                        0 0 a  0 m >  >  0 0
stored work                         0 0 a  0 m >  >  0 0
counterweight mass                  a 0 a  0 0 0  a  0 0
balancer mass                       a 0 a  0 0 0  a  0 0
added mass                          a 0 a  0 0 0  a  0 0
static sag                          0 0 0  0 0 0  0  c s
natural frequencies                 0 0 0  0 0 0  0  + s
motion frequencies                  0 0 0  0 0 0  0  ? ?
kinetic-energy decoupling           0 0 0  0 0 0  0  s s
decoupling shortfall                0 0 0  0 0 0  0  s s
torque-roll residual                0 0 0  0 0 0  0  c s
raw torque-roll residual            0 0 0  0 0 0  0  c s
total stiffness                     0 0 0  0 0 0  0  a s
static travel                       0 0 0  0 0 0  0  s s
static mount force                  0 0 0  0 0 0  0  s s
transmissibility                    s s s  s s s  s  s s
"""


def _row(line: str) -> tuple[str, dict[Kind, Dependence]]:
    name, words = line.split("  ", 1)
    letters = [word for word in words.split() if "=" not in word]
    row = dict(zip(_COLUMNS, map(_LETTERS.__getitem__, letters), strict=True)) if letters else {}
    additions = (word.split("=") for word in words.split() if "=" in word)
    # kinds of extensions that are not installed have no effect
    return name, row | {KINDS[kind]: _LETTERS[letter] for kind, letter in additions if kind in KINDS}


def _with_extensions(core_rows: Mapping[str, dict[Kind, Dependence]]) -> dict[str, Mapping[Kind, Dependence]]:
    """Return the table of dependences by channel and kind of decision, with the entries of extensions."""
    missing = set(CHANNELS).difference(core_rows)
    table: dict[str, Mapping[Kind, Dependence]] = {
        name: row | {kind: Dependence.NONE for kind in KINDS.values() if kind.is_alone and kind not in row}
        for name, row in core_rows.items()
    }
    for extension in extensions():
        for line in extension.dependences:
            try:
                name, row = _row(line)
            except (KeyError, ValueError):
                rule = f"{line!r} is no line of dependences; write a channel, two blanks and {len(_COLUMNS)} letters"
                raise ModelError(f"extension '{extension.name}': {rule}") from None
            if name in missing:
                missing.remove(name)
            elif name not in core_rows or not row.keys() <= {kind for _, kind in objects(extension, "kinds")}:
                rule = f"'{name}' has dependences already, or is no channel; remove the line"
                raise ModelError(f"extension '{extension.name}': {rule}")
            table[name] = {**table.get(name, {}), **row}
    return table


TABLE: Mapping[str, Mapping[Kind, Dependence]] = _with_extensions(dict(map(_row, _TABLE.strip().splitlines()[1:])))
"""Dependences by the name of the channel and the kind of decision."""
# loads of supports depend on the positions of rotors on the shafts that they carry
_OF_SUPPORTS = frozenset(
    name for name, row in TABLE.items()
    if CHANNELS[name].is_load and row[Kind.PLACE] in (Dependence.SMOOTH, Dependence.KINKED)
)  # fmt: skip
# dependences on unbalances if the weight of moving parts counts (T14); methods that know a number of the torque suppose
# that unbalances leave it as it is
_OF_GRAVITY = {name: Dependence.UNKNOWN for name, channel in CHANNELS.items() if channel.depends_on_torque} | {
    STORED_WORK.name: Dependence.AFFINE
}
# dependences that are lost at an uneven speed, where loads of parts do not add up
_OF_EVEN_SPEED = (Dependence.MASSES, Dependence.SHIFT, Dependence.SWING)


def dependence(channel: Channel, kind: Kind, problem: Problem) -> Dependence:
    """Return how a channel follows decisions of one kind, such as affine or smooth, in this problem."""
    channel = channel.linear_in or channel
    if CHANNELS.get(channel.name) is not channel:
        return Dependence.UNKNOWN
    entry = TABLE.get(channel.name, {}).get(kind, Dependence.UNKNOWN)
    if problem.engine.gravity and kind is Kind.UNBALANCE and channel.name in _OF_GRAVITY:
        return _OF_GRAVITY[channel.name]
    if entry in (Dependence.NONE, Dependence.UNKNOWN):
        return entry
    if kind is Kind.PLACE and channel.name in _OF_SUPPORTS and not _moves_carried(problem):
        return Dependence.NONE
    if entry is Dependence.KINKED and problem.fidelity.crankshaft != "cut":
        # a continuous beam passes loads on to all supports
        return Dependence.SMOOTH
    if kind is Kind.STIFFNESS and problem.engine.block is None and channel.is_load:
        # rigid mounts share a force by their positions alone
        return Dependence.NONE
    if kind is Kind.LEAD and entry in (Dependence.SHIFT, Dependence.SWING) and shares_gas(problem):
        # a lead changes the volume between two pistons with common gas
        return Dependence.SMOOTH
    if problem.fidelity.has_uneven_speed and kind is not Kind.STAR:
        moves_crank = channel.is_load and TABLE[STORED_WORK.name].get(kind) is Dependence.AFFINE
        if entry in _OF_EVEN_SPEED or moves_crank:
            return Dependence.SMOOTH
    return entry


def falls_with(channel: Channel, kind: Kind) -> bool:
    """Return True if a channel never rises with a number of a kind."""
    return TABLE[channel.name].get(kind) is Dependence.MONOTONE_DOWN


def open_kinds(problem: Problem) -> frozenset[Kind]:
    """Return the kinds of all open numbers and choices of a problem."""
    stars = [Kind.STAR] if problem.phasing is not None else []
    return frozenset([*stars, *(decision.kind for decision in problem.decisions)])


def depends(channel: Channel, kinds: Collection[Kind], problem: Problem) -> bool:
    """Return True if a channel may change with decisions of these kinds; UNKNOWN counts as a change."""
    return any(dependence(channel, kind, problem) is not Dependence.NONE for kind in kinds)


def keeps_omitted(channel: Channel, kinds: Collection[Kind], problem: Problem) -> bool:
    """Return True if the loads that the fidelity omits are the same whatever these kinds of decisions are (F16).

    Every fidelity keeps the loads of rotors. Other mounts, or an uneven speed, change what they do.
    """
    fidelity = problem.fidelity
    same = fidelity.mounts == EXACT.mounts and fidelity.modes is None and not fidelity.has_uneven_speed
    of_rotors = (Kind.UNBALANCE, Kind.PLACE) if same else ()
    entries = ((kind, dependence(channel, kind, problem)) for kind in kinds)
    return all(x is Dependence.NONE or (kind in of_rotors and x is not Dependence.UNKNOWN) for kind, x in entries)


def is_affine(channel: Channel, kinds: Collection[Kind], problem: Problem) -> bool:
    """Return True if a channel is an affine function of all decisions of these kinds together, or constant."""
    if Kind.SHARE in kinds and depends(STORED_WORK, kinds, problem):
        # the inertia on a geared shaft takes a fraction of a torque that depends on the other kinds
        return not depends(channel, kinds, problem)
    allowed = (Dependence.NONE, Dependence.AFFINE)
    return all(dependence(channel, kind, problem) in allowed for kind in kinds)


def shares_gas(problem: Problem) -> bool:
    """Return True if a measure depends on gas, and a piston with an open lead angle shares a chamber with another."""
    names = {shaft for decision in problem.decisions for shaft in decision.keys(Kind.LEAD)}
    parts = problem.engine.slider_cranks
    moving = (part for part in parts if part.shaft.name in names)
    return problem.depends_on_gas and any(part.faces(other) for part in moving for other in parts if other is not part)


def _moves_carried(problem: Problem) -> bool:
    # True if a support carries a shaft with rotors of open position
    moving = {drive.rotor for decision in problem.decisions for drive in decision.place_drives}
    return any(rotor.shaft.name in problem.engine.supports for rotor in problem.engine.rotors if rotor.name in moving)
