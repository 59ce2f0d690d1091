"""Parts and settings of an engine in code.

`python tests/schemas.py` makes this file of the models of problem files.
"""
# fmt: off

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

from laufruhe.problem.number_types import Array, Number, Table, Value, Values
from laufruhe.python.keys import Parts, keys_of


class EngineParts(Parts):
    """Methods that add a table of a problem file to an engine; each returns a new engine."""

    def units(
        self, *, force: str | None = None, mass: str | None = None, unbalance: str | None = None,
        length: str | None = None,
    ) -> Self:
        """Return the engine with units.

        Units of the report's tables and of the screen; other files stay in SI units and in those of their heads.

        Parameters
        ----------
        force
            Unit of forces.
        mass
            Unit of masses.
        unbalance
            Unit of unbalances.
        length
            Unit of lengths.
        """
        return self._with("units", "units", keys_of(locals()))

    def quantities(
        self, *, stroke_over_bore: Value | None = None,
    ) -> Self:
        """Return the engine with quantities.

        Numbers that several numbers of the file follow.

        Parameters
        ----------
        stroke_over_bore
            Ratio of stroke to bore; both follow at the displacement that engine.stroke and engine.bore give.
        """
        return self._with("quantities", "quantities", keys_of(locals()))

    def phasing(
        self, *, phases: int | None = None, intervals: Table | None = None, best: int | None = None,
        rank_orders_by: Sequence[Literal["roll moment", "neighbours", "longest gap"]] | None = None,
        most_shafts: int | None = None, most_shaft_mass: Number | None = None, time_limit: Number | None = None,
        method: Literal["auto", "search", "program", "enumeration"] | None = None,
    ) -> Self:
        """Return the engine with phasing.

        Search of open throws, firing orders and shafts.

        Parameters
        ----------
        phases
            Equal steps of a turn on which throws may stand; by default those of even firing.
        intervals
            Bounds on firing intervals; even firing by default.
        best
            Number of crank stars in the ranking.
        rank_orders_by
            What ranks the firing orders of a star; the first counts most.
        most_shafts
            Largest number of optional balancer shafts that are built.
        most_shaft_mass
            Largest mass of the optional shafts that are built [kg].
        time_limit
            Time after which the search ends with the best design so far [s].
        method
            How stars are searched.
        """
        return self._with("phasing", "phasing", keys_of(locals()))

    def operating_point(
        self, name: str | None = None, *, misfire: Sequence[int] | Literal["each"] | None = None,
        cut: Sequence[int] | None = None, cut_valves: Literal["closed", "open"] | None = None,
        speed: Value | None = None, mean_piston_speed: Value | None = None, imep: Value | None = None,
        bmep: Value | None = None, brake_torque: Value | None = None, motored: bool | None = None,
        gas: bool | None = None, up_to: Value | None = None, steps: int | None = None, weight: Value | None = None,
    ) -> Self:
        """Return the engine with an operating point.

        Speeds and loads at which the engine is looked at.

        Parameters
        ----------
        name
            Name in tables, pictures and messages.
        misfire
            Cylinders whose charge is compressed without combustion; "each" makes one point for each cylinder.
        cut
            Cylinders without combustion, whose valves stand still.
        cut_valves
            Valves of cut cylinders: closed (default) over a charge of intake pressure at the largest volume, or open to
            the intake.
        speed
            Speed of the crank [rad/s].
        mean_piston_speed
            Twice the stroke for every turn of the crank [m/s].
        imep
            Indicated mean effective pressure at this point, in place of that of [gas] [Pa].
        bmep
            Brake mean effective pressure; [friction] adds what friction takes, and its uncertainty [Pa].
        brake_torque
            Torque at the brake, in place of bmep [N m].
        motored
            The charge is compressed without combustion.
        gas
            false: no gas at this point.
        up_to
            Highest speed of a range that starts at speed [rad/s].
        steps
            Number of speeds in the range.
        weight
            How much it counts beside the others.
        """
        return self._with("operating_points", "operating_point", keys_of(locals()))

    def gas_seiliger(
        self, *, peak_pressure: Value, imep: Value, single_cylinders: Sequence[Table] | None = None,
        chambers: Sequence[Table] | None = None, compression_ratio: Value | None = None,
        intake_pressure: Value | None = None, exhaust_pressure: Value | None = None,
        crankcase_pressure: Value | None = None, compression_exponent: Value | None = None,
        expansion_exponent: Value | None = None,
    ) -> Self:
        """Return the engine with gas seiliger.

        Pressure in the cylinders; without it no gas is computed.

        Parameters
        ----------
        peak_pressure
            Largest absolute pressure of the cycle [Pa].
        imep
            Indicated mean effective pressure [Pa].
        single_cylinders
            Cylinders whose gas differs; missing keys are those of [gas].
        chambers
            Chambers of pistons that never fire, such as those of a compressor: cylinders with bore 0.
        compression_ratio
            Largest over smallest volume of the cylinder.
        intake_pressure
            Absolute pressure of the intake stroke [Pa].
        exhaust_pressure
            Absolute pressure of the exhaust stroke [Pa].
        crankcase_pressure
            Absolute pressure behind the piston [Pa].
        compression_exponent
            Polytropic exponent of the compression.
        expansion_exponent
            Polytropic exponent of the expansion.
        """
        return self._with("gas", "gas_seiliger", keys_of(locals(), {'model': 'seiliger'}))

    def gas_wiebe(
        self, *, imep: Value, start: Value, duration: Value, single_cylinders: Sequence[Table] | None = None,
        chambers: Sequence[Table] | None = None, compression_ratio: Value | None = None,
        intake_pressure: Value | None = None, exhaust_pressure: Value | None = None,
        crankcase_pressure: Value | None = None, shape: Value | None = None, completeness: Value | None = None,
        heat_ratio: Value | None = None,
    ) -> Self:
        """Return the engine with gas wiebe.

        Pressure in the cylinders; without it no gas is computed.

        Parameters
        ----------
        imep
            Indicated mean effective pressure [Pa].
        start
            Crank angle at which the burn starts, after the dead centre [rad].
        duration
            Crank angle from the start of the burn to its end [rad].
        single_cylinders
            Cylinders whose gas differs; missing keys are those of [gas].
        chambers
            Chambers of pistons that never fire, such as those of a compressor: cylinders with bore 0.
        compression_ratio
            Largest over smallest volume of the cylinder.
        intake_pressure
            Absolute pressure of the intake stroke [Pa].
        exhaust_pressure
            Absolute pressure of the exhaust stroke [Pa].
        crankcase_pressure
            Absolute pressure behind the piston [Pa].
        shape
            Exponent m of the Wiebe function.
        completeness
            Share of the heat that is burnt at the end of the burn.
        heat_ratio
            Ratio of the specific heats of the gas.
        """
        return self._with("gas", "gas_wiebe", keys_of(locals(), {'model': 'wiebe'}))

    def gas_trace(
        self, *, file: str, single_cylinders: Sequence[Table] | None = None, chambers: Sequence[Table] | None = None,
        sheet: str | None = None, angle_column: str | int | None = None, angle_unit: str | None = None,
        cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
        pressure_column: str | int | Sequence[str | int] | None = None, pressure_unit: str | None = None,
        gauge: bool | None = None, peg: Table | None = None, angle_zero: Number | None = None,
        crankcase_pressure: Value | None = None, cylinder_columns: Sequence[str | int] | None = None,
        cylinder_angles: Literal["own", "common"] | None = None,
    ) -> Self:
        """Return the engine with gas trace.

        Pressure in the cylinders; without it no gas is computed.

        Parameters
        ----------
        file
            Text file, .xlsx or .mat file beside the problem: crank angle, and values over it.
        single_cylinders
            Cylinders whose gas differs; missing keys are those of [gas].
        chambers
            Chambers of pistons that never fire, such as those of a compressor: cylinders with bore 0.
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
        angle_zero
            Crank angle after firing at which the file counts zero, or its dead centre: "firing" or "gas exchange".
        crankcase_pressure
            Absolute pressure behind the piston [Pa].
        cylinder_columns
            Names or numbers of the columns with the pressures of cylinders 1, 2, 3, ..., in place of pressure_column.
        cylinder_angles
            Firing from which the angles of cylinder_columns count: each from that of its cylinder ("own"), or all from
            that of cylinder 1 ("common").
        """
        return self._with("gas", "gas_trace", keys_of(locals(), {'model': 'trace'}))

    def gas_chambers(
        self, *, chambers: Sequence[Table], crankcase_pressure: Value | None = None,
    ) -> Self:
        """Return the engine with gas chambers.

        Pressure in the cylinders; without it no gas is computed.

        Parameters
        ----------
        chambers
            A space on one side of a piston, or of a further piston on the same rod.
        crankcase_pressure
            Absolute pressure of the ambient air [Pa].
        """
        return self._with("gas", "gas_chambers", keys_of(locals(), {'model': 'chambers'}))

    def friction(
        self, *, file: str | None = None, kind: Literal["fuel", "motoring"] | None = None,
        speed_unit: str | None = None, load_unit: str | None = None, fmep: Number | None = None,
        deviation: Number | None = None, deviations: Number | None = None,
    ) -> Self:
        """Return the engine with friction.

        Friction mean effective pressure, measured in a CSV file or given, with its uncertainty.

        Parameters
        ----------
        file
            CSV file: speed, load and fuel for kind fuel; speed and drag for kind motoring.
        kind
            What the file holds: fuel burnt over load, or drag of the motored engine.
        speed_unit
            Unit of the speed in the file.
        load_unit
            Unit of the load in the file: of a torque, or of a mean pressure.
        fmep
            Friction mean effective pressure, in place of a file [Pa].
        deviation
            Standard deviation of fmep [Pa].
        deviations
            Number of standard deviations to either side for which the load is computed.
        """
        return self._with("friction", "friction", keys_of(locals()))

    def mounts(
        self, *, kind: Literal["rigid", "elastic"] | None = None, axes: Table | None = None,
        positions: Sequence[Values] | Array | None = None, names: Sequence[str] | None = None,
        relative_stiffness: Values | None = None, stiffness: Values | None = None, loss_factor: Value | None = None,
        damping_per_stiffness: Value | None = None, stop: Table | None = None, places: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with mounts.

        How the engine is held.

        Parameters
        ----------
        kind
            Whether the mounts give way: rigid far above their resonances, or elastic.
        axes
            Axes of all positions, stiffnesses and turns, if not the engine's own.
        positions
            Where the mounts are: x forward, y to the left, z up, for each [m].
        names
            Names of the mounts, in the order of their positions.
        relative_stiffness
            Relative stiffness along x, y, z of every mount that gives none; not for elastic mounts.
        stiffness
            Stiffness along x, y, z of every elastic mount that gives none [N/m].
        loss_factor
            Loss factor of every elastic mount that gives none.
        damping_per_stiffness
            Viscous damping over stiffness of every elastic mount that gives none [s].
        stop
            Bump stop along each of the mount's own axes; it acts in run-ups and load cases.
        places
            The mounts, a table each.
        """
        return self._with("mounts", "mounts", keys_of(locals()))

    def block(
        self, *, mass: Value, inertia: Values, centre_of_gravity: Values | None = None, axes: Table | None = None,
        inertia_products: Values | None = None, turning_inertia: Value | None = None,
    ) -> Self:
        """Return the engine with block.

        The rigid body that elastic mounts carry.

        Parameters
        ----------
        mass
            Mass of everything that the mounts carry, moving parts included [kg].
        inertia
            Moments of inertia about x, y and z through the centre of gravity [kg m^2].
        centre_of_gravity
            Centre of gravity of everything that the mounts carry: x forward, y to the left, z up [m].
        axes
            Axes of centre_of_gravity and inertia, if not the engine's own.
        inertia_products
            Products of inertia xy, xz, yz of the tensor: xy = - integral of x y dm [kg m^2].
        turning_inertia
            Part of the inertia about x that turns with the crank and does not roll with the block: crankshaft, flywheel
            [kg m^2].
        """
        return self._with("block", "block", keys_of(locals()))

    def load_case(
        self, name: str, *, times_weight: Values | None = None, torque: Value | None = None,
        force: Values | None = None, place: Values | None = None,
    ) -> Self:
        """Return the engine with a load case.

        Static load: weight, a bump, a torque. Travel counts from the position of the engine without it.

        Parameters
        ----------
        name
            Name in tables, pictures and messages.
        times_weight
            The weight of the block, so many times along x, y and z.
        torque
            Moment about x, as that of the crank on the block [N m].
        force
            A force along x, y and z [N].
        place
            Where the force acts [m].
        """
        return self._with("load_cases", "load_case", keys_of(locals()))

    def main_bearing(
        self, name: str | None = None, *, x: Value | None = None, beside_throws: Value | None = None,
        shaft: str | None = None, diameter: Value | None = None, width: Value | None = None,
        friction: Value | None = None,
    ) -> Self:
        """Return the engine with a main bearing.

        Bearings of the crankshaft in the block.

        Parameters
        ----------
        name
            Name of the bearing; by default its number from the front.
        x
            Place along the shaft [m].
        beside_throws
            In place of x, a bearing in the middle between neighbouring throws, and one so far beyond either end [m].
        shaft
            The shaft that it stands on, by name.
        diameter
            Diameter of the journal; needed for a pressure and for friction power [m].
        width
            Width of the journal; needed for a pressure [m].
        friction
            Coefficient of friction; needed for friction power.
        """
        return self._with("main_bearings", "main_bearing", keys_of(locals()))

    def load_torque(
        self, *, file: str, sheet: str | None = None, angle_column: str | int | None = None,
        angle_unit: str | None = None, cycles: Literal["mean", "worst"] | int | None = None, smooth: bool | None = None,
        torque_column: str | int | Sequence[str | int] | None = None, torque_unit: str | None = None,
        angle_zero: Value | None = None,
    ) -> Self:
        """Return the engine with load torque.

        Torque of the driven machine over the crank angle, in place of a constant one.

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
        torque_column
            Name or number of the column of torques, or several that are cycles of the machine.
        torque_unit
            Unit of the torques, if it is not in the file; N m by default.
        angle_zero
            Crank angle at which the file counts zero, after the firing dead centre of cylinder 1 [rad].
        """
        return self._with("load_torque", "load_torque", keys_of(locals()))

    def flywheel(
        self, *, inertia: Value | None = None, rim: Table | None = None, crankshaft_inertia: Value | None = None,
    ) -> Self:
        """Return the engine with flywheel.

        Parts that turn at crank speed, without pistons and rods.

        Parameters
        ----------
        inertia
            Moment of inertia of the whole flywheel, in place of a rim [kg m^2].
        rim
            The flywheel by its rim, in place of its inertia.
        crankshaft_inertia
            Moment of inertia of the crankshaft and all else that turns, beside a rim [kg m^2].
        """
        return self._with("flywheel", "flywheel", keys_of(locals()))

    def geared_inertia(
        self, name: str, *, share: Value, ratio: Number | None = None,
    ) -> Self:
        """Return the engine with a geared inertia.

        A second crank, or a flywheel on a shaft of its own.

        Parameters
        ----------
        name
            Name in tables, pictures and messages.
        share
            Share of the inertia of all that turns, reduced to the crank.
        ratio
            Speed over crank speed; negative runs against the crank.
        """
        return self._with("geared_inertias", "geared_inertia", keys_of(locals()))

    def counterweight(
        self, name: str, *, shaft: str | None = None, balance_factor: Value | None = None,
        balance_fraction: Value | None = None, throws: Sequence[int] | None = None, x: Value | None = None,
        opposite_throw: int | None = None, unbalance: Value | complex | None = None,
        mass: Value | complex | None = None, radius: Value | None = None, angle: Value | None = None,
        body: Table | None = None,
    ) -> Self:
        """Return the engine with a counterweight.

        Weights on the crankshaft.

        Parameters
        ----------
        name
            Name in tables, pictures and messages.
        shaft
            Shaft that it turns with; "every" puts a balance factor opposite the throws of all shafts.
        balance_factor
            Share of the reciprocating mass that is balanced, with the rotating mass, opposite each throw.
        balance_fraction
            Earlier name of balance_factor.
        throws
            Numbers of the throws that carry one.
        x
            Place along the crank, forward of the middle of the engine [m].
        opposite_throw
            Number of the throw from which angle and place are counted.
        unbalance
            Mass times the distance of its centre of gravity from the axis of rotation [kg m].
        mass
            Mass [kg].
        radius
            Distance of its centre of gravity from the axis of rotation [m].
        angle
            Angle at which it stands when cylinder 1 is at its firing dead centre, from upright in the sense of rotation
            [rad].
        body
            Body of a weight, from which its mass and unbalance follow.
        """
        return self._with("counterweights", "counterweight", keys_of(locals()))

    def balancer_shaft(
        self, name: str, *, ratio: Number, position: Values, unbalances: Sequence[Table], optional: bool | None = None,
        shaft_mass: Value | None = None,
    ) -> Self:
        """Return the engine with a balancer shaft.

        Shafts with weights that turn beside the crankshaft.

        Parameters
        ----------
        name
            Name in tables, pictures and messages.
        ratio
            Speed over crank speed; negative turns against the crank.
        position
            Position of the axis: y to the left, z up [m].
        unbalances
            Unbalance of a shaft.
        optional
            Whether the shaft is built is decided too.
        shaft_mass
            Mass of an optional shaft without its unbalances [kg].
        """
        return self._with("balancer_shafts", "balancer_shaft", keys_of(locals()))

    def fidelity(
        self, *, kinematics: Literal["exact", "two-order", "auto"] | None = None, tolerance: Number | None = None,
        rod: Literal["rigid", "mass-only"] | None = None, gas: bool | None = None, gas_samples: int | None = None,
        gas_orders: int | None = None, orders: int | None = None, crank_inertia: Number | None = None,
        crankshaft: Literal["cut", "beam"] | None = None, mounts: Literal["frequency", "rigid", "time"] | None = None,
        modes: Sequence[int] | None = None, samples: int | None = None,
    ) -> Self:
        """Return the engine with fidelity.

        Fidelity of the physics; exact by default.

        Parameters
        ----------
        kinematics
            Motion of the pistons; auto is exact, and takes fewer samples for many designs.
        tolerance
            Relative error of the objective that auto may make.
        rod
            Whether the rod is a rigid body, or two masses without its inertia.
        gas
            false leaves the working gas out.
        gas_samples
            Steps of the gas torque over the working cycle.
        gas_orders
            Last order kept of the gas alone.
        orders
            Last order kept of pistons, rods and gas.
        crank_inertia
            Inertia of all that turns with the crank; its speed varies within the cycle [kg m^2].
        crankshaft
            How main bearings share its loads: cut in its journals, or a continuous beam.
        mounts
            Elastic mounts order by order, as if they gave no way, or integrated in time.
        modes
            Natural modes that answer, 1 the lowest.
        samples
            Steps over the working cycle.
        """
        return self._with("fidelity", "fidelity", keys_of(locals()))

    def search(
        self, *, starts: int | None = None, seed: int | None = None, boxes: int | None = None,
    ) -> Self:
        """Return the engine with search.

        Settings of searches for problems that are not convex.

        Parameters
        ----------
        starts
            The most points that a search starts from where the problem is not convex; it ends sooner once no further
            optimum is to be expected.
        seed
            Start of the random numbers: the same seed gives the same numbers.
        boxes
            Number of boxes into which bounds may be divided for a proof; 0 for none.
        """
        return self._with("search", "search", keys_of(locals()))

    def bob_weights(
        self, *, balance_factor: Number, big_end: Number | Values, bearing_shells: Number | Values | None = None,
        piston: Number | Values | None = None, pin: Number | Values | None = None, rings: Number | Values | None = None,
        locks: Number | Values | None = None, small_end: Number | Values | None = None, oil: Number | None = None,
    ) -> Self:
        """Return the engine with bob weights.

        Parts on the throws, for the bob weights that stand for them while the crankshaft is balanced.

        Parameters
        ----------
        balance_factor
            Share of the reciprocating masses in a bob weight.
        big_end
            Rotating mass of the rod; one for all cylinders, or one for each [kg].
        bearing_shells
            Both bearing shells of a rod [kg].
        piston
            Piston; without piston and small end, the reciprocating mass of [engine] [kg].
        pin
            Piston pin [kg].
        rings
            Piston rings of a cylinder [kg].
        locks
            Locks of a piston pin [kg].
        small_end
            Reciprocating mass of the rod [kg].
        oil
            Oil in a throw [kg].
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
        """Return the engine with correction.

        Holes and slugs that correct the unbalance of a rotor in two planes.

        Parameters
        ----------
        planes
            The two correction planes.
        density
            Density of the rotor [kg/m^3].
        drills
            Diameters of the drills [m].
        depth_step
            Holes are whole multiples of it deep, to the end of the full diameter [m].
        max_depth
            Largest depth of a hole [m].
        goal
            Fewest holes that leave a permitted residual, or the least residual of all designs.
        direction
            Direction of the holes: along the axis, or towards it.
        point_angle
            Included angle of the drill's point; by default holes have a flat bottom [rad].
        min_depth
            Least depth of a hole [m].
        wall
            Least material between two holes, and to the edge of a sector [m].
        max_holes
            Largest number of holes in a plane.
        slugs
            Slugs of heavy metal, which fill holes of their diameter.
        permitted_unbalance
            Permitted in each plane: an unbalance, or the share of a plane in a grade of ISO 21940-11.
        rotor_mass
            Mass of the rotor that has the grade [kg].
        service_speed
            Fastest service speed, for the grade [rad/s].
        centre_of_mass
            Place of the centre of mass along the axis; by default the planes have equal shares in the grade [m].
        zero_mark
            Angle of the machine's zero mark on the crank [rad].
        machine_counts
            Sense in which the machine counts its angles.
        """
        return self._with("correction", "correction", keys_of(locals()))

    def frame(
        self, *, mass: Value, inertia: Values, centre_of_gravity: Values | None = None,
        inertia_products: Values | None = None, springs: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with frame.

        Rigid frame under the mounts of the engine, for receivers alone; other quantities have rigid ground there.

        Parameters
        ----------
        mass
            Mass of the frame and all that is bolted to it, without the engine [kg].
        inertia
            Moments of inertia about x, y and z through its centre of gravity [kg m^2].
        centre_of_gravity
            Its centre of gravity [m].
        inertia_products
            Products of inertia xy, xz, yz [kg m^2].
        springs
            Springs between frame and ground; none for a free frame.
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

        Parameters
        ----------
        name
            Name in tables, pictures and messages.
        unit
            Unit of the response; that of transfer functions is this unit per newton of mount force.
        point
            Position of a point that moves with the engine, or with the frame [m].
        on
            Body that the point moves with.
        transfer_functions
            CSV files of the transfer functions from mount forces to a receiver, by the direction of its response.
        force
            Forces that transfer functions apply to: those on rigid ground if they were measured with the engine on its
            mounts, those on the moving frame if they were measured without the engine.
        band
            Frequencies that count; transfer functions have to cover them, and other frequencies give no response [Hz].
        weighting
            Wk, Wd, Wh, A, a CSV file with factors over frequency, or none; one for all directions, or one for each.
        """
        return self._with("receivers", "receiver", keys_of(locals()))

    def tolerances(
        self, *, residual_unbalance: str | None = None, rotor_mass: Number | None = None, planes: int | None = None,
        law: Literal["uniform", "normal"] | None = None,
    ) -> Self:
        """Return the engine with tolerances.

        Tolerances of built engines that no number of the drawing has.

        Parameters
        ----------
        residual_unbalance
            Left on the crankshaft by balancing: an unbalance on each plane, or a grade of ISO 21940-11 for all of them
            together.
        rotor_mass
            Mass of the rotor that has the grade: crankshaft, flywheel, clutch [kg].
        planes
            Number of balancing planes, from the first throw to the last.
        law
            Distribution of the errors within the tolerance.
        """
        return self._with("tolerances", "tolerances", keys_of(locals()))

    def robust(
        self, *, over: str | None = None, engines: int | None = None, seed: int | None = None,
    ) -> Self:
        """Return the engine with robust.

        Design for engines as built: for the worst case within the tolerances, or for a share of them.

        Parameters
        ----------
        over
            "worst case", or a share of engines such as "95 %".
        engines
            Number of engines that are drawn.
        seed
            Start of the random numbers: the same seed gives the same numbers.
        """
        return self._with("robust", "robust", keys_of(locals()))

    def assembly(
        self, *, pistons: str | None = None, rods: str | None = None, mass_unit: str | None = None,
    ) -> Self:
        """Return the engine with assembly.

        Measured pistons and rods; the optimiser decides which goes into which cylinder.

        Parameters
        ----------
        pistons
            CSV file with the mass of each piston.
        rods
            CSV file with the masses of each rod at the small end and at the big end.
        mass_unit
            Unit of the masses in these files.
        """
        return self._with("assembly", "assembly", keys_of(locals()))

    def run_up(
        self, *, up_to: Value, time: Value | None = None, shut_down_time: Value | None = None,
        operating_point: str | None = None,
    ) -> Self:
        """Return the engine with run up.

        Run from rest to a speed and back, through resonance.

        Parameters
        ----------
        up_to
            Highest speed [rad/s].
        time
            Time in which the engine runs up from rest [s].
        shut_down_time
            Time in which the engine is shut down; by default that of the run-up [s].
        operating_point
            Operating point whose gas drives the engine during the run; the slowest by default.
        """
        return self._with("run_up", "run_up", keys_of(locals()))

    def running_gear(
        self, *, density: Value | None = None, elastic_modulus: Value | None = None, webs: Table | None = None,
        rod: Table | None = None, piston_pin: Table | None = None, bolts: Table | None = None,
    ) -> Self:
        """Return the engine with running gear.

        Sizes of webs, rods, bolts and piston pins, from which their stresses follow.

        Parameters
        ----------
        density
            Density of the parts; their masses and those of the crank pins are then added to those of [engine] [kg/m^3].
        elastic_modulus
            Young's modulus of rods and piston pins [Pa].
        webs
            Webs beside every crank pin.
        rod
            The round shank of every rod.
        piston_pin
            The pin of every piston.
        bolts
            Bolts of every big end.
        """
        return self._with("running_gear", "running_gear", keys_of(locals()))

    def torsion(
        self, *, throw_inertia: Value | Values, cylinder_damping: Value | Values | None = None,
        loss_factor: Value | None = None, shear_modulus: Value | None = None, speeds: Values | None = None,
        output: str | None = None, crank: Table | None = None, discs: Sequence[Table] | None = None,
        branches: Sequence[Table] | None = None, absorbers: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with torsion.

        Discs and shafts of the torsional system of the crankshaft.

        Parameters
        ----------
        throw_inertia
            Moment of inertia of a throw: pin, webs and counterweights, without rod and piston [kg m^2].
        cylinder_damping
            Viscous damping of every throw against the block [N m s/rad].
        loss_factor
            Hysteretic loss factor of every shaft that has none of its own.
        shear_modulus
            Shear modulus of the crankshaft [Pa].
        speeds
            Range of speeds in which the response is shown and barred speeds are looked for [rad/s].
        output
            Disc at which the driven machine takes its torque; the last one by default.
        crank
            The shaft from throw to throw.
        discs
            Discs before and behind the throws, from the front.
        branches
            Shaft that gears, a belt or a chain drive from a disc: a camshaft, pump, propeller or generator.
        absorbers
            A viscous or rubber damper, or a pendulum.
        """
        return self._with("torsion", "torsion", keys_of(locals()))

    def crankcase(
        self, *, clearance: Value | None = None, skirt: Value | None = None, rod: Table | None = None,
        walls: Sequence[Table] | None = None, round_parts: Sequence[Table] | None = None,
    ) -> Self:
        """Return the engine with crankcase.

        Space in which weights turn.

        Parameters
        ----------
        clearance
            Smallest distance that weights keep from all parts [m].
        skirt
            Distance from the piston pin to the lower edge of the piston; without it pistons are not checked [m].
        rod
            Sizes of the rods; without them rods are not checked.
        walls
            Flat walls along the shafts.
        round_parts
            Round parts along the shafts.
        """
        return self._with("crankcase", "crankcase", keys_of(locals()))
