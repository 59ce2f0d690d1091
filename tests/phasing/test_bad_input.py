"""Bad input of open cranks: one clear line, the right status, and no false claim."""

import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.files.reader import load
from laufruhe.solvers import evaluate_only, solve
from laufruhe.solvers.result import Status
from phasing import engines

OPEN = 'throws = "open"\nfiring_order = "open"'


@pytest.mark.parametrize(
    ("cylinders", "cycle", "engine", "phasing", "layout", "said"),
    [
        (5, "four-stroke", OPEN, 'intervals = { min = "150 deg" }', "inline", "can keep the firing intervals: 5.*144"),
        (5, "four-stroke", OPEN, 'intervals = { max = "140 deg" }', "inline", "can keep the firing intervals"),
        (4, "two-stroke", OPEN, "phases = 8", "inline", "phases = 8 conflicts with 4 throws: 8 phases are more than 4"),
        (6, "two-stroke", OPEN, "phases = 3", "inline", "phases = 3 conflicts with 6 throws.*needs 6"),
        (4, "four-stroke", 'throws = [0, 90, 270, 180]\nfiring_order = "open"', "", "inline",
         r"throws \[0, 90, 270, 180\] deg contradict the firing intervals allowed, 180 to 180 deg; the most even"),
        (3, "two-stroke", 'throws = [0, 120, 0]\nfiring_order = "open"', 'intervals = { min = "0 deg" }',
         "inline", r"throws \[0, 120, 0\] deg let several cylinders fire at once"),
        (6, "four-stroke", f"bank_angle = 90\n{OPEN}", "", "vee", "multiple of 120 deg, and they make 90 deg"),
        (6, "four-stroke", f"bank_angle = 90\nsplit_pin_angle = {{ between = [0, 20] }}\n{OPEN}", "", "vee",
         "no bank angle and split pin within the bounds allow even firing"),
        (6, "four-stroke", f"bank_angle = {{ between = [80, 95] }}\n{OPEN}",
         'intervals = { largest_deviation = "10 deg" }', "vee",
         "the most even crank has intervals from 95 to 145 deg with bank angle plus split pins of 95 deg"),
    ],
)  # fmt: skip
def test_infeasible_says_what_conflicts(tmp_path, cylinders, cycle, engine, phasing, layout, said):
    result = solve(engines.problem(tmp_path, cylinders, cycle, engine, phasing, layout=layout))
    assert result.status is Status.INFEASIBLE
    assert result.certificate is None
    with pytest.raises(AssertionError, match=said):
        raise AssertionError(result.message)
    assert "\n" not in result.message
    if result.problem.phasing.throws is not None:
        # throws that cannot fire are no initial design either
        initial = evaluate_only(result.problem)
        assert (initial.status, initial.message) == (result.status, result.message)


def test_limits_that_no_star_keeps_are_named(tmp_path):
    rest = (
        engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE
        + '[[constraints]]\nname = "quiet"\nlimit = "rms rocking couple"\norders = [2]\nmax = "1 N m"\n'
    )  # fmt: skip
    result = solve(engines.problem(tmp_path, 3, rest=rest))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("quiet",)
    assert "'quiet'" in result.message


def test_no_time_for_any_design_is_a_failure(tmp_path):
    rest = engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE
    result = solve(engines.problem(tmp_path, 4, phasing='time_limit = "1e-9 s"', rest=rest))
    assert result.status is Status.FAILED
    assert "phasing.time_limit = 1e-09 s" in result.message


def test_a_failure_names_the_limit_of_time_that_ended_it(tmp_path):
    rest = engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE
    rest += '[[constraints]]\nlimit = "rms rocking couple"\norders = [2]\nmax = "1 N m"\n'
    result = solve(engines.problem(tmp_path, 5, rest=rest), time_limit=1e-9)
    assert result.status is Status.FAILED
    assert "found in the time limit" in result.message
    assert "phasing.time_limit" not in result.message


