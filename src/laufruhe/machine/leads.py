"""Phase leads of shafts and of all that they carry (L10)."""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from dataclasses import replace

from laufruhe.machine.engine import Engine
from laufruhe.machine.facing import with_shared_chambers
from laufruhe.machine.slider_crank import SliderCrank


def parts_with_leads(parts: Sequence[SliderCrank], leads: Mapping[str, float]) -> tuple[SliderCrank, ...]:
    """Return the slider-cranks with phase leads [rad] by the names of their shafts."""
    return tuple(_with_lead(part, leads.get(part.shaft.name, 0.0)) for part in parts)


def _with_lead(part: SliderCrank, lead: float) -> SliderCrank:
    if not lead:
        return part
    return replace(part, throw=part.throw + part.shaft.ratio * lead, firing_angle=part.firing_angle - lead)


def with_leads(engine: Engine, leads: Mapping[str, float]) -> Engine:
    """Return the engine with phase leads of its shafts [rad], and so of all loads on them."""
    parts = parts_with_leads(engine.slider_cranks, leads)
    if any(part.facing is not None for part in parts):
        parts = with_shared_chambers([replace(part, facing=None) for part in parts], engine.cycle.angle)
    turned = {shaft.name: cmath.exp(1j * shaft.ratio * leads.get(shaft.name, 0.0)) for shaft in engine.shafts}
    rotors = tuple(replace(rotor, unbalance=rotor.unbalance * turned[rotor.shaft.name]) for rotor in engine.rotors)
    return replace(engine, slider_cranks=parts, rotors=rotors)
