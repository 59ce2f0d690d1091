"""Pictures show the evaluation's own numbers, and come out as whole PNG files."""

from __future__ import annotations

import math
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from cli import scenes
from lanes import first_fast
from laufruhe.files.reader import load
from laufruhe.plots import draw, figures, names
from laufruhe.plots.results import bars, cycle, engine, polar, spectrum
from laufruhe.plots.style import AFTER, BEFORE, DPI, fit_line
from laufruhe.present.measures import mount_orders
from laufruhe.problem.evaluation import channel_samples, place_measures
from laufruhe.solvers import Result, evaluate_only
from picture_faults import drawn_texts, overlaps
from problem_files import PROBLEMS, written

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def texts(figure: Figure) -> str:
    found = [text.get_text() for text in figure.texts]
    found += [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return "\n".join(found)


def size_of(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data.startswith(SIGNATURE)
    assert data.rstrip().endswith(b"IEND\xaeB`\x82")
    return struct.unpack(">II", data[16:24])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (scenes.TIGHT, ["engine", "polar", "ellipses", "cycle", "bars", "spectrum"]),
        (scenes.TWO_POINTS, ["engine", "polar", "cycle", "bars", "spectrum"]),
        (scenes.PARTS, ["engine", "polar", "ellipses", "cycle", "bars", "spectrum", "twins"]),
        (scenes.SHAKING_ONLY, ["engine", "ellipses", "cycle", "spectrum"]),
    ],
)
def test_a_result_fills_pictures(text: str, expected: list[str]) -> None:
    assert names(scenes.solved(text)) == expected


def test_pictures_are_whole(tmp_path: Path) -> None:
    result = scenes.solved(scenes.TIGHT)
    files = draw(result, tmp_path)
    assert files == tuple(f"{name}.png" for name in names(result))
    assert {path.name for path in tmp_path.iterdir()} == set(files)
    for name, figure in figures(result):
        assert size_of(tmp_path / f"{name}.png") == tuple(int(DPI * side) for side in figure.get_size_inches())
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000


def test_polar_diagrams_are_the_samples() -> None:
    result = scenes.solved(scenes.TIGHT)
    figure = polar.figure(result)
    assert len(figure.axes) == 4
    for m, axes in enumerate(figure.axes):
        lines = {line.get_label(): line.get_xydata() for line in axes.lines}
        for label, design in (("initial", result.initial), ("final", result.final)):
            samples = channel_samples(design, 0)[:, m, 1:]
            path = np.asarray(lines[label])[:-1]
            assert len(path) >= 720
            assert np.array_equal(path, samples[:: len(samples) // len(path)])
            assert np.array_equal(np.asarray(lines[label])[-1], samples[0])


def test_the_ring_stands_where_the_first_cylinder_fires() -> None:
    """Check that the ring of a V engine stands at its first firing, not at crank angle zero (C5)."""
    result = evaluate_only(load(PROBLEMS / "vee-two-90.toml"))
    cycle, first = result.final.engine.cycle.angle, result.final.engine.cylinders[0]
    assert first.firing_angle > 0.1
    figure = polar.figure(result)
    for m, axes in enumerate(figure.axes):
        ring = next(line for line in axes.lines if line.get_markersize() == 7)
        samples = channel_samples(result.final, 0)[:, m, 1:]
        nearest = samples[round(first.firing_angle / cycle * len(samples))]
        assert np.linalg.norm(np.ravel(ring.get_xydata()) - nearest) < 0.02 * np.abs(samples).max()
    assert "cylinder 1 fires" in texts(figure)
    assert "dead centre" not in texts(engine.figure(result))


def test_small_motions_are_drawn_without_their_mean() -> None:
    angles = np.linspace(0.0, math.tau, 181)
    path = np.stack([0.0 * angles, 3.0 * np.cos(angles), 200.0 + np.sin(angles)], axis=-1)[:, None, :]
    (moved,), note = polar._moving([path])
    assert "steady" in note
    assert moved[:-1].mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(moved, axis=0) == pytest.approx(np.ptp(path, axis=0))
    (shifted,), note = polar._moving(
        [0.02 * path + np.stack([0.0 * path[..., 0], path[..., 1], 0.0 * path[..., 0]], -1)]
    )
    assert note == ""
    assert shifted[0, 0, 2] == pytest.approx(4.0)


def test_polar_diagrams_share_one_scale() -> None:
    figure = polar.figure(scenes.solved(scenes.PARTS))
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}) == 1
    for axes in figure.axes:
        spans = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())])
        larger = spans * (*axes.bbox.size[::-1],) / spans.max() / axes.bbox.width
        # the axis states the enlargement of its direction
        labels = {axes.get_xlabel(), axes.get_ylabel()} - {""}
        for times in (1.0 / larger)[larger < 0.99]:
            assert any(f"enlarged {times:.0f} times" in one.get_xlabel() + one.get_ylabel() for one in figure.axes), (
                labels
            )


