"""Mount forces far below resonance: equilibrium, compatibility, and loads that no mount carries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from laufruhe.errors import UncarriedLoadError
from laufruhe.machine import Mount
from laufruhe.machine.mount import Matrix3
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.mount_forces import UNCARRIED_SHARE, RigidMounting, rigid_mounting
from laufruhe.physics.rigid_body import WRENCH

PLACE = st.floats(-1.0, 1.0).map(lambda x: round(x, 4))
TURNS = st.tuples(*[st.floats(-math.pi, math.pi)] * 3)


def rotation(angles: Sequence[float]) -> NDArray[np.float64]:
    """Return the rotation about x, then y, then z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def as_rows(matrix: NDArray[np.float64]) -> Matrix3:
    a, b, c = (tuple(row) for row in matrix.tolist())
    return (a, b, c)


@st.composite
def mountings(draw: st.DrawFn) -> tuple[Mount, ...]:
    """Return the three to six springs that carry every direction, some of them turned."""
    mounts = tuple(
        Mount(
            f"mount {k}",
            (draw(PLACE), draw(PLACE), draw(PLACE)),
            tuple(draw(st.floats(0.1, 10.0)) for _ in range(3)),
            as_rows(rotation(draw(TURNS)).T) if draw(st.booleans()) else Mount("", (0.0, 0.0, 0.0)).orientation,
        )
        for k in range(draw(st.integers(3, 6)))
    )
    places = np.array([m.position for m in mounts])
    # mounts all but in one line carry the moment about it badly
    assume(np.linalg.svd(places - places.mean(axis=0), compute_uv=False)[1] > 0.1)
    return mounts


WRENCHES = st.lists(st.complex_numbers(max_magnitude=1e3), min_size=6, max_size=6).map(np.array)


def driven(wrench: NDArray[np.complex128]) -> Spectrum:
    """Return a wrench of first order."""
    return Spectrum(Fraction(1), np.array([np.zeros(6), wrench]))


