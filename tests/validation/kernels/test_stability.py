# SPDX-License-Identifier: BSD-3-Clause
"""Claim: studies of kernels find what is wrong and where, and hold `exact` to its bar, on
rays with a certified J.
"""

import csv
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from airlight.analytic.phase import PHASE_NAMES, phase_from_words
from airlight.errors import InputError
from airlight.realtime.kernels.registry import Kernel
from airlight.realtime.kernels.stepping import quadrature
from airlight.validation.kernels.benchmark import speed_against_error, timed_in_turns, try_kernel
from airlight.validation.kernels.case_files import read_cases
from airlight.validation.kernels.cases import (
    TABLE,
    evaluate_accepted,
    evaluate_cases,
    integrate_cases,
    summary,
    write_results,
)
from airlight.validation.kernels.errors import errors_by_group, groups
from airlight.validation.kernels.rays import hard_rays, table, wide_rays, with_reference
from airlight.validation.kernels.records import KernelCost, RayTime
from airlight.validation.kernels.stability import GENERATED, _broken, kernel_stability
from tests.evidence.certified.integral import integrate_certified
from tests.helpers.kernel_values import take


def gauss(geometry, x0, x1, medium, light):
    return quadrature(geometry, x0, x1, medium, light, nodes=8)


def isotropic(cases):
    return take(cases, np.array(cases.phase) == "isotropic")


def study(function, *, exact=False):
    return kernel_stability(
        Kernel("own:kernel", function, exact=exact), {GENERATED: isotropic(hard_rays(256))}
    )


def four_rays():
    columns = {name: np.ones(4) for name in ("foot", "height", "sigma_t")}
    rays = table(
        ["isotropic"] * 3 + ["hg"],
        np.zeros(4),
        x0=np.zeros(4),
        x1=np.arange(1.0, 5.0),
        tags="aabb",
        **columns,
    )
    return replace(rays, value=np.array([1.0, 2.0, 4.0, 8.0]))


def test_errors_are_counted_by_group():
    rays = four_rays()
    errors = errors_by_group(rays, np.array([1.1, 2.0, -4.0, 8.0]), "single", groups(rays))
    assert list(errors) == ["all", "a", "b", "phase hg", "phase isotropic"]
    assert errors["all"].max == 2.0
    assert errors["all"].negative == 1
    assert errors["all"].worst.startswith("b,isotropic,0.0,1.0,1.0,0.0,3.0,1.0,4.0")
    assert errors["a"].max == pytest.approx(0.1)
    assert errors["a"].mean == pytest.approx(0.05)
    assert (errors["phase hg"].rays, errors["phase hg"].max) == (1, 0.0)


def test_refusal_keeps_the_words_of_the_kernel(variant):
    def refuses(geometry, x0, x1, medium, light):
        if medium.phase.name == "hg":
            raise InputError("no lobes here")
        return gauss(geometry, x0, x1, medium, light)

    values, refused = evaluate_accepted(four_rays(), refuses, "single")
    assert {phase: str(reason) for phase, reason in refused.items()} == {"hg": "no lobes here"}
    assert np.isfinite(values).tolist() == [True, True, True, False]
    errors = errors_by_group(four_rays(), values, "single", groups(four_rays()), refused)
    assert (errors["all"].rays, errors["all"].refused, errors["phase hg"].rays) == (3, 1, 0)
    with pytest.raises(InputError, match="no lobes here"):
        evaluate_cases(four_rays(), refuses, "single")


def test_small_relative_mistake_is_found_where_it_is(variant):
    """One part in a thousand, only for rays whose light is behind the camera."""

    def wrong_behind(geometry, x0, x1, medium, light):
        J = quadrature(geometry, x0, x1, medium, light, nodes=16)
        return dr.select(geometry.foot < 0, 1.001 * J, J)

    verdict = study(wrong_behind)
    tags = verdict.sets[0].double
    assert tags["behind"].median == pytest.approx(1e-3, rel=1e-3)
    assert tags["thin"].max < 1e-4
    assert verdict.sets[0].single["all"].worst.split(",")[0] in ("behind", "infinite")
    assert (verdict.exact, verdict.broken) == (False, ())


