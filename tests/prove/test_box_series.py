"""Forces over a box of open numbers, compared with the remainder of their series (E37)."""

from __future__ import annotations

import numpy as np
import pytest

from laufruhe.prove.mounts.box_series import directions_of, mapped, norm_over, series


def scene(seed: int, ranks: tuple[int, ...], damped: float = 0.1) -> dict[str, np.ndarray]:
    """Return a random D = K (1 + i eta) - w^2 of six motions with springs along few directions."""
    rng = np.random.default_rng(seed)
    along = [rng.normal(size=(6, rank)) for rank in ranks]
    sides = np.array([(1.0 + 1j * damped * rng.random()) * each @ each.T for each in along])
    base = rng.normal(size=(6, 6))
    omegas = rng.uniform(0.5, 3.0, 3)
    middle = np.array([(1.0 + 1j * damped) * base @ base.T + sides.sum(axis=0) - w**2 * np.eye(6) for w in omegas])
    ends = np.array([rng.normal(size=(5, len(each.T))) @ each.T for each in along]) * (1.0 + 0.3j)
    return {
        "middle": middle, "sides": sides, "ends": ends, "value": rng.normal(size=(3, 5, 6)) + 0.2j,
        "loads": rng.normal(size=(3, 6)) + 1j * rng.normal(size=(3, 6)),
    }  # fmt: skip


@pytest.mark.parametrize("ranks", [(1,), (1, 1, 1), (2, 1), (3, 2, 1)])
@pytest.mark.parametrize("wide", [0.2, 0.02])
def test_no_design_of_a_box_is_farther_off_than_the_rest(ranks: tuple[int, ...], wide: float) -> None:
    rng, tight, ended = np.random.default_rng(7), 0.0, 0
    for seed in range(20):
        parts = scene(seed, ranks)
        halves = wide * rng.random((1, len(ranks)))
        sides = directions_of(
            [[side.real, side.imag, end.real] for side, end in zip(parts["sides"], parts["ends"], strict=True)]
        )
        assert np.bincount(sides.number_of_column).tolist() == list(ranks)
        inverse = np.linalg.inv(parts["middle"])
        motion = np.einsum("kij,kj->ki", inverse, parts["loads"])
        at = series(halves, halves, inverse[None], sides, sides.inside(parts["sides"]), motion[None])
        turned = sides.along(parts["ends"]) * halves[0, sides.number_of_column]
        answer = mapped(at, parts["value"][None], turned)
        ended += int(np.isfinite(answer.remainder).sum())
        corners = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * len(ranks))).reshape(len(ranks), -1).T
        for s in [*corners, *rng.uniform(-1.0, 1.0, (20, len(ranks)))]:
            moved = np.linalg.solve(
                parts["middle"] + np.einsum("n,nij->ij", s * halves[0], parts["sides"]), parts["loads"][:, :, None]
            )[..., 0]
            maps = parts["value"] + np.einsum("n,nri->ri", s * halves[0], parts["ends"])
            off = np.einsum("kri,ki->kr", maps, moved) - answer.value[0] - np.einsum("n,knr->kr", s, answer.slopes[0])
            size = np.linalg.norm(off, axis=-1)
            assert np.all(size <= answer.remainder[0] * (1.0 + 1e-9) + 1e-12)
            tight = max(tight, float((size / answer.remainder[0]).max()))
    assert tight > 0.2
    assert ended > 30


def test_a_zero_map_has_no_remainder() -> None:
    maps = scene(3, (1, 1))
    sides, wide = directions_of([[side.real] for side in maps["sides"]]), np.full((1, 2), 50.0)
    inverse = np.linalg.inv(maps["middle"])
    motion = np.einsum("kij,kj->ki", inverse, maps["loads"])
    at = series(wide, wide, inverse[None], sides, sides.inside(maps["sides"]), motion[None])
    assert np.all(np.isinf(at.remainder))
    assert np.all(mapped(at, 0.0 * maps["value"][None]).remainder == 0.0)
    assert np.all(np.isinf(mapped(at, maps["value"][None]).remainder))


def test_a_number_of_no_width_has_no_effect() -> None:
    maps = scene(5, (2, 1))
    sides, wide = directions_of([[side.real] for side in maps["sides"]]), np.array([[0.05, 0.0]])
    inverse = np.linalg.inv(maps["middle"])
    motion = np.einsum("kij,kj->ki", inverse, maps["loads"])
    at = series(wide, wide, inverse[None], sides, sides.inside(maps["sides"]), motion[None])
    answer = mapped(at, maps["value"][None], sides.along(maps["ends"]) * wide[0, sides.number_of_column])
    assert np.all(answer.slopes[0, :, 1] == 0.0)
    assert np.all(answer.scores[0, :, 1] == 0.0)
    assert np.all(answer.scores[0, :, 0] > 0.0)


@pytest.mark.parametrize("shape", [(1, 1), (4, 4), (12, 3), (6, 6)])
def test_a_norm_is_never_under_the_largest_singular_value(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(11)
    matrices = rng.normal(size=(50, *shape)) + 1j * rng.normal(size=(50, *shape))
    matrices[0] = 0.0
    matrices[1] *= 1e-150
    exact = np.linalg.norm(matrices, ord=2, axis=(-2, -1))
    result = norm_over(matrices)
    assert np.all(result >= exact * (1.0 - 1e-12))
    assert np.all(result <= exact * min(shape) ** (1.0 / 16.0) * (1.0 + 1e-12))
