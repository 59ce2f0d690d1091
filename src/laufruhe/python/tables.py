"""Tables inside the tables of a problem file, such as an unbalance of a shaft.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from laufruhe.problem.goals import QuantityName
from laufruhe.problem.number_types import Array, Number, Table, Value, Values
from laufruhe.python.keys import keys_of


def absorber(
    name: str, *, on: str, inertia: Value, damping: Value | None = None, stiffness: Value | None = None,
    loss_factor: Value | None = None, order: Value | None = None, damping_ratio: Value | None = None,
) -> Table:
    """Return a table `absorber`.

    A viscous or rubber damper, or a pendulum.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    on
        Name of its disc, or throw 1, throw 2 ...
    inertia
        Moment of inertia about the axis of rotation [kg m^2].
    damping
        Viscous damping [N m s/rad].
    stiffness
        Force for each unit of travel, or torque for each unit of twist [N m/rad].
    loss_factor
        Hysteretic loss factor: energy lost in a cycle over 2 pi times the energy stored.
    order
        Order to which a pendulum is tuned.
    damping_ratio
        Damping over critical damping.
    """
    return keys_of(locals())


def arms(
    *, count: int, at_rim: Values, at_hub: Values, hub_diameter: Value,
) -> Table:
    """Return a table `arms`.

    Oval arms between hub and rim.

    Parameters
    ----------
    count
        How many there are.
    at_rim
        Width of an arm across the plane of rotation, and depth in it, at the rim [m].
    at_hub
        Width and depth of an arm at the hub [m].
    hub_diameter
        Outer diameter of the hub [m].
    """
    return keys_of(locals())


def axes(
    *, crank: Values | Literal["+x", "-x", "+y", "-y", "+z", "-z"],
    up: Values | Literal["+x", "-x", "+y", "-y", "+z", "-z"], origin: Values | None = None,
) -> Table:
    """Return a table `axes`.

    Axes of a file that are not those of the engine: where the engine points in them, and where it stands.

    Parameters
    ----------
    crank
        Direction of the crank from the flywheel to the front, as an axis or a vector.
    up
        Direction of the engine's z axis, as an axis or a vector.
    origin
        Position of the engine's origin: on the crank, midway between the first and the last cylinder [m].
    """
    return keys_of(locals())


def big_end(
    *, diameter: Value, width: Value,
) -> Table:
    """Return a table `big_end`.

    Big-end bearing of the rod on the crank pin.

    Parameters
    ----------
    diameter
        Outer diameter [m].
    width
        Width along the shaft [m].
    """
    return keys_of(locals())


def body(
    *, kind: Literal["sector", "slab", "cheek"], outer_radius: Value, thickness: Value,
    inner_radius: Value | None = None, angle: Value | None = None, width: Value | None = None,
    tail: Value | None = None, fillet: Value | None = None, density: Value | None = None, spacing: Value | None = None,
) -> Table:
    """Return a table `body`.

    Body of a weight, from which its mass and unbalance follow.

    Parameters
    ----------
    kind
        A sector of a disc or ring; a slab with a flat inner side; a web cheek with a round end about the crank pin.
    outer_radius
        Radius that the body sweeps about its shaft [m].
    thickness
        Length along the shaft, of each of two bodies [m].
    inner_radius
        Inner radius of a sector, or distance of the flat side of a slab from the shaft [m].
    angle
        Opening angle of a sector, or of the wide end of a cheek [rad].
    width
        Width of a slab or cheek across its middle line [m].
    tail
        Distance of the round end of a cheek from the shaft [m].
    fillet
        Radius at every corner that points outwards [m].
    density
        Density; that of steel by default [kg/m^3].
    spacing
        Distance between the middles of two equal bodies, one on either web of a throw; 0 for one body [m].
    """
    return keys_of(locals())


def bolts(
    *, diameter: Value, count: int | None = None,
) -> Table:
    """Return a table `bolts`.

    The bolts of every big end.

    Parameters
    ----------
    diameter
        Diameter of a bolt at the root of the thread [m].
    count
        How many there are.
    """
    return keys_of(locals())


def branch_disc(
    name: str, *, inertia: Value, shaft: Table, damping: Value | None = None,
) -> Table:
    """Return a table `branch_disc`.

    A disc of a branch.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    inertia
        Moment of inertia about the axis of rotation [kg m^2].
    shaft
        Shaft from this disc to the next one towards the throws.
    damping
        Viscous damping against the block [N m s/rad].
    """
    return keys_of(locals())


def branch(
    *, on: str, ratio: Number, gear_inertia: Value | None = None, discs: Sequence[Table] | None = None,
) -> Table:
    """Return a table `branch`.

    Shaft that gears, a belt or a chain drive from a disc: a camshaft, pump, propeller or generator.

    Parameters
    ----------
    on
        Name of the disc that drives it: of the crankshaft, or of a branch before it.
    ratio
        Speed over that of this disc; negative runs against it.
    gear_inertia
        Inertia of its gear, which follows the disc without twist, at the speed of the branch [kg m^2].
    discs
        Discs of the branch, from its gear.
    """
    return keys_of(locals())


def chamber(
    name: str | None = None, *, end: Literal["head", "crank"], bore: Value, cylinders: Sequence[int] | None = None,
    rod: Value | None = None, steam: Table | None = None, pump: Table | None = None, trace: Table | None = None,
) -> Table:
    """Return a table `chamber`.

    A space on one side of a piston, or of a further piston on the same rod.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    end
        head: pressure drives the piston towards the crank; crank: away from it.
    bore
        Diameter of the piston [m].
    cylinders
        Cylinders whose rods carry such a piston; all by default.
    rod
        Diameter of the piston rod where it passes through this end [m].
    steam
        An indicator diagram of straight lines and hyperbolas, its points parts of the stroke.
    pump
        A piston pump.
    trace
        Recorded pressure; its crank angles count from where the chamber is smallest.
    """
    return keys_of(locals())


def coupled(
    *, to: str, how: Literal["equal", "opposite", "mirrored", "mirrored opposite"],
) -> Table:
    """Return a table `coupled`.

    Unbalance that follows another one.

    Parameters
    ----------
    to
        Name of the unbalance that it follows.
    how
        How it follows: mirrored means reflected in the upright plane.
    """
    return keys_of(locals())


def crank(
    *, pieces: Sequence[Table] | None = None, diameter: Value | None = None, bore: Value | None = None,
    damping: Value | None = None, loss_factor: Value | None = None, stiffness: Value | Values | None = None,
) -> Table:
    """Return a table `crank`.

    Shafts from throw to throw.

    Parameters
    ----------
    pieces
        Round pieces, one behind another, in place of the stiffness.
    diameter
        Diameter of the weakest section, needed for a stress; by default that of the pieces [m].
    bore
        Diameter of the bore [m].
    damping
        Viscous damping [N m s/rad].
    loss_factor
        Hysteretic loss factor: energy lost in a cycle over 2 pi times the energy stored.
    stiffness
        Torque for each unit of twist: one for all, or one for each section [N m/rad].
    """
    return keys_of(locals())


def disc(
    name: str, *, inertia: Value, shaft: Table, end: Literal["front", "rear"], damping: Value | None = None,
) -> Table:
    """Return a table `disc`.

    A disc in addition to the throws.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    inertia
        Moment of inertia about the axis of rotation [kg m^2].
    shaft
        Shaft from this disc to the next one towards the throws.
    end
        Whether the disc stands before the first throw or behind the last.
    damping
        Viscous damping against the block [N m s/rad].
    """
    return keys_of(locals())


def dynamic_stiffness(
    *, file: str, axis: Literal["x", "y", "z"] | None = None, frequency_unit: str | None = None,
    stiffness_unit: str | None = None, columns: Literal["stiffness and loss", "amount and angle"] | None = None,
) -> Table:
    """Return a table `dynamic_stiffness`.

    Complex stiffness along an own axis from a CSV file: frequency, stiffness, and loss or its angle.

    Parameters
    ----------
    file
        CSV file beside the problem.
    axis
        Own axis of the mount along which it acts.
    frequency_unit
        Unit of the first column.
    stiffness_unit
        Unit of the stiffness.
    columns
        What follows the frequency: storage and loss stiffness, or its amount and its loss angle in degrees.
    """
    return keys_of(locals())


def fluid_track(
    *, mass: Value, bulge_stiffness: Value, axis: Literal["x", "y", "z"] | None = None,
    chamber_stiffness: Value | None = None, damping: Value | None = None,
) -> Table:
    """Return a table `fluid_track`.

    The fluid of a hydraulic mount, all referred to its travel by the area of the piston.

    Parameters
    ----------
    mass
        Effective mass of the fluid in the track: its inertance times the area squared [kg].
    bulge_stiffness
        Stiffness of the rubber against swelling: area squared over compliance [N/m].
    axis
        Own axis of the mount along which it acts.
    chamber_stiffness
        Of the lower chamber [N/m].
    damping
        Of the flow through the track [N s/m].
    """
    return keys_of(locals())


def frame_spring(
    *, position: Values, stiffness: Values, loss_factor: Value | None = None, damping: Values | None = None,
) -> Table:
    """Return a table `frame_spring`.

    Spring between frame and ground.

    Parameters
    ----------
    position
        Where it is, from the crank axis in the middle of the engine: x forward, y to the left, z up [m].
    stiffness
        Stiffness along x, y and z [N/m].
    loss_factor
        Hysteretic loss factor.
    damping
        Viscous damping along x, y and z; none by default [N s/m].
    """
    return keys_of(locals())


def intervals(
    *, min: Number | None = None, max: Number | None = None, largest_deviation: Number | None = None,
) -> Table:
    """Return a table `intervals`.

    Bounds on the crank angle from each firing to the next.

    Parameters
    ----------
    min
        Smallest crank angle from a firing to the next [rad].
    max
        Largest crank angle from a firing to the next [rad].
    largest_deviation
        Largest deviation of an interval from equal firing [rad].
    """
    return keys_of(locals())


def measured(
    *, angle: Value, unbalance: Value | complex | None = None, mass: Value | complex | None = None,
    radius: Value | None = None,
) -> Table:
    """Return a table `measured`.

    Unbalance that the balancing machine shows in a plane.

    Parameters
    ----------
    angle
        Angle of the heavy spot, as read at the machine [rad].
    unbalance
        Reading of a machine that shows an unbalance [kg m].
    mass
        Reading of a machine that shows a mass, at the radius [kg].
    radius
        Radius that the machine is set to [m].
    """
    return keys_of(locals())


def mount(
    name: str | None = None, *, position: Values | None = None, relative_stiffness: Values | None = None,
    turned: Values | None = None, stiffness: Values | None = None, loss_factor: Value | None = None,
    damping: Values | None = None, damping_per_stiffness: Value | None = None, like: str | None = None,
    mirror_of: str | None = None, fluid_track: Table | None = None, dynamic_stiffness: Table | None = None,
    joined_to: str | None = None, stop: Table | None = None,
) -> Table:
    """Return a table `mount`.

    Mount of the engine.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    position
        Where it is, from the crank axis in the middle of the engine: x forward, y to the left, z up [m].
    relative_stiffness
        Relative stiffness along the mount's own x, y, z; 0 carries nothing.
    turned
        Turns about x, then y, then z that bring the axes of C2 to its own [rad].
    stiffness
        Stiffness along the mount's own x, y, z [N/m].
    loss_factor
        Hysteretic loss factor: energy lost in a cycle over 2 pi times the energy stored.
    damping
        Viscous damping along the mount's own x, y, z [N s/m].
    damping_per_stiffness
        Further viscous damping along each axis, over the stiffness there, which it follows [s].
    like
        Stiffness, loss and damping follow those of this mount.
    mirror_of
        All follows this mount, mirrored in the plane y = 0.
    fluid_track
        The fluid of a hydraulic mount, all referred to its travel by the area of the piston.
    dynamic_stiffness
        Complex stiffness along an own axis from a CSV file: frequency, stiffness, and loss or its angle.
    joined_to
        It stands where this mount stands, and their forces count together as one.
    stop
        Bump stop along each of the mount's own axes; it acts in run-ups and load cases.
    """
    return keys_of(locals())


def peg(
    *, at: Value, to: Value,
) -> Table:
    """Return a table `peg`.

    Known pressure at an angle, to which a floating pressure is moved.

    Parameters
    ----------
    at
        Crank angle after the firing dead centre; the mean of 5 degrees to either side counts [rad].
    to
        Absolute pressure there, such as that in the intake at its bottom dead centre [Pa].
    """
    return keys_of(locals())


def piece(
    *, length: Value, diameter: Value, bore: Value | None = None,
) -> Table:
    """Return a table `piece`.

    A round piece of a shaft.

    Parameters
    ----------
    length
        Length along the axis [m].
    diameter
        Outer diameter [m].
    bore
        Diameter of the bore [m].
    """
    return keys_of(locals())


def piston_pin(
    *, diameter: Value, length: Value, bore: Value | None = None, in_bosses: Value | None = None,
    span: Value | None = None,
) -> Table:
    """Return a table `piston_pin`.

    The pin of every piston.

    Parameters
    ----------
    diameter
        Outer diameter [m].
    length
        Length along the axis [m].
    bore
        Diameter of the bore [m].
    in_bosses
        Share of the length of the pin that the bosses hold.
    span
        Distance between the middles of the bosses; by default it follows from in_bosses [m].
    """
    return keys_of(locals())


def plane(
    name: str, *, measured: Table, radius: Value, x: Value | None = None, angles: Values | None = None,
    places: int | None = None, first_place: Value | None = None, allowed: Sequence[Values] | Array | None = None,
    solid: Sequence[Values] | Array | None = None, max_depth: Value | None = None,
    permitted_unbalance: Value | None = None,
) -> Table:
    """Return a table `plane`.

    Correction plane: a counterweight or disc, its unbalance, and the places for holes.

    Parameters
    ----------
    name
        Name of the plane in lists and pictures.
    measured
        Unbalance before correction, as the machine shows it.
    radius
        Radius of the hole circle, or of the surface that radial holes start from [m].
    x
        Place along the axis; needed with the centre of mass [m].
    angles
        Angles of the places on the crank, counted with the rotation [rad].
    places
        Number of places in equal steps, in place of their angles.
    first_place
        Angle of the first of places in equal steps, on the crank [rad].
    allowed
        Sectors for holes, each from an angle on the crank to another, with the rotation; by default the whole circle
        [rad].
    solid
        Sectors that no hole may touch [rad].
    max_depth
        Largest depth in this plane, in place of that of all [m].
    permitted_unbalance
        Permitted residual unbalance of this plane [kg m].
    """
    return keys_of(locals())


def pump(
    *, suction: Value, delivery: Value,
) -> Table:
    """Return a table `pump`.

    A piston pump.

    Parameters
    ----------
    suction
        Absolute pressure of the suction stroke [Pa].
    delivery
        Absolute pressure of the delivery stroke [Pa].
    """
    return keys_of(locals())


def recorded(
    *, file: str, sheet: str | None = None, angle_column: str | int | None = None, angle_unit: str | None = None,
    cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
    pressure_column: str | int | Sequence[str | int] | None = None, pressure_unit: str | None = None,
    gauge: bool | None = None, peg: Table | None = None,
) -> Table:
    """Return a table `recorded`.

    A recorded trace of pressure.

    Parameters
    ----------
    file
        Text file, .xlsx or .mat file beside the problem: crank angle, and values over it.
    sheet
        Sheet of a spreadsheet; by default that with the most rows of numbers.
    angle_column
        Name or number of the column of crank angles, if it is not evident.
    angle_unit
        Unit of the angles, if it is not in the file; deg by default.
    cycles
        Of several cycles: their mean, the one with the highest peak, or that with this number.
    smooth
        false keeps the noise of the measurement.
    pressure_column
        Name or number of the column of pressures, or several that are cycles of the cylinder.
    pressure_unit
        Unit of the pressures, if it is not in the file; bar by default.
    gauge
        true: pressures count from crankcase_pressure. By default they are absolute.
    peg
        Moves a floating pressure to a known one, at one angle.
    """
    return keys_of(locals())


def rim(
    *, mean_diameter: Value, width: Value, height: Value, density: Value | None = None, whole: Value | None = None,
    arms: Table | None = None,
) -> Table:
    """Return a table `rim`.

    A ring of a rectangular section.

    Parameters
    ----------
    mean_diameter
        Mean of the inner and outer diameter of the rim [m].
    width
        Width along the shaft [m].
    height
        Height of the rim along a radius [m].
    density
        Density of the rim; by default that of cast iron [kg/m^3].
    whole
        Mass of the whole flywheel over that of its rim.
    arms
        Arms between hub and rim.
    """
    return keys_of(locals())


def rod_size(
    *, width: Value, thickness: Value, big_end: Value, small_end: Value | None = None,
) -> Table:
    """Return a table `rod_size`.

    Rod as a part that weights must not hit.

    Parameters
    ----------
    width
        Width of the shank across the shaft [m].
    thickness
        Width along the shaft [m].
    big_end
        Outer diameter of the big end [m].
    small_end
        Outer diameter of the small end [m].
    """
    return keys_of(locals())


def rod(
    *, mass: Value, centre_of_gravity: Value, inertia: Value,
) -> Table:
    """Return a table `rod`.

    Connecting rod as a rigid body.

    Parameters
    ----------
    mass
        Mass [kg].
    centre_of_gravity
        Distance of the centre of gravity from the crank pin, on the line of the pins [m].
    inertia
        Moment of inertia about the centre of gravity [kg m^2].
    """
    return keys_of(locals())


def round_part(
    name: str, *, position: Values, radius: Value, x: Values | None = None,
) -> Table:
    """Return a table `round_part`.

    Round part along the shafts, such as a camshaft.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    position
        Position of its axis: y to the left, z up [m].
    radius
        Radius that it takes, such as that of a cam [m].
    x
        Rear and front end; without them it is as long as the engine [m].
    """
    return keys_of(locals())


def shaft(
    name: str, *, position: Values, ratio: Number | None = None, lead: Value | None = None,
) -> Table:
    """Return a table `shaft`.

    Crankshaft in a free list of parts.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    position
        Position of the axis: y to the left, z up [m].
    ratio
        Speed over crank speed; negative turns against the crank.
    lead
        Crank angle by which all that it carries comes earlier [rad].
    """
    return keys_of(locals())


def shank(
    *, diameter: Value, bore: Value | None = None,
) -> Table:
    """Return a table `shank`.

    The round shank of every rod.

    Parameters
    ----------
    diameter
        Outer diameter [m].
    bore
        Diameter of the bore [m].
    """
    return keys_of(locals())


def single_cylinder(
    *, cylinders: int | Sequence[int], bore: Value | None = None, stroke: Value | None = None,
    rod_ratio: Value | None = None, rod_length: Value | None = None, offset: Value | None = None,
    reciprocating_mass: Value | None = None, rotating_mass: Value | None = None, rod: Table | None = None,
    rod_inertia_deficit: Value | None = None, second_reciprocating_mass: Value | None = None,
    articulated_rod: Table | None = None, knuckle_mass: Value | None = None, rotor_mass: Value | None = None,
    rotor_inertia: Value | None = None,
) -> Table:
    """Return a table `single_cylinder`.

    Cylinders that differ from the others; missing keys are those of [engine].

    Parameters
    ----------
    cylinders
        Their numbers; with two pistons in a cylinder the keys count for both.
    bore
        Diameter of the cylinder; 0 for a piston on which no gas acts [m].
    stroke
        Travel of the piston: twice the crank radius [m].
    rod_ratio
        Crank radius over rod length.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Offset at the crank radius of [engine], or at that of a stroke beside it [m].
    reciprocating_mass
        Reciprocating mass as weighed; rotating_mass has the rest [kg].
    rotating_mass
        Rotating mass that belongs to this cylinder, by default an equal share of that of its throw [kg].
    rod
        Connecting rod as a rigid body.
    rod_inertia_deficit
        What two masses at the ends of the rod lack of its inertia [kg m^2].
    second_reciprocating_mass
        Reciprocating mass of each piston of the second crank; by default that of the others [kg].
    articulated_rod
        Articulated rod as a rigid body, counted from its knuckle pin.
    knuckle_mass
        Mass at every knuckle pin, beside the share of articulated_rod [kg].
    rotor_mass
        Mass of a rotor with its seals; rotating_mass is that of the eccentric [kg].
    rotor_inertia
        Moment of inertia of a rotor about its centre [kg m^2].
    """
    return keys_of(locals())


def single_gas(
    *, cylinders: int | Sequence[int], imep: Value | None = None, peak_pressure: Value | None = None,
    compression_ratio: Value | None = None,
) -> Table:
    """Return a table `single_gas`.

    Cylinders whose gas differs; missing keys are those of [gas].

    Parameters
    ----------
    cylinders
        Their numbers.
    imep
        Indicated mean effective pressure of these cylinders [Pa].
    peak_pressure
        Peak pressure of these cylinders, with model seiliger [Pa].
    compression_ratio
        Largest over smallest volume of the cylinder.
    """
    return keys_of(locals())


def slider_crank(
    *, x: Value, bank_angle: Value | None = None, throw: Value | None = None, firing_angle: Value | None = None,
    shaft: str | None = None, stroke: Value | None = None, bore: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod_inertia_deficit: Value | None = None,
) -> Table:
    """Return a table `slider_crank`.

    Slider-crank in a free list of parts; missing keys are those of [engine].

    Parameters
    ----------
    x
        Place along the crank, forward of the middle of the engine [m].
    bank_angle
        Angle of the cylinder axis, from upright towards the left [rad].
    throw
        Angle of the throw, in the sense of rotation [rad].
    firing_angle
        Crank angle at which it fires [rad].
    shaft
        The shaft that it stands on, by name.
    stroke
        Travel of the piston: twice the crank radius [m].
    bore
        Diameter of the cylinder; 0 for a piston on which no gas acts [m].
    rod_ratio
        Crank radius over rod length.
    rod_length
        Distance of the two bearings of the rod [m].
    offset
        Distance of the piston pin's path from the crank axis [m].
    reciprocating_mass
        Mass of the piston with pin and rings, and the rod's share [kg].
    rotating_mass
        Mass at the crank pin that is not balanced [kg].
    rod_inertia_deficit
        What two masses at the ends of the rod lack of its inertia [kg m^2].
    """
    return keys_of(locals())


def slugs(
    *, density: Value, diameters: Values,
) -> Table:
    """Return a table `slugs`.

    Slugs of heavy metal, which fill holes of their diameter.

    Parameters
    ----------
    density
        Density of the heavy metal [kg/m^3].
    diameters
        Diameters of the slugs, and of their holes [m].
    """
    return keys_of(locals())


def steam(
    *, admission: Value, back_pressure: Value, cut_off: Value, release: Value | None = None,
    compression: Value | None = None, lead: Value | None = None, clearance: Value | None = None,
    exponent: Value | None = None,
) -> Table:
    """Return a table `steam`.

    An indicator diagram of straight lines and hyperbolas, its points parts of the stroke.

    Parameters
    ----------
    admission
        Absolute pressure of the steam that enters [Pa].
    back_pressure
        Absolute pressure against which the steam leaves [Pa].
    cut_off
        Part of the stroke from the dead centre at which admission ends.
    release
        Part of the stroke at which the outlet opens.
    compression
        Part of the stroke before the dead centre at which the outlet closes on the way back.
    lead
        Part of the stroke before the dead centre at which fresh steam enters on the way back.
    clearance
        Volume left at the dead centre, over that of the stroke.
    exponent
        Exponent of expansion and compression; 1, a hyperbola, by default.
    """
    return keys_of(locals())


def stop(
    *, gap: Value, stiffness: Value,
) -> Table:
    """Return a table `stop`.

    Bump stop along each of the mount's own axes; it acts in run-ups and load cases.

    Parameters
    ----------
    gap
        Travel until the stop is met [m].
    stiffness
        Force for each unit of travel, or torque for each unit of twist [N/m].
    """
    return keys_of(locals())


def term(
    *, quantity: QuantityName, mounts: Sequence[str] | None = None, bearings: Sequence[str] | None = None,
    cylinders: Sequence[str] | None = None, sections: Sequence[str] | None = None, webs: Sequence[str] | None = None,
    receivers: Sequence[str] | None = None, operating_points: Sequence[str] | None = None, orders: Values | None = None,
    alternating: bool | None = None, direction_weights: Values | None = None, load_cases: Sequence[str] | None = None,
    motions: Sequence[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = None,
    wanted: Number | None = None, frequency: Value | None = None, weight: Number | None = None,
) -> Table:
    """Return a table `term`.

    Term of a weighted objective.

    Parameters
    ----------
    quantity
        What is measured.
    mounts
        Names of the mounts that count; all by default.
    bearings
        Names of the main bearings that count; all by default.
    cylinders
        Names of the cylinders that count; all by default.
    sections
        Sections of the crankshaft that count, named after the discs that they join; all by default.
    webs
        Webs, with the journals beside them, that count: cylinder 1 front, cylinder 1 rear ...
    receivers
        Receivers that count, by name; all by default.
    operating_points
        Names of the operating points that count; all by default.
    orders
        Orders that count, as multiples of crank speed; all by default.
    alternating
        Whether the mean of a load over the cycle is left out: the steady reaction to the mean torque is then no part.
    direction_weights
        Weights of the components along x, y and z.
    load_cases
        Load cases that count, by name; all by default.
    motions
        Motions that should have a mode of their own; all by default.
    wanted
        Share of a motion in a mode of its own that is enough; 1 by default.
    frequency
        Wanted natural frequency about the torque-roll axis; of a raw residual it may be open, or left out [Hz].
    weight
        How much it counts beside the others.
    """
    return keys_of(locals())


def torsion_shaft(
    *, pieces: Sequence[Table] | None = None, diameter: Value | None = None, bore: Value | None = None,
    damping: Value | None = None, loss_factor: Value | None = None, stiffness: Value | None = None,
) -> Table:
    """Return a table `torsion_shaft`.

    A shaft between two discs: its stiffness, or what it follows from.

    Parameters
    ----------
    pieces
        Round pieces, one behind another, in place of the stiffness.
    diameter
        Diameter of the weakest section, needed for a stress; by default that of the pieces [m].
    bore
        Diameter of the bore [m].
    damping
        Viscous damping [N m s/rad].
    loss_factor
        Hysteretic loss factor: energy lost in a cycle over 2 pi times the energy stored.
    stiffness
        Force for each unit of travel, or torque for each unit of twist [N m/rad].
    """
    return keys_of(locals())


def transfer_functions(
    *, x: str | None = None, y: str | None = None, z: str | None = None, sound: str | None = None,
) -> Table:
    """Return a table `transfer_functions`.

    CSV files of the transfer functions from mount forces to a receiver, by the direction of its response.

    Parameters
    ----------
    x
        File of the response along x.
    y
        File of the response along y.
    z
        File of the response along z.
    sound
        File of the sound pressure.
    """
    return keys_of(locals())


def unbalance(
    name: str | None = None, *, x: Value | None = None, unbalance: Value | complex | None = None,
    mass: Value | complex | None = None, radius: Value | None = None, angle: Value | None = None,
    coupled: Table | None = None, body: Table | None = None,
) -> Table:
    """Return a table `unbalance`.

    Unbalance of a shaft.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    x
        Place along the crank, forward of the middle of the engine [m].
    unbalance
        Mass times the distance of its centre of gravity from the axis of rotation [kg m].
    mass
        Mass [kg].
    radius
        Distance of its centre of gravity from the axis of rotation [m].
    angle
        Angle at which it stands when cylinder 1 is at its firing dead centre, from upright in the sense of rotation
        [rad].
    coupled
        Unbalance that follows another one.
    body
        Body of a weight, from which its mass and unbalance follow.
    """
    return keys_of(locals())


def wall(
    name: str, *, angle: Value, distance: Value,
) -> Table:
    """Return a table `wall`.

    Flat wall along the shafts, such as a sump.

    Parameters
    ----------
    name
        Name in tables, pictures and messages.
    angle
        Direction from the crank axis to the wall: 0 is up, 90 left, 180 down [rad].
    distance
        Distance of the wall from the crank axis [m].
    """
    return keys_of(locals())


def webs(
    *, width: Value, thickness: Value,
) -> Table:
    """Return a table `webs`.

    The two webs adjacent to every pin.

    Parameters
    ----------
    width
        Width of a web across the shaft [m].
    thickness
        Width along the shaft [m].
    """
    return keys_of(locals())