@pytest.mark.claim("exact-keeps-its-bar")
def test_kernel_that_claims_to_be_exact_is_held_to_it(variant):
    verdict = study(gauss, exact=True)
    assert verdict.exact
    assert any(
        "float32 maximum, |g| up to 0.9" in words and "isotropic" in words
        for words in verdict.broken
    )
    assert any("float64 maximum" in words for words in verdict.broken)
    assert not any("NaN" in words or "negative" in words for words in verdict.broken)


def test_negative_and_missing_values_break_the_claim(variant):
    def bad(geometry, x0, x1, medium, light):
        J = gauss(geometry, x0, x1, medium, light)
        return dr.select(geometry.foot < 0, -J, dr.select(x0 > 0, dr.nan, J))

    words = study(bad, exact=True).broken
    for precision in ("float32", "float64"):
        assert any(precision in sentence and "negative" in sentence for sentence in words)
        assert any(precision in sentence and "NaN" in sentence for sentence in words)


@pytest.mark.claim("differences-of-gamma")
def test_differences_of_gamma_lose_what_theory_says(variant):
    """Light volumes add up Gamma(x) = J(0, x). For a sliver far from camera and light two
    nearly equal Gammas remain.

    Each is rounded to about half an epsilon, so that their difference is off by about
    epsilon times their sum.
    """
    random, count = np.random.default_rng(1), 256
    distance, angle = 10 ** random.uniform(-1, 1, count), np.pi * random.uniform(0.02, 0.98, count)
    x0 = np.float32(distance * 10 ** random.uniform(0.5, 2, count)).astype(np.float64)
    x1 = np.float32(x0 * (1 + 10 ** random.uniform(-5, -2, count))).astype(np.float64)
    foot, height = distance * np.cos(angle), distance * np.sin(angle)
    sigma_t = 10 ** random.uniform(-3, 0.7, count) / (x0 + np.hypot(x0 - foot, height))
    columns = {"foot": foot, "height": height, "sigma_t": sigma_t}
    thin = with_reference(
        table(
            ["isotropic"] * count, np.zeros(count), x0=x0, x1=x1, tags=["sliver"] * count, **columns
        )
    )
    start = np.zeros(count)
    ends = (replace(thin, x0=start), replace(thin, x0=start, x1=x0))
    far, near = (evaluate_cases(cases, gauss, "single").astype(np.float32) for cases in ends)
    off = np.abs((far - near).astype(np.float64) - thin.value)
    direct = np.abs(evaluate_cases(thin, gauss, "single") - thin.value)
    assert (direct / thin.value).max() < 1e-4
    assert np.median(off / thin.value) > 1e-3
    assert 0.05 < np.median(off / (2.0**-23 * (far.astype(np.float64) + near))) < 5


# Rays of which single terms are below 2^-126 though their sums are far above, with the J of each. A
# processor that flushes lost all of the first and the third, a nearly isotropic lobe, and 2.4 % of
# the second.
FLUSHED = (
    (
        "hazy",
        132789.140625,
        232308.1875,
        0.0,
        32985.58984375,
        0.00022316776448860765,
        1.2482876161892056e-33,
    ),
    (
        "rayleigh",
        689046.9375,
        1363.2552490234375,
        0.0,
        372320.25,
        8.510394400218502e-05,
        8.723572803710459e-32,
    ),
    (
        "isotropic",
        -438344.6875,
        1188.7958984375,
        0.0,
        10104.048828125,
        0.00013516764738596976,
        3.828543456423609e-34,
    ),
)


def flushed(*given):
    phase, foot, height, x0, x1, sigma_t, value = zip(*given)
    columns = {"foot": foot, "height": height, "x0": x0, "x1": x1, "sigma_t": sigma_t}
    arrays = {name: np.array(column, dtype=np.float64) for name, column in columns.items()}
    return replace(
        table(phase, np.zeros(len(phase)), tags=["thick"] * len(phase), **arrays),
        value=np.array(value),
    )


def faults(cases, J, precision="single"):
    """Return what values break of the bar, if the other precision is right."""
    values = dict.fromkeys(("single", "double"), cases.value) | {
        precision: np.asarray(J, dtype=np.float64)
    }
    return _broken(GENERATED, cases, values)


