"""Engines in code: a function for each layout, and one for the catalogue.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from laufruhe.problem.number_types import Table, Value, Values
from laufruhe.python.draft import EngineDraft, engine_of
from laufruhe.python.keys import describe


def inline(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout inline. Single bank with a throw for every cylinder."""
    return engine_of(locals(), {"layout": "inline"})


def vee(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, bank_angle: Value | None = None,
    split_pin_angle: Value | None = None, bank_stagger: Value | None = None,
    first_bank: Literal["left", "right"] | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout vee. Two banks with a throw for each pair of cylinders."""
    return engine_of(locals(), {"layout": "vee"})


def boxer(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, bank_stagger: Value | None = None,
    first_bank: Literal["left", "right"] | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout boxer. Opposed banks with a throw for every cylinder."""
    return engine_of(locals(), {"layout": "boxer"})


def opposed_piston(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, crank_distance: Value | None = None,
    crank_ratio: Literal[1, -1] | None = None, crank_lead: Value | None = None,
    second_reciprocating_mass: Value | None = None, port_arc: Value | None = None,
    rocker_pivot_along: Value | None = None, rocker_pivot_across: Value | None = None,
    coupler_length: Value | None = None, rocker_arm: Value | None = None, rocker_end: Value | None = None,
    piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout opposed-piston. Inline layout with a second crank above."""
    return engine_of(locals(), {"layout": "opposed-piston"})


def x_engine(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, first_bank: Literal["left", "right"] | None = None,
    rocker_pivot_along: Value | None = None, rocker_pivot_across: Value | None = None,
    coupler_length: Value | None = None, rocker_arm: Value | None = None, rocker_end: Value | None = None,
    piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout x-engine.

    Four banks at right angles, a throw for four cylinders: upper left, upper right, lower left, lower right.
    """
    return engine_of(locals(), {"layout": "x-engine"})


def parts(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None, firing_order: Sequence[int] | Literal["open"] | None = None,
    firing_intervals: Values | None = None, fires_together: bool | None = None, gravity: bool | None = None,
    shafts: Sequence[Table] | None = None, slider_cranks: Sequence[Table] | None = None,
    single_cylinders: Sequence[Table] | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout parts. Layout by a free list of slider-cranks, each with its own position."""
    return engine_of(locals(), {"layout": "parts"})


def delta(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, fires_together: bool | None = None,
    gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, crank_distance: Value | None = None,
    reversed_crank: int | None = None, crank_leads: Values | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout delta. Two-stroke engine with rows of three cylinders in a triangle."""
    return engine_of(locals(), {"layout": "delta"})


def radial(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    bore: Value | None = None, stroke: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod: Table | None = None, big_end: Table | None = None,
    rod_inertia_deficit: Value | None = None, firing_order: Sequence[int] | Literal["open"] | None = None,
    firing_intervals: Values | None = None, fires_together: bool | None = None, gravity: bool | None = None,
    single_cylinders: Sequence[Table] | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None, knuckle_radius: Value | None = None,
    master_cylinder: int | None = None, knuckle_angles: Values | None = None,
    articulated_rod_length: Value | None = None, articulated_rod: Table | None = None,
    knuckle_mass: Value | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout radial.

    Master rod and articulated rods on one crank pin; cylinder 1 is upright, numbers follow the rotation.
    """
    return engine_of(locals(), {"layout": "radial"})


def rotary(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"], rotating_mass: Value | None = None,
    big_end: Table | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, eccentricity: Value | None = None,
    rotor_radius: Value | None = None, rotor_width: Value | None = None, rotor_mass: Value | None = None,
    rotor_inertia: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout rotary. Rotors in a row on one shaft, each firing once a turn."""
    return engine_of(locals(), {"layout": "rotary"})


def engine(
    catalogue: str, *,
    layout: Literal["inline", "vee", "boxer", "opposed-piston", "x-engine", "parts", "delta", "radial",
        "rotary"] | None = None,
    drive: Literal["slider-crank", "scotch-yoke", "klein", "crank-rocker", "rhombic", "swinging-yoke"] | None = None,
    cycle: Literal["two-stroke", "four-stroke"] | None = None, cylinders: int | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, shafts: Sequence[Table] | None = None,
    slider_cranks: Sequence[Table] | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, bank_angle: Value | None = None,
    split_pin_angle: Value | None = None, bank_stagger: Value | None = None,
    first_bank: Literal["left", "right"] | None = None, crank_distance: Value | None = None,
    crank_ratio: Literal[1, -1] | None = None, crank_lead: Value | None = None,
    second_reciprocating_mass: Value | None = None, port_arc: Value | None = None, reversed_crank: int | None = None,
    crank_leads: Values | None = None, knuckle_radius: Value | None = None, master_cylinder: int | None = None,
    knuckle_angles: Values | None = None, articulated_rod_length: Value | None = None,
    articulated_rod: Table | None = None, knuckle_mass: Value | None = None, eccentricity: Value | None = None,
    rotor_radius: Value | None = None, rotor_width: Value | None = None, rotor_mass: Value | None = None,
    rotor_inertia: Value | None = None, rocker_pivot_along: Value | None = None,
    rocker_pivot_across: Value | None = None, coupler_length: Value | None = None, rocker_arm: Value | None = None,
    rocker_end: Value | None = None, piston_rod_length: Value | None = None, rocker_angle: Value | None = None,
    rocker_side: Literal[1, -1] | None = None, coupler: Table | None = None, rocker: Table | None = None,
    piston_rod: Table | None = None, displacer_mass: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of the catalogue; arguments replace its numbers."""
    return engine_of(locals(), {})


describe(globals(), "EngineTable")