@pytest.mark.parametrize(
    ("cylinders", "engine", "phasing", "rest", "said"),
    [
        (
            4,
            'throws = "opne"\nfiring_order = "open"',
            "",
            engines.COUPLE,
            'engine.throws = "opne": is neither a list nor "open"',
        ),
        (
            4,
            'throws = "open"\nfiring_order = [1, 2, 2, 4]',
            "",
            engines.COUPLE,
            "engine.firing_order.*no permutation of 1 to 4",
        ),
        (
            4,
            'throws = [0, 90, 180]\nfiring_order = "open"',
            "",
            engines.COUPLE,
            "engine.throws: has angles for 3 of 4 throws",
        ),
        (4, OPEN, "intervals = { }", engines.COUPLE, "phasing.intervals: is empty"),
        (
            4,
            OPEN,
            'intervals = { min = "100 deg", max = "80 deg" }',
            engines.COUPLE,
            "phasing.intervals.min: is more than max",
        ),
        (4, OPEN, 'intervals = { largest_deviation = "-1 deg" }', engines.COUPLE, "largest_deviation = .*is negative"),
        (4, OPEN, "most_shafts = 1", engines.COUPLE, "phasing.most_shafts: limits optional shafts, and there are none"),
        (4, OPEN, "best = 0", engines.COUPLE, "phasing.best"),
        (4, OPEN, 'method = "magic"', engines.COUPLE, "phasing.method.*is not allowed"),
        (
            2,
            "throws = [0, { between = [90, 270] }]",
            "intervals = { largest_deviation = 0 }",
            engines.COUPLE,
            "phasing.intervals: allows even firing alone",
        ),
    ],
)
def test_refused(tmp_path, cylinders, engine, phasing, rest, said):
    with pytest.raises(InputError, match=said) as refusal:
        engines.problem(tmp_path, cylinders, engine=engine, phasing=phasing, rest=rest)
    assert len(str(refusal.value).splitlines()) == 1


@pytest.mark.parametrize("key", ["stroke", "reciprocating_mass"])
def test_open_throws_need_the_keys_of_given_throws(key):
    tables = {"stroke": '"100 mm"', "reciprocating_mass": '"1 kg"'}
    keys = "\n".join(f"{name} = {value}" for name, value in tables.items() if name != key)
    head = f'layout = "inline"\ncycle = "four-stroke"\ncylinders = 4\nrod_ratio = 0.28\n{keys}'
    rest = '[[operating_points]]\nspeed = "3000 rpm"\n[objective]\nminimise = "rms shaking force"'
    for throws in (OPEN, "throws = [0, 180, 180, 0]\nfiring_order = [1, 3, 4, 2]"):
        with pytest.raises(InputError, match=rf"engine\.{key}: is missing; add it"):
            laufruhe.load(f'title = "x"\n[engine]\n{head}\ncylinder_spacing = "100 mm"\n{throws}\n{rest}')


def test_a_missing_number_of_cylinders_is_refused(tmp_path):
    engines.problem(tmp_path, 4, engine='throws = "open"')
    path = tmp_path / "none.toml"
    path.write_text((tmp_path / "scene.toml").read_text().replace("cylinders = 4\n", ""), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"engine\.cylinders: is missing, and open throws do not determine the number of cylinders"
    ):
        load(path)


def test_layouts_without_stars_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be open in layout 'boxer'"):
        engines.problem(tmp_path, 4, engine='bank_stagger = "30 mm"\nthrows = "open"', layout="boxer")


def test_a_sum_that_even_firing_leaves_open_is_refused(tmp_path):
    """Bank angle and split pin both open: even firing fixes only their sum, so no search over them would be whole."""
    both = "bank_angle = { between = [60, 100] }\nsplit_pin_angle = { between = [0, 60] }\n"
    with pytest.raises(InputError, match=r"split_pin_angle.*fixes only their sum.*fix one of the two"):
        engines.problem(tmp_path, 6, "four-stroke", both + OPEN, layout="vee")
