"""Tables inside the tables of a problem file, such as an unbalance of a shaft.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from laufruhe.problem.goals import QuantityName
from laufruhe.problem.number_types import Array, Number, Table, Value, Values
from laufruhe.python.keys import describe, keys_of


def absorber(
    name: str, *, on: str, inertia: Value, damping: Value | None = None, stiffness: Value | None = None,
    loss_factor: Value | None = None, order: Value | None = None, damping_ratio: Value | None = None,
) -> Table:
    """Return a table `absorber`. A viscous or rubber damper, or a pendulum."""
    return keys_of(locals())


def arms(*, count: int, at_rim: Values, at_hub: Values, hub_diameter: Value) -> Table:
    """Return a table `arms`. Oval arms between hub and rim."""
    return keys_of(locals())


def axes(
    *, crank: Values | Literal["+x", "-x", "+y", "-y", "+z", "-z"],
    up: Values | Literal["+x", "-x", "+y", "-y", "+z", "-z"], origin: Values | None = None,
) -> Table:
    """Return a table `axes`.

    Axes of a file that are not those of the engine: where the engine points in them, and where it stands.
    """
    return keys_of(locals())


def big_end(*, diameter: Value, width: Value) -> Table:
    """Return a table `big_end`. Big-end bearing of the rod on the crank pin."""
    return keys_of(locals())


def body(
    *, kind: Literal["sector", "slab", "cheek"], outer_radius: Value, thickness: Value,
    inner_radius: Value | None = None, angle: Value | None = None, width: Value | None = None,
    tail: Value | None = None, fillet: Value | None = None, density: Value | None = None, spacing: Value | None = None,
) -> Table:
    """Return a table `body`. Body of a weight, from which its mass and unbalance follow."""
    return keys_of(locals())


def bolts(*, diameter: Value, count: int | None = None) -> Table:
    """Return a table `bolts`. The bolts of every big end."""
    return keys_of(locals())


def branch_disc(name: str, *, inertia: Value, shaft: Table, damping: Value | None = None) -> Table:
    """Return a table `branch_disc`. A disc of a branch."""
    return keys_of(locals())


def branch(*, on: str, ratio: Number, gear_inertia: Value | None = None, discs: Sequence[Table] | None = None) -> Table:
    """Return a table `branch`.

    Shaft that gears, a belt or a chain drive from a disc: a camshaft, pump, propeller or generator.
    """
    return keys_of(locals())


def chamber(
    name: str | None = None, *, end: Literal["head", "crank"], bore: Value, cylinders: Sequence[int] | None = None,
    rod: Value | None = None, steam: Table | None = None, pump: Table | None = None, compressor: Table | None = None,
    trace: Table | None = None,
) -> Table:
    """Return a table `chamber`. A space on one side of a piston, or of a further piston on the same rod."""
    return keys_of(locals())


def compressor(
    *, suction: Value, delivery: Value, clearance: Value | None = None, exponent: Value | None = None,
) -> Table:
    """Return a table `compressor`. A piston compressor of gas with ideal valves."""
    return keys_of(locals())


def coupled(*, to: str, how: Literal["equal", "opposite", "mirrored", "mirrored opposite"]) -> Table:
    """Return a table `coupled`. Unbalance that follows another one."""
    return keys_of(locals())


def crank(
    *, pieces: Sequence[Table] | None = None, diameter: Value | None = None, bore: Value | None = None,
    damping: Value | None = None, loss_factor: Value | None = None, stiffness: Value | Values | None = None,
) -> Table:
    """Return a table `crank`. Shafts from throw to throw."""
    return keys_of(locals())


def disc(
    name: str, *, inertia: Value, shaft: Table, end: Literal["front", "rear"], damping: Value | None = None,
) -> Table:
    """Return a table `disc`. A disc in addition to the throws."""
    return keys_of(locals())


def dynamic_stiffness(
    *, file: str, axis: Literal["x", "y", "z"] | None = None, frequency_unit: str | None = None,
    stiffness_unit: str | None = None, columns: Literal["stiffness and loss", "amount and angle"] | None = None,
) -> Table:
    """Return a table `dynamic_stiffness`.

    Complex stiffness along an own axis from a CSV file: frequency, stiffness, and loss or its angle.
    """
    return keys_of(locals())


def fluid_track(
    *, mass: Value, bulge_stiffness: Value, axis: Literal["x", "y", "z"] | None = None,
    chamber_stiffness: Value | None = None, damping: Value | None = None,
) -> Table:
    """Return a table `fluid_track`.

    The fluid of a hydraulic mount, all referred to its travel by the area of the piston.
    """
    return keys_of(locals())


def frame_spring(
    *, position: Values, stiffness: Values, loss_factor: Value | None = None, damping: Values | None = None,
) -> Table:
    """Return a table `frame_spring`. Spring between frame and ground."""
    return keys_of(locals())


def harmonic(*, order: Number, torque: Value, angle: Value | None = None, operating_point: str | None = None) -> Table:
    """Return a table `harmonic`. Torque of one order of the crank."""
    return keys_of(locals())


def intervals(
    *, min: Number | None = None, max: Number | None = None, largest_deviation: Number | None = None,
) -> Table:
    """Return a table `intervals`. Bounds on the crank angle from each firing to the next."""
    return keys_of(locals())


def measured(
    *, angle: Value, unbalance: Value | complex | None = None, mass: Value | complex | None = None,
    radius: Value | None = None,
) -> Table:
    """Return a table `measured`. Unbalance that the balancing machine shows in a plane."""
    return keys_of(locals())


def mount(
    name: str | None = None, *, position: Values | None = None, relative_stiffness: Values | None = None,
    turned: Values | None = None, stiffness: Values | None = None, loss_factor: Value | None = None,
    damping: Values | None = None, damping_per_stiffness: Value | None = None, like: str | None = None,
    mirror_of: str | None = None, fluid_track: Table | None = None, dynamic_stiffness: Table | None = None,
    joined_to: str | None = None, stop: Table | None = None,
) -> Table:
    """Return a table `mount`. Mount of the engine."""
    return keys_of(locals())


def peg(*, at: Value, to: Value) -> Table:
    """Return a table `peg`. Known pressure at an angle, to which a floating pressure is moved."""
    return keys_of(locals())


def piece(*, length: Value, diameter: Value, bore: Value | None = None) -> Table:
    """Return a table `piece`. A round piece of a shaft."""
    return keys_of(locals())


def piston_pin(
    *, diameter: Value, length: Value, bore: Value | None = None, in_bosses: Value | None = None,
    span: Value | None = None,
) -> Table:
    """Return a table `piston_pin`. The pin of every piston."""
    return keys_of(locals())


def plane(
    name: str, *, measured: Table, radius: Value, x: Value | None = None, angles: Values | None = None,
    places: int | None = None, first_place: Value | None = None, allowed: Sequence[Values] | Array | None = None,
    solid: Sequence[Values] | Array | None = None, max_depth: Value | None = None,
    permitted_unbalance: Value | None = None,
) -> Table:
    """Return a table `plane`. Correction plane: a counterweight or disc, its unbalance, and the places for holes."""
    return keys_of(locals())


def pump(*, suction: Value, delivery: Value) -> Table:
    """Return a table `pump`. A piston pump."""
    return keys_of(locals())


def recorded_gas(
    *, file: str, sheet: str | None = None, angle_column: str | int | None = None, angle_unit: str | None = None,
    cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
    pressure_column: str | int | Sequence[str | int] | None = None, pressure_unit: str | None = None,
    gauge: bool | None = None, peg: Table | None = None, angle_zero: Number | None = None,
    cylinder_columns: Sequence[str | int] | None = None, motored_column: str | int | None = None,
    cylinder_angles: Literal["own", "common"] | None = None,
) -> Table:
    """Return a table `recorded_gas`. Recorded pressures of the cylinders of an engine."""
    return keys_of(locals())


def recorded(
    *, file: str, sheet: str | None = None, angle_column: str | int | None = None, angle_unit: str | None = None,
    cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
    pressure_column: str | int | Sequence[str | int] | None = None, pressure_unit: str | None = None,
    gauge: bool | None = None, peg: Table | None = None,
) -> Table:
    """Return a table `recorded`. A recorded trace of pressure."""
    return keys_of(locals())


def rim(
    *, mean_diameter: Value, width: Value, height: Value, density: Value | None = None, whole: Value | None = None,
    arms: Table | None = None,
) -> Table:
    """Return a table `rim`. A ring of a rectangular section."""
    return keys_of(locals())


def rod_size(*, width: Value, thickness: Value, big_end: Value, small_end: Value | None = None) -> Table:
    """Return a table `rod_size`. Rod as a part that weights must not hit."""
    return keys_of(locals())


def rod(*, mass: Value, centre_of_gravity: Value, inertia: Value) -> Table:
    """Return a table `rod`. Connecting rod as a rigid body."""
    return keys_of(locals())


def round_part(name: str, *, position: Values, radius: Value, x: Values | None = None) -> Table:
    """Return a table `round_part`. Round part along the shafts, such as a camshaft."""
    return keys_of(locals())


def shaft(name: str, *, position: Values, ratio: Number | None = None, lead: Value | None = None) -> Table:
    """Return a table `shaft`. Crankshaft in a free list of parts."""
    return keys_of(locals())


def shank(*, diameter: Value, bore: Value | None = None) -> Table:
    """Return a table `shank`. The round shank of every rod."""
    return keys_of(locals())


def single_cylinder(
    *, cylinders: int | Sequence[int], bore: Value | None = None, stroke: Value | None = None,
    rod_ratio: Value | None = None, rod_length: Value | None = None, offset: Value | None = None,
    reciprocating_mass: Value | None = None, rotating_mass: Value | None = None, rod: Table | None = None,
    rod_inertia_deficit: Value | None = None, second_reciprocating_mass: Value | None = None,
    articulated_rod: Table | None = None, knuckle_mass: Value | None = None, rotor_mass: Value | None = None,
    rotor_inertia: Value | None = None,
) -> Table:
    """Return a table `single_cylinder`. Cylinders that differ from the others; missing keys are those of [engine]."""
    return keys_of(locals())


def single_gas(
    *, cylinders: int | Sequence[int], imep: Value | None = None, peak_pressure: Value | None = None,
    compression_ratio: Value | None = None,
) -> Table:
    """Return a table `single_gas`. Cylinders whose gas differs; missing keys are those of [gas]."""
    return keys_of(locals())


def slider_crank(
    *, x: Value, bank_angle: Value | None = None, throw: Value | None = None, firing_angle: Value | None = None,
    shaft: str | None = None, stroke: Value | None = None, bore: Value | None = None, rod_ratio: Value | None = None,
    rod_length: Value | None = None, offset: Value | None = None, reciprocating_mass: Value | None = None,
    rotating_mass: Value | None = None, rod_inertia_deficit: Value | None = None,
) -> Table:
    """Return a table `slider_crank`. Slider-crank in a free list of parts; missing keys are those of [engine]."""
    return keys_of(locals())


def slugs(*, density: Value, diameters: Values) -> Table:
    """Return a table `slugs`. Slugs of heavy metal, which fill holes of their diameter."""
    return keys_of(locals())


def steam(
    *, admission: Value, back_pressure: Value, cut_off: Value, release: Value | None = None,
    compression: Value | None = None, lead: Value | None = None, clearance: Value | None = None,
    exponent: Value | None = None,
) -> Table:
    """Return a table `steam`. An indicator diagram of straight lines and hyperbolas, its points parts of the stroke."""
    return keys_of(locals())


def stop(*, gap: Value, stiffness: Value) -> Table:
    """Return a table `stop`. Bump stop along each of the mount's own axes; it acts in run-ups and load cases."""
    return keys_of(locals())