@pytest.mark.claim("underflow-breaks-no-bar")
def test_what_a_processor_flushes_on_the_way_breaks_no_bar_and_more_does():
    cases = flushed(*FLUSHED[::2])
    assert [faults(cases, kept * cases.value) for kept in (0.0, 0.5, 1.0)] == [[]] * 3
    assert faults(flushed(FLUSHED[1]), [8.516171514327399e-32]) == []  # some terms are flushed
    cases = flushed(*FLUSHED)
    assert any("float32 maximum" in words for words in faults(cases, 10 * cases.value))


@pytest.mark.parametrize("value", [1e-20, 1e-27])
def test_a_dim_value_that_does_not_underflow_is_held_to_the_bar(value):
    """A short segment near the light in thick fog: its terms are far above the smallest numbers."""
    cases = flushed(("isotropic", 5.0, 1.0, 0.0, 1.0, 10.0, value))
    assert faults(cases, [0.0])
    assert faults(cases, [1.001 * value])


FILES = ("airlight_integral.csv", "airlight_integral_rays.csv")


def test_order_of_the_rows_does_not_matter(variant, data_folder, tmp_path):
    """Rows are evaluated by phase function and must go back to where they were."""
    lines = (data_folder / FILES[1]).read_text().splitlines()
    order = np.random.default_rng(5).permutation(len(lines) - 1)
    (tmp_path / "mixed.csv").write_text(
        "\n".join([lines[0], *(lines[1 + k] for k in order)]) + "\n"
    )
    straight = integrate_cases(read_cases(data_folder / FILES[1]), "quadrature", "double")
    mixed = integrate_cases(read_cases(tmp_path / "mixed.csv"), "quadrature", "double")
    np.testing.assert_array_equal(mixed, straight[order])


def case_file(tmp_path, text):
    path = tmp_path / "cases.csv"
    path.write_text(text)
    return path


SHORT = "phase,t,h,x0,x1,sigma_t,value\n# a remark\n" + "isotropic,1,2,0,inf,0.5,1.0\n" * 4


def test_two_columns_of_one_name_are_refused(tmp_path):
    path = case_file(tmp_path, "t,h,x0,x1,sigma_t,x1\n1,2,0,3,0.5,4\n")
    with pytest.raises(InputError, match="header: 'x1' is there twice; leave one out"):
        read_cases(path)


@pytest.mark.parametrize("phase", ["", "isotropic", "hg:0.5", "mie:6"])
def test_a_mean_cosine_that_the_phase_function_has_not_is_refused(tmp_path, phase):
    """A file without the column `phase` is isotropic: its g would be dropped."""
    header, cell = ("phase,", f"{phase},") if phase else ("", "")
    path = case_file(tmp_path, f"{header}g,t,h,x0,x1,sigma_t\n{cell}0.8,1,2,0,inf,0.5\n")
    with pytest.raises(
        InputError, match=r"line 2, column 'g': 0\.8 is out of range; expected 0, or"
    ):
        read_cases(path)


def test_a_line_of_spaces_is_empty(tmp_path):
    """It was a row of one cell in a file of seven columns."""
    assert len(read_cases(case_file(tmp_path, SHORT + "   \n , \n")).x0) == 4


def test_summary_finds_the_worst_row_of_the_file(tmp_path):
    cases = read_cases(case_file(tmp_path, SHORT))
    counts = summary(cases, np.array([1.0, 1.1, 0.7, 1.2]))
    # After the header and the remark the third case is in line 5.
    assert (counts["rows"], counts["compared"], counts["nonfinite"], counts["worst_row"]) == (
        4,
        4,
        0,
        5,
    )
    assert counts["max"] == pytest.approx(0.3)
    assert counts["p50"] == pytest.approx(0.15)


def test_values_below_float32_are_compared_in_absolute_terms(tmp_path):
    cases = read_cases(
        case_file(tmp_path, "phase,t,h,x0,x1,sigma_t,value\nisotropic,1,2,0,inf,900,1e-60\n")
    )
    assert summary(cases, np.array([0.0]))["max"] < 1e-20
    # In double precision they are numbers like others: five times the value was no error, either.
    assert summary(cases, np.array([5e-60]), "double")["max"] == pytest.approx(4)


