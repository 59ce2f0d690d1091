"""Engines in code: a function for each layout, and one for the catalogue.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from laufruhe.problem.number_types import Table, Value, Values
from laufruhe.python.draft import EngineDraft, engine_of


def inline(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout inline.

    Single bank with a throw for every cylinder.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    row_angle
        Angle between the two rows of a bank whose cylinders lean alternately to the left and right (VR and W engines);
        negative if the front cylinder leans to the right [rad].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "inline"})


def vee(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, bank_angle: Value | None = None,
    split_pin_angle: Value | None = None, bank_stagger: Value | None = None,
    first_bank: Literal["left", "right"] | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout vee.

    Two banks with a throw for each pair of cylinders.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    row_angle
        Angle between the two rows of a bank whose cylinders lean alternately to the left and right (VR and W engines);
        negative if the front cylinder leans to the right [rad].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    bank_angle
        Angle between the banks of a vee [rad].
    split_pin_angle
        Angle by which the right bank's crank pin leads [rad].
    bank_stagger
        Distance along the crank between opposite cylinders of the two banks [m].
    first_bank
        Bank of cylinder 1, seen from the flywheel towards the front; left by default.
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "vee"})


def boxer(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, bank_stagger: Value | None = None,
    first_bank: Literal["left", "right"] | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout boxer.

    Opposed banks with a throw for every cylinder.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    bank_stagger
        Distance along the crank between opposite cylinders of the two banks [m].
    first_bank
        Bank of cylinder 1, seen from the flywheel towards the front; left by default.
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "boxer"})


def opposed_piston(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, row_angle: Value | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, crank_distance: Value | None = None,
    crank_ratio: Literal[1, -1] | None = None, crank_lead: Value | None = None,
    second_reciprocating_mass: Value | None = None, port_arc: Value | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout opposed-piston.

    Inline layout with a second crank above.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    row_angle
        Angle between the two rows of a bank whose cylinders lean alternately to the left and right (VR and W engines);
        negative if the front cylinder leans to the right [rad].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    crank_distance
        Distance of the two cranks of opposed pistons [m].
    crank_ratio
        Speed ratio of the second crank of opposed pistons; -1 by default, against the first.
    crank_lead
        Angle by which the pistons of the second crank of opposed pistons lead [rad].
    second_reciprocating_mass
        Reciprocating mass of each piston of the second crank; by default that of the others [kg].
    port_arc
        Crank angle for which the ports of a piston are open; a lead has to be less [rad].
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "opposed-piston"})


def delta(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, fires_together: bool | None = None,
    gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None, crank_distance: Value | None = None,
    reversed_crank: int | None = None, crank_leads: Values | None = None, pivot_distance: Value | None = None,
    return_ratio: Value | None = None, lever_length: Value | None = None, lever: Table | None = None,
    lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout delta.

    Two-stroke engine with rows of three cylinders in a triangle.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    crank_distance
        Distance of the two cranks of opposed pistons [m].
    reversed_crank
        Crank of a triangle against the other two: 1 below, 2 left, 3 right.
    crank_leads
        Angles by which the first pistons of the first two banks of a triangle lead [rad].
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "delta"})


def radial(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None, knuckle_radius: Value | None = None,
    master_cylinder: int | None = None, knuckle_angles: Values | None = None,
    articulated_rod_length: Value | None = None, articulated_rod: Table | None = None,
    knuckle_mass: Value | None = None, pivot_distance: Value | None = None, return_ratio: Value | None = None,
    lever_length: Value | None = None, lever: Table | None = None, lever_weight: Value | None = None,
    lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout radial.

    Master rod and articulated rods on one crank pin; cylinder 1 is upright, numbers follow the rotation.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    knuckle_radius
        Distance of the knuckle pins of the master rod from the crank pin [m].
    master_cylinder
        Number of the cylinder with the master rod; 1 by default.
    knuckle_angles
        Angle of every knuckle pin from the master rod; by default those of the cylinders [rad].
    articulated_rod_length
        Length of the articulated rods; by default such that all pistons reach the same height [m].
    articulated_rod
        Articulated rod as a rigid body, counted from its knuckle pin.
    knuckle_mass
        Mass at every knuckle pin, beside the share of articulated_rod [kg].
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "radial"})


def x_engine(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    throws: Values | Literal["open", "parallel-360", "parallel-180", "parallel-270", "even-three", "t-plane",
        "flat-plane", "cross-plane", "even-six"] | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, single_cylinders: Sequence[Table] | None = None,
    cylinder_spacing: Value | Values | None = None,
    numbering: Sequence[int] | Literal["one bank after the other", "alternating"] | None = None,
    rotation: Literal["clockwise", "counter-clockwise"] | None = None,
    first_end: Literal["front", "flywheel"] | None = None, first_bank: Literal["left", "right"] | None = None,
    pivot_distance: Value | None = None, return_ratio: Value | None = None, lever_length: Value | None = None,
    lever: Table | None = None, lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout x-engine.

    Four banks at right angles, a throw for four cylinders: upper left, upper right, lower left, lower right.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    first_bank
        Bank of cylinder 1, seen from the flywheel towards the front; left by default.
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "x-engine"})


def parts(
    cylinders: int | None = None, *, cycle: Literal["two-stroke", "four-stroke"],
    drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None, bore: Value | None = None,
    stroke: Value | None = None, rod_ratio: Value | None = None, rod_length: Value | None = None,
    offset: Value | None = None, reciprocating_mass: Value | None = None, rotating_mass: Value | None = None,
    rod: Table | None = None, big_end: Table | None = None, rod_inertia_deficit: Value | None = None,
    firing_order: Sequence[int] | Literal["open"] | None = None, firing_intervals: Values | None = None,
    fires_together: bool | None = None, gravity: bool | None = None, shafts: Sequence[Table] | None = None,
    slider_cranks: Sequence[Table] | None = None, single_cylinders: Sequence[Table] | None = None,
    pivot_distance: Value | None = None, return_ratio: Value | None = None, lever_length: Value | None = None,
    lever: Table | None = None, lever_weight: Value | None = None, lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of layout parts.

    Layout by a free list of slider-cranks, each with its own position.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    drive
        How a crank moves its piston rod.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    shafts
        Crankshafts of a free list of parts.
    slider_cranks
        Slider-cranks of a free list of parts.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {"layout": "parts"})


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
    """Return an engine of layout rotary.

    Rotors in a row on one shaft, each firing once a turn.

    Parameters
    ----------
    cylinders
        Number of cylinders; by default that of throws or firing order.
    cycle
        Turns of the crank in a working cycle: one or two.
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    row_angle
        Angle between the two rows of a bank whose cylinders lean alternately to the left and right (VR and W engines);
        negative if the front cylinder leans to the right [rad].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    eccentricity
        Eccentricity of the shaft under every rotor [m].
    rotor_radius
        Distance from a rotor's centre to its apexes [m].
    rotor_width
        Width along the shaft [m].
    rotor_mass
        Mass of a rotor with its seals; rotating_mass is that of the eccentric [kg].
    rotor_inertia
        Moment of inertia of a rotor about its centre [kg m^2].
    """
    return engine_of(locals(), {"layout": "rotary"})


def engine(
    catalogue: str, *,
    layout: Literal["inline", "vee", "boxer", "opposed-piston", "delta", "radial", "x-engine", "parts",
        "rotary"] | None = None, drive: Literal["slider-crank", "scotch-yoke", "klein", "swinging-yoke"] | None = None,
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
    rotor_inertia: Value | None = None, pivot_distance: Value | None = None, return_ratio: Value | None = None,
    lever_length: Value | None = None, lever: Table | None = None, lever_weight: Value | None = None,
    lever_weight_radius: Value | None = None,
) -> EngineDraft:
    """Return an engine of the catalogue; arguments replace its numbers.

    Parameters
    ----------
    catalogue
        Engine of the catalogue (laufruhe engines) that supplies every key which this table does not give.
    layout
        How the cylinders stand.
    drive
        How a crank moves its piston rod.
    cycle
        Turns of the crank in a working cycle: one or two.
    cylinders
        Number of cylinders; by default that of throws or firing order.
    bore
        Diameter of the cylinder; needed with gas [m].
    stroke
        Travel of the piston; with an offset a little more than twice the crank radius [m].
    rod_ratio
        Crank radius over rod length; 0 is a Scotch yoke.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis; with row_angle to the outer side of every row [m].
    reciprocating_mass
        Reciprocating mass of a cylinder, with the rod's share unless [engine.rod] is given [kg].
    rotating_mass
        Rotating mass of a throw, at the crank radius [kg].
    rod
        The connecting rod as a rigid body, in place of a reciprocating mass with its share.
    big_end
        Big end of the rod; needed for the pressure on crank pins.
    rod_inertia_deficit
        Inertia of the rod less that of two masses at its ends [kg m^2].
    throws
        Angles of the throws at phi = 0, or "open"; by default those of even firing [rad].
    firing_order
        Numbers of the cylinders in the order in which they fire, or "open".
    firing_intervals
        Crank angles from each firing of firing_order to the next; by default each cylinder fires at its first dead
        centre after the one before [rad].
    fires_together
        Whether cylinders are meant to fire at once; else you are asked.
    gravity
        true: the weight of moving parts acts on the crank, with z upwards; stored work and irregularity count it.
    shafts
        Crankshafts of a free list of parts.
    slider_cranks
        Slider-cranks of a free list of parts.
    single_cylinders
        Cylinders that differ from the others; missing keys are those of [engine].
    cylinder_spacing
        Distance between neighbouring throws; in a boxer between neighbours of a bank. A list has each, from the front
        [m].
    row_angle
        Angle between the two rows of a bank whose cylinders lean alternately to the left and right (VR and W engines);
        negative if the front cylinder leans to the right [rad].
    numbering
        Numbers of the cylinders in this file: by bank, alternating between banks, or the number of each cylinder in a
        list, bank by bank from the front, the left bank first.
    rotation
        Sense of rotation of the crank, seen from the front; clockwise by default.
    first_end
        End of the engine at which cylinder 1 stands; the front by default.
    bank_angle
        Angle between the banks of a vee [rad].
    split_pin_angle
        Angle by which the right bank's crank pin leads [rad].
    bank_stagger
        Distance along the crank between opposite cylinders of the two banks [m].
    first_bank
        Bank of cylinder 1, seen from the flywheel towards the front; left by default.
    crank_distance
        Distance of the two cranks of opposed pistons [m].
    crank_ratio
        Speed ratio of the second crank of opposed pistons; -1 by default, against the first.
    crank_lead
        Angle by which the pistons of the second crank of opposed pistons lead [rad].
    second_reciprocating_mass
        Reciprocating mass of each piston of the second crank; by default that of the others [kg].
    port_arc
        Crank angle for which the ports of a piston are open; a lead has to be less [rad].
    reversed_crank
        Crank of a triangle against the other two: 1 below, 2 left, 3 right.
    crank_leads
        Angles by which the first pistons of the first two banks of a triangle lead [rad].
    knuckle_radius
        Distance of the knuckle pins of the master rod from the crank pin [m].
    master_cylinder
        Number of the cylinder with the master rod; 1 by default.
    knuckle_angles
        Angle of every knuckle pin from the master rod; by default those of the cylinders [rad].
    articulated_rod_length
        Length of the articulated rods; by default such that all pistons reach the same height [m].
    articulated_rod
        Articulated rod as a rigid body, counted from its knuckle pin.
    knuckle_mass
        Mass at every knuckle pin, beside the share of articulated_rod [kg].
    eccentricity
        Eccentricity of the shaft under every rotor [m].
    rotor_radius
        Distance from a rotor's centre to its apexes [m].
    rotor_width
        Width along the shaft [m].
    rotor_mass
        Mass of a rotor with its seals; rotating_mass is that of the eccentric [kg].
    rotor_inertia
        Moment of inertia of a rotor about its centre [kg m^2].
    pivot_distance
        From the crank axis to the pivot of a swinging yoke [m].
    return_ratio
        Time of the slow stroke over that of the quick one, of a swinging yoke.
    lever_length
        From pivot to ram, of a swinging yoke, in place of return_ratio [m].
    lever
        Of a swinging yoke, as a rigid body, its centre of gravity from the pivot.
    lever_weight
        Behind the pivot of a swinging yoke [kg].
    lever_weight_radius
        Of lever_weight, from the pivot [m].
    """
    return engine_of(locals(), {})