def term(
    *, quantity: QuantityName, mounts: Sequence[str] | None = None, bearings: Sequence[str] | None = None,
    cylinders: Sequence[str] | None = None, sections: Sequence[str] | None = None, webs: Sequence[str] | None = None,
    receivers: Sequence[str] | None = None, electric_machines: Sequence[str] | None = None,
    operating_points: Sequence[str] | None = None, orders: Values | None = None, alternating: bool | None = None,
    direction_weights: Values | None = None, load_cases: Sequence[str] | None = None,
    motions: Sequence[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = None,
    wanted: Number | None = None, frequency: Value | None = None, weight: Number | None = None,
) -> Table:
    """Return a table `term`. Term of a weighted objective."""
    return keys_of(locals())


def torsion_shaft(
    *, pieces: Sequence[Table] | None = None, diameter: Value | None = None, bore: Value | None = None,
    damping: Value | None = None, loss_factor: Value | None = None, stiffness: Value | None = None,
) -> Table:
    """Return a table `torsion_shaft`. A shaft between two discs: its stiffness, or what it follows from."""
    return keys_of(locals())


def transfer_functions(
    *, x: str | None = None, y: str | None = None, z: str | None = None, sound: str | None = None,
) -> Table:
    """Return a table `transfer_functions`.

    CSV files of the transfer functions from mount forces to a receiver, by the direction of its response.
    """
    return keys_of(locals())


def unbalance(
    name: str | None = None, *, x: Value | None = None, unbalance: Value | complex | None = None,
    mass: Value | complex | None = None, radius: Value | None = None, angle: Value | None = None,
    coupled: Table | None = None, body: Table | None = None,
) -> Table:
    """Return a table `unbalance`. Unbalance of a shaft."""
    return keys_of(locals())


def wall(name: str, *, angle: Value, distance: Value) -> Table:
    """Return a table `wall`. Flat wall along the shafts, such as a sump."""
    return keys_of(locals())


def webs(*, width: Value, thickness: Value) -> Table:
    """Return a table `webs`. The two webs adjacent to every pin."""
    return keys_of(locals())


describe(globals())