@pytest.mark.parametrize("name", FILES)
def test_written_rows_are_those_of_the_source_with_their_results(data_folder, tmp_path, name):
    source = data_folder / name
    cases = read_cases(source)
    results = np.random.default_rng(3).lognormal(size=len(cases.x0)) / 3
    write_results(cases, results, tmp_path / "out.csv")
    with open(source, newline="") as given, open(tmp_path / "out.csv", newline="") as written:
        before, after = list(csv.DictReader(given)), list(csv.DictReader(written))
    assert [
        row | {"result": repr(float(value))} for row, value in zip(before, results, strict=True)
    ] == after
    assert list(after[0])[-1] == "result"
    np.testing.assert_array_equal([float(row["result"]) for row in after], results)


def cost(family, size, ns, error, **others):
    time = RayTime(median=ns, low=ns, high=ns, repetitions=5)
    name = {
        "kernel": f"{family}-{size}",
        "family": family,
        "size": size,
        "phase": "isotropic",
        "g": 0.0,
    }
    return KernelCost(**name, device=time, wall=time, p99=error / 10, max=error, **others)


COSTS = (
    cost("uniform", 100, 100.0, 0.5),
    cost("uniform", 1000, 1000.0, 5e-3),
    cost("table", 64, 4.0, 0.05),
    cost("quadrature", 8, 5.0, 2e-3),
    cost("quadrature", 16, 8.0, 5e-6),
)


def level(levels, statistic, value):
    return next(each for each in levels if (each.statistic, each.level) == (statistic, value))


def test_cheapest_kernel_of_each_level():
    levels = speed_against_error(COSTS)
    assert len(levels) == 12
    coarse, fine, finest = (level(levels, "max", value) for value in (1e-1, 1e-2, 1e-6))
    assert (coarse.cheapest, coarse.ns) == ("table-64", 4.0)
    assert fine.cheapest == "quadrature-8"
    assert (finest.cheapest, finest.ns) == (None, None)
    # 99 % of the rays are ten times better here.
    assert level(levels, "p99", 1e-2).cheapest == "table-64"
    assert level(levels, "p99", 1e-6).cheapest == "quadrature-16"


def test_values_that_are_not_finite_reach_no_level():
    fast = cost("taylor", 4, 1.0, 1e-7, nonfinite=1)
    assert level(speed_against_error([*COSTS, fast]), "max", 1e-1).cheapest == "table-64"


def test_measured_errors_and_times_are_those_of_the_kernel(variant):
    reference, timed = wide_rays(512), wide_rays(4096, reference=False)
    tried = [try_kernel("quadrature", n, reference=reference, rays=timed) for n in (4, 16)]
    coarse, fine = timed_in_turns(tried, seconds=0.05)
    names = ("kernel", "family", "size", "rays")
    assert [getattr(fine, name) for name in names] == ["quadrature-16", "quadrature", 16, 4096]
    # The certified bound of 16 nodes is 4e-6; float32 rounds exponents of up to 60.
    assert fine.max < 3e-5 < coarse.max
    assert fine.nonfinite == 0
    for spread in (fine.device, fine.wall):
        assert 0 < spread.low <= spread.median <= spread.high
        assert spread.repetitions >= 5
    assert coarse.refused is None


COLUMNS = ("g", "foot", "height", "x0", "x1", "sigma_t")


@pytest.fixture
def rays():  # of one test, so that the reference is kept in the tests' own cache
    return hard_rays(2048)


def spans(column, low, high):
    """Whether values reach within a factor of 4 of both ends and never leave the range
    (float32 rounding aside).
    """
    return low * 0.999 <= column.min() < 4 * low and 0.25 * high < column.max() <= high * 1.001