def test_forces_along_one_line_are_shown_over_the_crank_angle() -> None:
    """Check that a nearly vertical force is drawn over the crank angle, not as a path."""
    path = np.zeros((9, 1, 3))
    path[:, 0, 2] = np.sin(np.linspace(0.0, 2.0 * np.pi, 9))
    for lateral, along, times in ((0.01, polar.VERTICAL, 20), (0.09, None, 10), (0.6, None, 1)):
        path[:, 0, 1] = lateral * path[:, 0, 2]
        frame = polar.Frame.from_paths([path], 1)
        assert frame.along == along
        assert along is not None or frame.times == {polar.LATERAL: times, polar.VERTICAL: 1}
        swapped = polar.Frame.from_paths([path[..., [0, 2, 1]]], 1)
        assert swapped.size == frame.size
        assert swapped.along == (None if along is None else polar.LATERAL)


def test_bars_are_mean_and_maximum() -> None:
    result = scenes.solved(scenes.TIGHT)
    axes = bars.figure(result).axes[0]
    heights = [[bar.get_height() for bar in container] for container in axes.containers]
    for k, design in enumerate((result.initial, result.final)):
        each = place_measures(design, 0)
        assert heights[2 * k][:4] == [measures.mean for measures in each]
        assert heights[2 * k + 1][:4] == [measures.max for measures in each]
        assert heights[2 * k + 1][4] == max(measures.max for measures in each)
    assert result.objective is not None
    assert heights[2][4] == pytest.approx(result.objective.value, rel=1e-12)


def test_a_spectrum_is_the_mean_amplitude() -> None:
    result = scenes.solved(scenes.TIGHT)
    axes = spectrum.figure(result).axes[0]
    for container, design in zip(axes.containers, (result.initial, result.final), strict=True):
        forces = design.loads[0].mount_forces
        assert forces is not None
        mean = mount_orders(forces).mean(axis=1)
        drawn = {round(2 * (bar.get_x() + bar.get_width() / 2)) / 2: bar.get_height() for bar in container}
        for order, height in drawn.items():
            assert height == pytest.approx(mean[int(order / float(forces.base))], rel=1e-12)
        assert set(drawn) >= {2.0, 4.0}


@pytest.mark.parametrize("maker", [polar.figure, cycle.figure, bars.figure, spectrum.figure])
def test_an_evaluated_design_has_one_series(maker: object) -> None:
    assert callable(maker)
    given, decided = texts(maker(scenes.stated(scenes.TIGHT))), texts(maker(scenes.solved(scenes.TIGHT)))
    assert "initial" in given
    assert "final" not in given
    assert "final" in decided


def test_an_engine_without_mounts_shows_shaking_loads() -> None:
    figure = spectrum.figure(scenes.solved(scenes.SHAKING_ONLY))
    assert [axes.get_ylabel().split(" [")[0] for axes in figure.axes] == [
        "shaking force",
        "rocking couple",
        "roll moment",
    ]
    assert any(text.get_text() == "zero" for text in figure.axes[1].texts)


def test_each_operating_point_has_its_bars() -> None:
    figure = bars.figure(scenes.solved(scenes.TWO_POINTS))
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["at idle", "at rated"]
    assert "rated (largest loads of 2 points)" in texts(polar.figure(scenes.solved(scenes.TWO_POINTS)))


def test_a_cycle_shows_loads_and_mount_forces_angle_by_angle() -> None:
    result = scenes.solved(scenes.TIGHT)
    axes = cycle.figure(result).axes
    assert [one.get_ylabel() for one in axes[1:]] == [
        "roll moment\n[N m]", *(f"{name}\n[N]" for name in result.final.mount_names)
    ]  # fmt: skip
    assert "Rocking couple: zero." in " ".join(texts(cycle.figure(result)).split())
    for design, colour in ((result.initial, BEFORE), (result.final, AFTER)):
        loads = design.loads[0]
        assert loads.mount_forces is not None
        for k, component in ((0, 2), (1, 3)):
            line = next(line for line in axes[k].lines if line.get_color() == colour)
            scale = 1e-3 if "[k" in axes[k].get_ylabel() else 1.0
            expected = loads.wrench.values(np.radians(line.get_xdata()))[:, component]
            assert np.allclose(line.get_ydata(), scale * expected, rtol=1e-12, atol=1e-9)
        for m in range(4):
            line = next(line for line in axes[2 + m].lines if line.get_color() == colour)
            assert line.get_xdata()[-1] == 720.0
            size = np.linalg.norm(loads.mount_forces.values(np.radians(line.get_xdata()))[:, m], axis=-1)
            assert np.allclose(line.get_ydata(), size, rtol=1e-12)