def forces(mounts: Sequence[Mount], wrench: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return rigid_mounting(tuple(mounts)).forces(driven(wrench)).coefficients[1]


def resultant(mounts: Sequence[Mount], found: NDArray[np.complex128]) -> NDArray[np.complex128]:
    moments = np.cross(np.array([m.position for m in mounts]), found)
    return np.concatenate([found.sum(axis=0), moments.sum(axis=0)])


class TestStatics:
    @given(mountings(), WRENCHES)
    def test_equilibrium(self, mounts: tuple[Mount, ...], wrench: NDArray[np.complex128]) -> None:
        """Forces on the mounts and their moments add up to the wrench on the block."""
        result = resultant(mounts, forces(mounts, wrench))
        np.testing.assert_allclose(result, wrench, rtol=0.0, atol=1e-9 * (1.0 + np.abs(wrench).max()))

    @given(mountings(), WRENCHES)
    def test_mounts_give_way_as_one_body_moves(self, mounts: tuple[Mount, ...], wrench: NDArray[np.complex128]) -> None:
        """Check that the mount deflections K^-1 F are those of one rigid body, u + omega x r."""
        result = forces(mounts, wrench)
        give = np.concatenate([np.linalg.solve(m.stiffness_matrix, f) for m, f in zip(mounts, result, strict=True)])
        motions = np.concatenate([np.hstack([np.eye(3), _cross(m.position)]) for m in mounts])
        motion, *_ = np.linalg.lstsq(motions, give, rcond=None)
        np.testing.assert_allclose(motions @ motion, give, rtol=0.0, atol=1e-9 * (1.0 + np.abs(give).max()))

    @given(mountings(), WRENCHES, st.floats(1e-6, 1e9))
    def test_only_ratios_of_stiffness_count(
        self, mounts: tuple[Mount, ...], wrench: NDArray[np.complex128], factor: float
    ) -> None:
        x, y, z = ([factor * m.stiffness[k] for m in mounts] for k in range(3))
        harder = [replace(m, stiffness=s) for m, s in zip(mounts, zip(x, y, z, strict=True), strict=True)]
        _assert_close(forces(harder, wrench), forces(mounts, wrench))

    @given(mountings(), WRENCHES, st.randoms(use_true_random=False))
    def test_order_of_mounts(self, mounts: tuple[Mount, ...], wrench: NDArray[np.complex128], random: object) -> None:
        """Each mount takes the same force, wherever it stands in the list."""
        order = list(range(len(mounts)))
        random.shuffle(order)  # type: ignore[attr-defined]
        _assert_close(forces([mounts[k] for k in order], wrench), forces(mounts, wrench)[order])

    @given(mountings(), WRENCHES, TURNS)
    def test_turned_world(
        self, mounts: tuple[Mount, ...], wrench: NDArray[np.complex128], angles: tuple[float, float, float]
    ) -> None:
        """Places, mounts and load turned together: the forces turn with them."""
        turn = rotation(angles)
        turned = [
            replace(
                m,
                position=tuple((turn @ np.array(m.position)).tolist()),
                orientation=as_rows(np.array(m.orientation) @ turn.T),
            )
            for m in mounts
        ]
        load = np.concatenate([turn @ wrench[:3], turn @ wrench[3:]])
        _assert_close(forces(turned, load), forces(mounts, wrench) @ turn.T)

    def test_a_quarter_turn_swaps_stiffnesses(self) -> None:
        """Check that a mount rotated by 90 degrees about x carries with y as before with z."""
        turn = as_rows(rotation((math.pi / 2, 0.0, 0.0)).T)
        corners = [(0.5, 0.2, 0.0), (0.5, -0.2, 0.0), (-0.5, 0.0, 0.1)]
        turned = [Mount(f"{k}", p, (1.0, 2.0, 3.0), turn) for k, p in enumerate(corners)]
        upright = [Mount(f"{k}", p, (1.0, 3.0, 2.0)) for k, p in enumerate(corners)]
        wrench = np.array([1.0, 2.0, -3.0, 0.4, 0.5, 0.6], dtype=complex)
        _assert_close(forces(turned, wrench), forces(upright, wrench))

    @given(mountings(), WRENCHES)
    def test_a_stiff_mount_beside_soft_ones(self, mounts: tuple[Mount, ...], wrench: NDArray[np.complex128]) -> None:
        """Check balance at a stiffness ratio of 1e9; the stiff mount takes the load through it."""
        x, y, z = mounts[0].stiffness
        stiff = (replace(mounts[0], stiffness=(1e9 * x, 1e9 * y, 1e9 * z)), *mounts[1:])
        through = np.concatenate([wrench[:3], np.cross(np.array(mounts[0].position), wrench[:3])])
        result = forces(stiff, through)
        size = 1.0 + float(np.abs(wrench).max())
        np.testing.assert_allclose(resultant(stiff, result), through, rtol=0.0, atol=1e-9 * size)
        np.testing.assert_allclose(result[0], wrench[:3], rtol=0.0, atol=1e-6 * size)


def _cross(place: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return the matrix of omega x r on omega."""
    x, y, z = place
    return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])


def _assert_close(found: NDArray[np.complex128], expected: NDArray[np.complex128]) -> None:
    size = 1e-3 + float(np.abs(expected).max())
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8 * size)


PAIR = (Mount("left", (0.0, 0.252, 0.0)), Mount("right", (0.0, -0.252, 0.0)))


class TestTwoMounts:
    """Hasselgruber 1964, Fig. 1: a single-cylinder on two mounts a distance b apart."""

    def test_roll_moment(self) -> None:
        """A b = T: the roll moment lifts one side and presses the other."""
        result = forces(PAIR, np.array([0.0, 0.0, 0.0, 120.0, 0.0, 0.0], dtype=complex))
        np.testing.assert_allclose(result, [[0, 0, 120.0 / 0.504], [0, 0, -120.0 / 0.504]], atol=1e-10)

    def test_forces_halve(self) -> None:
        result = forces(PAIR, np.array([0.0, 700.0, -300.0, 0.0, 0.0, 0.0], dtype=complex))
        np.testing.assert_allclose(result, [[0, 350, -150], [0, 350, -150]], atol=1e-10)

    def test_mounts_below_the_crank(self) -> None:
        """Check h F / b up and down for a lateral force F on the crank axis, h above the mounts."""
        low = [replace(m, position=(0.0, m.position[1], -0.1)) for m in PAIR]
        result = forces(low, np.array([0.0, 700.0, 0.0, 0.0, 0.0, 0.0], dtype=complex))
        lift = 700.0 * 0.1 / 0.504
        np.testing.assert_allclose(result, [[0, 350, -lift], [0, 350, lift]], atol=1e-10)


FOUR = tuple(Mount(f"{x} {y}", (x, y, 0.0)) for x in (0.4, -0.8) for y in (0.25, -0.25))
ALL = (1.0, 1.0, 1.0)


def unit(component: str) -> NDArray[np.complex128]:
    return np.array([complex(name == component) for name in WRENCH])


class TestUncarried:
    @pytest.mark.parametrize(
        ("mounts", "component"),
        [
            pytest.param(FOUR, "Fx", id="no stiffness along the crank"),
            pytest.param([replace(m, stiffness=(1.0, 0.0, 1.0)) for m in FOUR], "Fy", id="none across"),
            pytest.param([replace(m, stiffness=(1.0, 1.0, 0.0)) for m in FOUR], "Fz", id="none upright"),
            pytest.param(PAIR, "My", id="two mounts pitch"),
            pytest.param(PAIR, "Mz", id="two mounts yaw"),
            pytest.param([Mount("a", (0.5, 0, 0), ALL), Mount("b", (-0.5, 0, 0), ALL)], "Mx", id="a line ahead"),
            pytest.param([Mount("a", (0, 0.5, 0), ALL), Mount("b", (0, -0.5, 0), ALL)], "My", id="a line across"),
            pytest.param([Mount("a", (0, 0, 0.5), ALL), Mount("b", (0, 0, -0.5), ALL)], "Mz", id="an upright line"),
            pytest.param([Mount("a", (0, 0, 0), ALL)], "Mx", id="one mount rolls"),
            pytest.param([Mount("a", (0, 0, 0), ALL)], "My", id="one mount pitches"),
            pytest.param([Mount("a", (0, 0, 0), ALL)], "Mz", id="one mount yaws"),
            pytest.param([Mount("a", (0.5, 0.3, -0.2), ALL)], "Mx", id="one mount aside rolls"),
            pytest.param([Mount("a", (0.5, 0.3, -0.2), ALL)], "My", id="one mount aside pitches"),
            pytest.param([Mount("a", (0.5, 0.3, -0.2), ALL)], "Mz", id="one mount aside yaws"),
            pytest.param([Mount("a", (0.5, 0.3, -0.2))], "Fx", id="one mount aside, none along the crank"),
        ],
    )  # fmt: skip
    def test_is_refused_by_name(self, mounts: Sequence[Mount], component: str) -> None:
        """Check that the message names order, direction and remedy."""
        with pytest.raises(UncarriedLoadError, match=rf"order 1 drives the engine along {component}, .*; give"):
            rigid_mounting(tuple(mounts)).forces(driven(100.0 * unit(component)))

    @pytest.mark.parametrize(
        ("mounts", "carried"),
        [
            pytest.param(FOUR, WRENCH[1:], id="four"),
            pytest.param(PAIR, ("Fy", "Fz", "Mx"), id="two"),
            pytest.param([Mount("a", (0, 0, 0), ALL)], ("Fx", "Fy", "Fz"), id="one"),
            pytest.param(
                [Mount("a", (0.5, 0, 0), ALL), Mount("b", (-0.5, 0, 0), ALL)],
                ("Fx", "Fy", "Fz", "My", "Mz"),
                id="in a line",
            ),
        ],
    )
    def test_the_rest_is_carried(self, mounts: Sequence[Mount], carried: Sequence[str]) -> None:
        """Check equilibrium in every carried direction, and zero force where a mount has no stiffness."""
        for component in carried:
            result = forces(mounts, unit(component))
            np.testing.assert_allclose(resultant(mounts, result), unit(component), atol=1e-12)
            for mount, force in zip(mounts, result, strict=True):
                assert np.abs(force[np.array(mount.stiffness) == 0.0]).max(initial=0.0) < 1e-14

    def test_a_force_through_the_only_mount(self) -> None:
        """Check that a single mount carries a force that acts through it."""
        mount, force = Mount("a", (0.5, 0.3, -0.2), ALL), np.array([1.0, -2.0, 3.0], dtype=complex)
        wrench = np.concatenate([force, np.cross(mount.position, force)])
        np.testing.assert_allclose(forces([mount], wrench)[0], force, rtol=1e-13)

    def test_a_rounding_is_no_load(self) -> None:
        """Check that 1e-10 of the load in an uncarried direction is accepted, and 1e-8 refused."""
        wrench = unit("Fz")
        forces(FOUR, wrench + 1e-10 * unit("Fx"))
        with pytest.raises(UncarriedLoadError, match="along Fx"):
            forces(FOUR, wrench + 1e-8 * unit("Fx"))

    def test_soft_is_not_free(self) -> None:
        """A stiffness of 1e-9 along the crank carries the whole force along it."""
        soft = [replace(m, stiffness=(1e-9, 1.0, 1.0)) for m in FOUR]
        np.testing.assert_allclose(forces(soft, unit("Fx"))[:, 0].sum(), 1.0, rtol=1e-6)

    def test_nothing_driven(self) -> None:
        """An engine at rest needs no mounts that carry."""
        assert not forces([Mount("a", (0.0, 0.0, 0.0))], np.zeros(6, dtype=complex)).any()

    def test_the_order_is_named(self) -> None:
        """Check that the message names the order with the largest uncarried load."""
        c = np.zeros((6, 6), dtype=complex)
        c[1, 0], c[5, 0] = 1.0, 7.0
        with pytest.raises(UncarriedLoadError, match=r"order 2\.5 drives"):
            rigid_mounting(FOUR).forces(Spectrum(Fraction(1, 2), c))

    @pytest.mark.parametrize("arm", [0.02, 1.0, 50.0])
    @pytest.mark.parametrize("component", range(6))
    def test_the_share_that_is_left_to_rounding_is_of_the_largest_load(self, arm: float, component: int) -> None:
        """Check that moments count by the arm of the mounts in any unit."""
        scales = np.array([1.0, 1.0, 1.0, arm, arm, arm])
        free = np.eye(6)[[component]]
        mounting = RigidMounting(np.zeros((1, 3, 6)), free, arm)
        for largest in range(6):
            for share in (0.5, 2.0, 10.0):
                scaled = np.zeros((1, 6), dtype=complex)
                scaled[0, largest] = 100.0
                scaled[0, component] = share * UNCARRIED_SHARE * 100.0 if largest != component else 100.0
                wrench = Spectrum(Fraction(1), np.concatenate([0.0 * scaled, scaled * scales]))
                if share < 1.0 and largest != component:
                    mounting.check_carried(wrench)
                else:
                    with pytest.raises(UncarriedLoadError):
                        mounting.check_carried(wrench)