def test_hard_rays_cover_every_magnitude(rays):
    distance = np.hypot(rays.foot, rays.height)
    assert spans(distance, 1e-6, 1e6)
    assert spans(rays.height / distance, 1e-7, 1.0)
    assert spans(rays.sigma_t * (rays.x0 + np.hypot(rays.x0 - rays.foot, rays.height)), 1e-6, 60)
    assert np.abs(rays.g).max() == np.float32(0.95)
    assert set(rays.phase) == set(PHASE_NAMES)
    assert np.isinf(rays.x1).mean() == pytest.approx(0.1, abs=0.01)
    assert len(set(rays.tag)) == 8
    assert (rays.x1 > rays.x0).all()


@pytest.mark.parametrize("draw", [lambda: hard_rays(1000), lambda: wide_rays(512, "hg", 0.8)])
def test_inputs_are_exact_float32_and_values_fit_float32(draw):
    cases = draw()
    for name in COLUMNS:
        column = getattr(cases, name)
        np.testing.assert_array_equal(column, column.astype(np.float32), err_msg=name)
    assert np.isfinite(cases.value).all()
    assert (cases.value > 1.2e-38).all()  # the smallest normal number
    assert cases.value.max() < 3e38


def test_reference_is_certified(rays):
    """A few of each tag by mpmath."""
    for tag in set(rays.tag):
        k = rays.tag.index(tag)
        name = rays.phase[k]
        phase = phase_from_words(name, g=float(rays.g[k]), table=TABLE)
        columns = (rays.foot, rays.height, rays.x0, rays.x1, rays.sigma_t)
        expected = integrate_certified(*(float(column[k]) for column in columns), phase, digits=16)
        assert rays.value[k] == pytest.approx(float(expected), rel=1e-12), tag


HEAD = "phase,g,t,h,x0,x1,sigma_t\n"


def test_both_files(data_folder):
    cases = read_cases(data_folder / "airlight_integral.csv")
    assert len(cases.phase) == len(cases.tag) == len(cases.rows) == 2004
    assert cases.origin is None
    assert np.isinf(cases.x1).any()
    assert cases.header[0] == "tag"
    rays = read_cases(data_folder / "airlight_integral_rays.csv")
    assert rays.origin.shape == rays.direction.shape == rays.light.shape == (1002, 3)
    assert rays.tag is None
    assert (rays.height >= 0).all()


def test_foot_and_height_have_two_names_and_fog_without_a_phase_function_is_isotropic(tmp_path):
    """Those of the documentation and short ones; both together are refused, whatever they hold."""
    short = read_cases(case_file(tmp_path, HEAD + "isotropic,0,1.5,0.4,0,10,0.12\n"))
    page = read_cases(case_file(tmp_path, "foot,height,x0,x1,sigma_t\n1.5,0.4,0,10,0.12\n"))
    assert (page.foot, page.height, page.phase) == (short.foot, short.height, short.phase)
    assert page.header == ("foot", "height", "x0", "x1", "sigma_t")
    with pytest.raises(InputError, match="'height' and 'h' are the same"):
        read_cases(case_file(tmp_path, "foot,height,h,x0,x1,sigma_t\n1.5,0.4,0.4,0,10,0.12\n"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("phase,g,t,h,x0,x1\nhazy,0,1,1,0,1\n", "line 1: no column 'sigma_t'"),
        (
            HEAD + "hazy,0,1,1,0,1,0.1\nhazy,0,1,one,0,1,0.1\n",
            "line 3, column 'h': 'one' is not a number",
        ),
        (
            HEAD + "hazy,0,1,-1,0,1,0.1\n",
            "line 2, column 'h': -1 is out of range; expected a number >= 0",
        ),
        (
            HEAD + "hazi,0,1,1,0,1,0.1\n",
            "line 2, column 'phase': no phase function is called 'hazi'; did you mean 'hazy'",
        ),
        (HEAD + "tabulated,0,1,1,0,1,0.1\n", "no place for its table"),
        (HEAD + "hazy,0,1,1,0,1\n", "line 2: 6 cells in a file of 7 columns"),
        ("", "no lines"),
        (
            "phase,ox,oy,oz,dx,dy,dz,lx,ly,lz,x0,x1,sigma_t\nhazy,0,0,0,0,0,2,1,1,1,0,1,0.1\n",
            "line 2, column 'dx': 0 is out of range; expected a direction of length 1",
        ),
    ],
)
def test_what_is_no_table_of_cases_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_cases(case_file(tmp_path, text))