def test_a_cycle_marks_the_firings_and_has_a_column_for_each_point() -> None:
    result = scenes.solved(scenes.TWO_POINTS)
    axes = cycle.figure(result).axes
    assert len(axes) == 2 * (2 + len(result.final.mount_names))
    for row in zip(axes[::2], axes[1::2], strict=True):
        assert row[0].get_ylim() == row[1].get_ylim()
    fired = {text.get_text(): text.xy[0] for text in axes[0].texts if text.get_text().isdigit()}
    assert fired == pytest.approx({"1": 0.0, "3": 180.0, "4": 360.0, "2": 540.0})
    assert [one.texts[-1].get_text() for one in axes[:2]] == ["idle", "rated"]
    many = [replace(point, name=f"at {k}") for point in result.problem.points for k in range(3)]
    crowded = replace(result, problem=replace(result.problem, points=tuple(many)))
    loads = tuple(loads for loads in result.final.loads for _ in range(3))
    crowded = replace(crowded, initial=replace(result.initial, loads=loads), final=replace(result.final, loads=loads))
    assert "3 of 6 operating points" in texts(cycle.figure(crowded))


def many_mounts(count: int) -> str:
    places = ", ".join(f'["{100 * k} mm", "{250 - 500 * (k % 2)} mm", "0 mm"]' for k in range(count))
    start, _, rest = scenes.TIGHT.partition("[mounts]")
    return f"{start}[mounts]\npositions = [{places}]\n{rest[rest.index('[[balancer_shafts]]') :]}"


@pytest.mark.parametrize(
    "text",
    first_fast([scenes.TIGHT, scenes.TWO_POINTS, scenes.PARTS, many_mounts(3), many_mounts(20)], 2),
    ids=["tight", "two points", "parts", "three mounts", "twenty mounts"],
)
@pytest.mark.parametrize("maker", [polar.figure, cycle.figure, bars.figure, spectrum.figure])
def test_no_text_lies_on_another(maker: object, text: str) -> None:
    assert callable(maker)
    result = scenes.solved(text) if text in (scenes.TIGHT, scenes.TWO_POINTS, scenes.PARTS) else scenes.stated(text)
    figure = maker(result)
    assert overlaps(drawn_texts(figure)) == []
    width, height = figure.get_size_inches() * DPI
    for entry in [*figure.texts, *(text for legend in figure.legends for text in legend.get_texts())]:
        box = entry.get_window_extent()
        assert 0.0 <= box.x0 <= box.x1 <= width
        assert 0.0 <= box.y0 <= box.y1 <= height


def renamed(result: Result, names: tuple[str, ...]) -> Result:
    def with_name(design: object) -> object:
        engine = design.engine
        mounts = tuple(replace(mount, name=f"{names[k % len(names)]} {k}") for k, mount in enumerate(engine.mounts))
        return replace(design, engine=replace(engine, mounts=mounts))

    problem = with_name(result.problem)
    return replace(result, problem=problem, initial=with_name(result.initial), final=with_name(result.final))


@pytest.mark.filterwarnings("ignore:no installed font has")
@pytest.mark.parametrize(
    "called", [("$a$ and $b", "\\frac{", "{x}"), ("发动机", "a" * 60, "%d")], ids=["signs", "letters"]
)
def test_any_name_can_be_drawn(called: tuple[str, ...], tmp_path: Path) -> None:
    result = renamed(scenes.solved(scenes.TIGHT), called)
    assert len(result.final.engine.mounts) >= len(called)
    assert len(draw(result, tmp_path)) == 6


def test_long_lines_are_cut() -> None:
    assert fit_line("a  b\nc", 8.0, 9.0) == "a b c"
    assert fit_line("x" * 250, 8.0, 9.0).endswith("…")


@pytest.mark.slow
def test_pictures_need_no_pyplot_and_change_no_settings(tmp_path: Path) -> None:
    path = written(tmp_path, scenes.GIVEN)
    code = (
        "import sys; from pathlib import Path; import matplotlib as mpl; before = dict(mpl.rcParams)\n"
        "from laufruhe.files.reader import load; from laufruhe.solvers import evaluate_only\n"
        "from laufruhe.plots import figures, get_ready, save\n"
        "get_ready()\n"
        "drawn = dict(figures(evaluate_only(load(sys.argv[1]))))\n"
        "assert len(drawn) == 5\n"
        "save(drawn['bars'], Path(sys.argv[2]) / 'bars.png')\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "assert dict(mpl.rcParams) == before\n"
    )
    done = subprocess.run([sys.executable, "-c", code, path, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
