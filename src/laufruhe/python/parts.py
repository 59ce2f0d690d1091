"""Parts and settings of an engine in code.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

from laufruhe.problem.goals import QuantityName
from laufruhe.problem.number_types import Array, Number, Table, Value, Values
from laufruhe.python.keys import Parts, describe, keys_of


class EngineParts(Parts):
    """Methods that add a table of a problem file to an engine; each returns a new engine."""

    def units(
        self, *, force: str | None = None, mass: str | None = None, unbalance: str | None = None,
        length: str | None = None, torque: str | None = None, inertia: str | None = None, power: str | None = None,
    ) -> Self:
        """Return the engine with units.

        Units of the report's tables and of the screen; other files stay in SI units and in those of their heads.
        """
        return self._with("units", "units", keys_of(locals()))

    def quantities(self, *, stroke_over_bore: Value | None = None) -> Self:
        """Return the engine with quantities. Numbers that several numbers of the file follow."""
        return self._with("quantities", "quantities", keys_of(locals()))

    def phasing(
        self, *, phases: int | None = None, intervals: Table | None = None, best: int | None = None,
        rank_orders_by: Sequence[Literal["roll moment", "neighbours", "longest gap"]] | None = None,
        most_shafts: int | None = None, most_shaft_mass: Number | None = None, time_limit: Number | None = None,
        method: Literal["auto", "search", "program", "enumeration"] | None = None,
    ) -> Self:
        """Return the engine with phasing. Search of open throws, firing orders and shafts."""
        return self._with("phasing", "phasing", keys_of(locals()))

    def operating_point(
        self, name: str | None = None, *, misfire: Sequence[int] | Literal["each"] | None = None,
        cut: Sequence[int] | None = None, cut_valves: Literal["closed", "open"] | None = None,
        speed: Value | None = None, mean_piston_speed: Value | None = None, imep: Value | None = None,
        peak_pressure: Value | None = None, intake_pressure: Value | None = None, bmep: Value | None = None,
        brake_torque: Value | None = None, motored: bool | None = None, gas: bool | None = None,
        up_to: Value | None = None, steps: int | None = None, weight: Value | None = None,
        pressure_file: str | Table | None = None,
    ) -> Self:
        """Return the engine with an operating point. Speeds and loads at which the engine is looked at."""
        return self._with("operating_points", "operating_point", keys_of(locals()))

    def gas_seiliger(
        self, *, peak_pressure: Value, crankcase_pressure: Value | None = None, compression_ratio: Value | None = None,
        intake_pressure: Value | None = None, exhaust_pressure: Value | None = None, imep: Value | None = None,
        single_cylinders: Sequence[Table] | None = None, compression_exponent: Value | None = None,
        expansion_exponent: Value | None = None, chambers: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with gas seiliger. Pressure in the cylinders; without it no gas is computed."""
        return self._with("gas", "gas_seiliger", keys_of(locals(), {'model': 'seiliger'}))

    def gas_wiebe(
        self, *, start: Value, duration: Value, crankcase_pressure: Value | None = None,
        compression_ratio: Value | None = None, intake_pressure: Value | None = None,
        exhaust_pressure: Value | None = None, imep: Value | None = None,
        single_cylinders: Sequence[Table] | None = None, shape: Value | None = None, completeness: Value | None = None,
        heat_ratio: Value | None = None, chambers: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with gas wiebe. Pressure in the cylinders; without it no gas is computed."""
        return self._with("gas", "gas_wiebe", keys_of(locals(), {'model': 'wiebe'}))

    def gas_chambers(self, *, chambers: Sequence[Table], crankcase_pressure: Value | None = None) -> Self:
        """Return the engine with gas chambers. Pressure in the cylinders; without it no gas is computed."""
        return self._with("gas", "gas_chambers", keys_of(locals(), {'model': 'chambers'}))

    def gas_trace(
        self, *, file: str, crankcase_pressure: Value | None = None, sheet: str | None = None,
        angle_column: str | int | None = None, angle_unit: str | None = None,
        cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
        pressure_column: str | int | Sequence[str | int] | None = None, pressure_unit: str | None = None,
        gauge: bool | None = None, peg: Table | None = None, angle_zero: Number | None = None,
        cylinder_columns: Sequence[str | int] | None = None, motored_column: str | int | None = None,
        cylinder_angles: Literal["own", "common"] | None = None, single_cylinders: Sequence[Table] | None = None,
        chambers: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with gas trace. Pressure in the cylinders; without it no gas is computed."""
        return self._with("gas", "gas_trace", keys_of(locals(), {'model': 'trace'}))

    def friction(
        self, *, file: str | None = None, kind: Literal["fuel", "motoring"] | None = None,
        speed_unit: str | None = None, load_unit: str | None = None, fmep: Number | None = None,
        deviation: Number | None = None, deviations: Number | None = None,
    ) -> Self:
        """Return the engine with friction.

        Friction mean effective pressure, measured in a CSV file or given, with its uncertainty.
        """
        return self._with("friction", "friction", keys_of(locals()))

    def mounts(
        self, *, kind: Literal["rigid", "elastic"] | None = None, axes: Table | None = None,
        positions: Sequence[Values] | Array | None = None, names: Sequence[str] | None = None,
        relative_stiffness: Values | None = None, stiffness: Values | None = None, loss_factor: Value | None = None,
        damping_per_stiffness: Value | None = None, stop: Table | None = None, places: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with mounts. How the engine is held."""
        return self._with("mounts", "mounts", keys_of(locals()))

    def block(
        self, *, mass: Value, inertia: Values, centre_of_gravity: Values | None = None, axes: Table | None = None,
        inertia_products: Values | None = None, turning_inertia: Value | None = None,
    ) -> Self:
        """Return the engine with block. The rigid body that elastic mounts carry."""
        return self._with("block", "block", keys_of(locals()))

    def load_case(
        self, name: str, *, times_weight: Values | None = None, torque: Value | None = None,
        force: Values | None = None, place: Values | None = None,
    ) -> Self:
        """Return the engine with a load case.

        Static load: weight, a bump, a torque. Travel counts from the position of the engine without it.
        """
        return self._with("load_cases", "load_case", keys_of(locals()))

    def load_torque(
        self, *, file: str, sheet: str | None = None, angle_column: str | int | None = None,
        angle_unit: str | None = None, cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
        torque_column: str | int | Sequence[str | int] | None = None, torque_unit: str | None = None,
        angle_zero: Value | None = None,
    ) -> Self:
        """Return the engine with load torque.

        Torque of the driven machine over the crank angle, in place of a constant one.
        """
        return self._with("load_torque", "load_torque", keys_of(locals()))

    def geared_inertia(self, name: str, *, share: Value, ratio: Number | None = None) -> Self:
        """Return the engine with a geared inertia. A second crank, or a flywheel on a shaft of its own."""
        return self._with("geared_inertias", "geared_inertia", keys_of(locals()))

    def counterweight(
        self, name: str, *, shaft: str | None = None, balance_factor: Value | None = None,
        balance_fraction: Value | None = None, throws: Sequence[int] | None = None, x: Value | None = None,
        opposite_throw: int | None = None, unbalance: Value | complex | None = None,
        mass: Value | complex | None = None, radius: Value | None = None, angle: Value | None = None,
        body: Table | None = None,
    ) -> Self:
        """Return the engine with a counterweight. Weights on the crankshaft."""
        return self._with("counterweights", "counterweight", keys_of(locals()))

    def balancer_shaft(
        self, name: str, *, ratio: Number, position: Values, unbalances: Sequence[Table], optional: bool | None = None,
        shaft_mass: Value | None = None,
    ) -> Self:
        """Return the engine with a balancer shaft. Shafts with weights that turn beside the crankshaft."""
        return self._with("balancer_shafts", "balancer_shaft", keys_of(locals()))

    def fidelity(
        self, *, kinematics: Literal["exact", "two-order", "auto"] | None = None, tolerance: Number | None = None,
        rod: Literal["rigid", "mass-only"] | None = None, gas: bool | None = None, gas_samples: int | None = None,
        gas_orders: int | None = None, orders: int | None = None, crank_inertia: Number | None = None,
        crankshaft: Literal["cut", "beam"] | None = None, mounts: Literal["frequency", "rigid", "time"] | None = None,
        modes: Sequence[int] | None = None, samples: int | None = None,
    ) -> Self:
        """Return the engine with fidelity. Fidelity of the physics; exact by default."""
        return self._with("fidelity", "fidelity", keys_of(locals()))

    def search(self, *, starts: int | None = None, seed: int | None = None, boxes: int | None = None) -> Self:
        """Return the engine with search. Settings of searches for problems that are not convex."""
        return self._with("search", "search", keys_of(locals()))

    def bob_weights(
        self, *, balance_factor: Number, big_end: Number | Values, bearing_shells: Number | Values | None = None,
        piston: Number | Values | None = None, pin: Number | Values | None = None, rings: Number | Values | None = None,
        locks: Number | Values | None = None, small_end: Number | Values | None = None, oil: Number | None = None,
    ) -> Self:
        """Return the engine with bob weights.

        Parts on the throws, for the bob weights that stand for them while the crankshaft is balanced.
        """
        return self._with("bob_weights", "bob_weights", keys_of(locals()))

    def correction(
        self, *, planes: Sequence[Table], density: Number, drills: Values, depth_step: Number, max_depth: Number,
        goal: Literal["fewest holes", "least residual"] | None = None,
        direction: Literal["axial", "radial"] | None = None, point_angle: Number | None = None,
        min_depth: Number | None = None, wall: Number | None = None, max_holes: int | None = None,
        slugs: Table | None = None, permitted_unbalance: str | None = None, rotor_mass: Number | None = None,
        service_speed: Number | None = None, centre_of_mass: Number | None = None, zero_mark: Number | None = None,
        machine_counts: Literal["with rotation", "against rotation"] | None = None,
    ) -> Self:
        """Return the engine with correction. Holes and slugs that correct the unbalance of a rotor in two planes."""
        return self._with("correction", "correction", keys_of(locals()))

    def main_bearing(
        self, name: str | None = None, *, x: Value | None = None, beside_throws: Value | None = None,
        shaft: str | None = None, diameter: Value | None = None, width: Value | None = None,
        friction: Value | None = None,
    ) -> Self:
        """Return the engine with a main bearing. Bearings of the crankshaft in the block."""
        return self._with("main_bearings", "main_bearing", keys_of(locals()))

    def electric_machine(
        self, name: str, *, shaft: str | None = None, stator: Literal["block", "ground"] | None = None,
        disc: str | None = None, mean_torque: Value | None = None, orders: Values | None = None,
        harmonics: Sequence[Table] | None = None, max_torque: Value | None = None, torque_constant: Value | None = None,
        max_current: Value | None = None, resistance: Value | None = None, max_loss: Value | None = None,
    ) -> Self:
        """Return the engine with an electric machine. A motor or generator whose torque follows the crank angle."""
        return self._with("electric_machines", "electric_machine", keys_of(locals()))

    def flywheel(
        self, *, inertia: Value | None = None, mass: Value | None = None, mean_diameter: Value | None = None,
        rim: Table | None = None, crankshaft_inertia: Value | None = None,
    ) -> Self:
        """Return the engine with flywheel. Parts that turn at crank speed, without pistons and rods."""
        return self._with("flywheel", "flywheel", keys_of(locals()))

    def measurement(
        self, *, file: str, quantity: str | None = None, unit: str | None = None,
        amplitude: Literal["peak", "rms"] | None = None, deviation: Number | None = None, values: Table | None = None,
    ) -> Self:
        """Return the engine with a measurement.

        Orders that were measured in one run, to identify the open numbers of the file.
        """
        return self._with("measurements", "measurement", keys_of(locals()))

    def choice(
        self, name: str, *, file: str, parts: Sequence[str] | None = None, sets: Table | None = None,
        count: int | None = None,
    ) -> Self:
        """Return the engine with a choice. A part to choose: one row of a CSV file with the parts of a maker."""
        return self._with("choices", "choice", keys_of(locals()))

    def parts_price(self, *, total: Number) -> Self:
        """Return the engine with parts price.

        Price of the parts that the lists replace, in the currency of the lists.
        """
        return self._with("parts_price", "parts_price", keys_of(locals()))

    def frame(
        self, *, mass: Value, inertia: Values, centre_of_gravity: Values | None = None,
        inertia_products: Values | None = None, springs: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with frame.

        Rigid frame under the mounts of the engine, for receivers alone; other quantities have rigid ground there.
        """
        return self._with("frame", "frame", keys_of(locals()))

    def receiver(
        self, name: str, *, unit: Literal["m/s^2", "m/s", "Pa"] | None = None, point: Values | None = None,
        on: Literal["engine", "frame"] | None = None, transfer_functions: Table | None = None,
        force: Literal["rigid ground", "frame"] | None = None, band: Values | None = None,
        weighting: str | Sequence[str] | None = None,
    ) -> Self:
        """Return the engine with a receiver.

        A point at which vibration or sound is felt: a handlebar, a seat, an ear.
        """
        return self._with("receivers", "receiver", keys_of(locals()))

    def tolerances(
        self, *, residual_unbalance: str | None = None, rotor_mass: Number | None = None, planes: int | None = None,
        law: Literal["uniform", "normal"] | None = None,
    ) -> Self:
        """Return the engine with tolerances. Tolerances of built engines that no number of the drawing has."""
        return self._with("tolerances", "tolerances", keys_of(locals()))

    def robust(self, *, over: str | None = None, engines: int | None = None, seed: int | None = None) -> Self:
        """Return the engine with robust.

        Design for engines as built: for the worst case within the tolerances, or for a share of them.
        """
        return self._with("robust", "robust", keys_of(locals()))

    def assembly(self, *, pistons: str | None = None, rods: str | None = None, mass_unit: str | None = None) -> Self:
        """Return the engine with assembly.

        Measured pistons and rods; the optimiser decides which goes into which cylinder.
        """
        return self._with("assembly", "assembly", keys_of(locals()))

    def run_up(
        self, *, up_to: Value, time: Value | None = None, shut_down_time: Value | None = None,
        operating_point: str | None = None,
    ) -> Self:
        """Return the engine with run up. Run from rest to a speed and back, through resonance."""
        return self._with("run_up", "run_up", keys_of(locals()))

    def running_gear(
        self, *, density: Value | None = None, elastic_modulus: Value | None = None, webs: Table | None = None,
        rod: Table | None = None, piston_pin: Table | None = None, bolts: Table | None = None,
    ) -> Self:
        """Return the engine with running gear.

        Sizes of webs, rods, bolts and piston pins, from which their stresses follow.
        """
        return self._with("running_gear", "running_gear", keys_of(locals()))

    def speed_range(
        self, name: str, *, speeds: Values, mounts: Sequence[str] | None = None, bearings: Sequence[str] | None = None,
        cylinders: Sequence[str] | None = None, sections: Sequence[str] | None = None,
        webs: Sequence[str] | None = None, receivers: Sequence[str] | None = None,
        electric_machines: Sequence[str] | None = None, operating_points: Sequence[str] | None = None,
        orders: Values | None = None, alternating: bool | None = None, direction_weights: Values | None = None,
        load_cases: Sequence[str] | None = None,
        motions: Sequence[Literal["fore-aft", "lateral", "bounce", "roll", "pitch", "yaw"]] | None = None,
        wanted: Number | None = None, frequency: Value | None = None, operating_point: str | None = None,
        quantity: QuantityName | None = None, minimise: bool | None = None,
        max: str | Sequence[Values] | Array | None = None, time_shares: str | Sequence[Values] | Array | None = None,
    ) -> Self:
        """Return the engine with a speed range.

        A range of crank speeds over which the worst value of a quantity is found, minimised or limited.
        """
        return self._with("speed_ranges", "speed_range", keys_of(locals()))

    def torsion(
        self, *, throw_inertia: Value | Values, cylinder_damping: Value | Values | None = None,
        loss_factor: Value | None = None, shear_modulus: Value | None = None, speeds: Values | None = None,
        output: str | None = None, crank: Table | None = None, discs: Sequence[Table] | None = None,
        branches: Sequence[Table] | None = None, absorbers: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with torsion. Discs and shafts of the torsional system of the crankshaft."""
        return self._with("torsion", "torsion", keys_of(locals()))

    def crankcase(
        self, *, clearance: Value | None = None, skirt: Value | None = None, rod: Table | None = None,
        walls: Sequence[Table] | None = None, round_parts: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with crankcase. Space in which weights turn."""
        return self._with("crankcase", "crankcase", keys_of(locals()))


describe(vars(EngineParts))
