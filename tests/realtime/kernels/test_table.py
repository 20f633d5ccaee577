# SPDX-License-Identifier: BSD-3-Clause
import csv
import subprocess
import sys
from functools import partial

import numpy as np
import pytest

from realtime.errors import InputError
from tests.realtime.kernels.test_registry import evaluate

ONE = {"phase": "isotropic", "g": 0, "t": 1.3, "h": 0.7, "x0": 0.2, "x1": 3.1, "sigma_t": 0.43}


@pytest.fixture(scope="module")
def cases(data_folder):
    """The isotropic certified rows with their tags and values."""
    with open(data_folder / "airlight_integral.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["phase"] == "isotropic"]
    return rows, np.array([row["tag"] for row in rows]), np.array([float(row["value"]) for row in rows])


def relative_error(cases, precision, **parameters):
    from realtime.kernels.table import table

    rows, _, expected = cases
    return np.abs(evaluate(table, rows, precision, **parameters) / expected - 1)


@pytest.mark.parametrize("size", [5, 64])
def test_entries_are_the_integrals(size):
    from mpmath import exp, inf, mpf, pi, quad, tan

    from realtime.kernels.table import table_records

    def sun(p, q):
        return quad(lambda xi: exp(-10 * p * tan(xi)), [0, q * pi / 8, q * pi / 2])

    def tail(p, q):
        alpha = q**2 / (1 - q**2)
        return (1 + alpha) * quad(lambda y: exp(-alpha * y) / (1 + 2 * p * y + y * y), [0, 0.1, 1, 10, inf])

    def head(p, q):
        alpha = q / (1 - q)
        return (1 + alpha) * quad(lambda y: exp(-alpha * y) / (1 + (p * y) ** 2), [0, 0.1, 1])

    published = table_records("sun", size)[:, 0].reshape(1, size - 1, size - 1)
    scaled = table_records("tail", size)[:, 0].reshape(2, size - 1, size - 1)
    for i, j in ((1, 1), (1, size - 2), (size // 2, 2), (size - 2, size - 2)):
        for values, integral in zip((*published, *scaled), (sun, tail, head)):
            expected = integral(mpf(i) / (size - 1), mpf(j) / (size - 1))
            assert values[i, j] == pytest.approx(float(expected), rel=1e-12)


def test_last_column_of_the_published_table():
    """Endless rays: the auxiliary function Ci(u) sin u + (pi/2 - Si(u)) cos u."""
    from scipy.special import sici

    from realtime.kernels.table import table_records

    u = np.linspace(0, 10, 64)[1:-1]
    si, ci = sici(u)
    column = table_records("sun", 64)[:, 1].reshape(63, 63)[1:, -1]
    assert column == pytest.approx(ci * np.sin(u) + (np.pi / 2 - si) * np.cos(u), rel=1e-12)


@pytest.mark.claim("table-edge")
@pytest.mark.parametrize("precision", ["single", "double"])
def test_tail_form_on_certified_cases(variant, cases, precision):
    error = relative_error(cases, precision, form="tail")
    sliver = cases[1] == "sliver"
    assert error[~sliver].max() < 6e-4  # (1/63)^2 / 8 = 3e-5 times the curvature of the entries: 3e-4 measured
    assert np.median(error) < 5e-5
    # A difference of nearly equal reads: interpolation errs by 1/63 of the slope, and float32 adds its rounding.
    assert error[sliver].max() < (0.2 if precision == "single" else 3e-3)


@pytest.mark.claim("declared-orders")
def test_tail_form_converges_as_declared(variant, cases):
    """Like log(size)/size^2: alpha log alpha = 2 b^2 log b has an unbounded second derivative at b = 0."""
    sizes = np.array([16, 32, 64, 128, 256])
    keep = cases[1] != "sliver"
    errors = [np.sqrt(np.mean(relative_error(cases, "double", form="tail", size=int(n))[keep] ** 2)) for n in sizes]
    slope = np.polyfit(np.log(sizes), np.log(errors / np.log(sizes)), 1)[0]
    assert slope == pytest.approx(-2, abs=0.1)


def test_published_form_is_good_near_the_light_only(variant, cases):
    """Where it is good, where it is not: the flat parts of F are far before and beyond the light and in thick media."""
    error, tags = relative_error(cases, "double"), cases[1]
    for tag in ("at_camera", "beyond", "far", "near_light", "thin", "vacuum"):
        assert error[tags == tag].max() < 1e-2, tag
    for tag in ("generic", "scale"):
        assert error[tags == tag].max() < 0.1, tag
    for tag in ("behind", "infinite", "sliver", "thick"):
        assert error[tags == tag].max() > 1, tag


def test_published_form_is_exact_in_vacuum(variant, cases):
    # F(0, v) = v, which bilinear interpolation reproduces.
    assert relative_error(cases, "double")[cases[1] == "vacuum"].max() < 1e-12


@pytest.mark.claim("table-edge")
def test_published_form_reads_the_edge_beyond_its_table(variant):
    """Beyond u = 10 the value is that of u = 10 times the true prefactor: far too large or small, by what that says."""
    from realtime.kernels.table import table

    inside, outside = ONE | {"sigma_t": 10 / 0.7}, ONE | {"sigma_t": 30 / 0.7}
    value = evaluate(table, [inside, outside], "double")
    assert value[1] / value[0] == pytest.approx(np.exp(-(30 - 10) / 0.7 * ONE["t"]), rel=1e-9)
    truth = evaluate(table, [outside], "double", form="tail", size=512)
    assert not 0.1 < value[1] / truth[0] < 10


@pytest.mark.parametrize("precision", ["single", "double"])
def test_tail_form_at_height_zero(variant, precision):
    from scipy.integrate import quad

    from realtime.kernels.table import table

    before = ONE | {"h": 0.0, "t": 4.0}
    beyond = ONE | {"h": 0.0, "t": -0.5}
    endless = beyond | {"x1": "inf"}
    vacuum = before | {"sigma_t": 0.0}
    rows = [before, beyond, endless, vacuum]
    values = evaluate(table, rows, precision, form="tail", size=256)
    for row, value in zip(rows, values):
        t, sigma_t = row["t"], row["sigma_t"]
        expected, _ = quad(
            lambda x, t=t, s=sigma_t: np.exp(-s * (x + abs(x - t))) / (x - t) ** 2, 0.2, float(row["x1"])
        )
        assert value == pytest.approx(expected, rel=1e-4)  # a table of 256 entries errs by 1e-5
    through_light = evaluate(table, [ONE | {"h": 0.0}], precision, form="tail")
    assert through_light[0] == np.inf
    assert np.isnan(evaluate(table, [before], precision, form="sun")[0])  # the published form divides by h


@pytest.mark.parametrize("form", ["sun", "tail"])
def test_no_length_no_light(variant, form):
    from realtime.kernels.table import table

    rows = [ONE | {"x1": ONE["x0"]}, ONE | {"x0": 2.9, "x1": 2.9}]
    assert np.all(evaluate(table, rows, "single", form=form) == 0)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"form": "cubic"}, "form: got 'cubic'"),
        ({"size": 1}, "size: got 1"),
        ({"size": 64.0}, "size: got 64.0"),
        ({"size": 4096}, "size: got 4096"),
    ],
)
def test_refuses_bad_parameters(variant, parameters, message):
    from realtime.kernels.table import table

    with pytest.raises(InputError, match=message):
        evaluate(table, [ONE], "single", **parameters)


@pytest.mark.claim("refused-phase-functions")
def test_refuses_what_it_cannot_do(variant):
    from realtime.kernels.table import table
    from realtime.scene.lights import Light

    with pytest.raises(InputError, match="kernel table: phase function 'rayleigh' is not tabulated"):
        evaluate(table, [ONE | {"phase": "rayleigh"}], "single")

    def with_soft_spot(geometry, x0, x1, medium, light):
        return table(geometry, x0, x1, medium, Light(None, None, cone=1, beam=1))

    with pytest.raises(InputError, match="kernel table: a spot that falls off"):
        evaluate(with_soft_spot, [ONE], "single")


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("form", ["sun", "tail"])
def test_frozen_and_in_colour(variant, form, precision):
    """Recorded once, right after another medium and another number of rays; three extinctions give three values."""
    import drjit as dr

    from realtime.kernels.preparation import prepare_kernel, with_tables
    from realtime.kernels.table import table
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import Isotropic

    types = array_types(precision)
    light = Light(None, None)

    sized = partial(table, form=form, size=31)

    def kernel(t, h, x0, x1, medium, tables):
        return with_tables(sized, tables)(RayGeometry(t, h, None, None), x0, x1, medium, light)

    def arguments(count, extinctions):
        medium = Medium(tuple(dr.opaque(types.scalar, s) for s in extinctions), types.color(1), Isotropic())
        # Not from NumPy, whose memory can be unaligned, which records anew.
        columns = [dr.linspace(types.scalar, low, low + 1, count) for low in (1.1, 0.3, 0.2, 2.5)]
        dr.eval(columns)
        return (*columns, medium)

    tables = prepare_kernel(sized, types.scalar)
    frozen = dr.freeze(kernel)
    for count, extinctions in ((7, (0.11, 0.4, 0.9)), (7, (0.2, 0.5, 0.7)), (12, (0.3, 0.1, 1.3))):
        given = arguments(count, extinctions)
        channels = np.array(frozen(*given, tables))
        assert channels.shape == (3, count)
        for row, sigma_t in zip(channels, extinctions):
            grey = Medium((types.scalar(sigma_t),), types.color(1), Isotropic())
            alone = np.array(kernel(*given[:-1], grey, None))  # uploads a table of its own
            # Recorded code may fuse differently: roundings, of reads of which half cancels.
            assert row == pytest.approx(alone, rel=1e-5 if precision == "single" else 1e-13)
    assert frozen.n_recordings == 1


def test_names_a_table_that_is_not_on_the_device():
    """In a process of its own: what a frozen function raises while it records spoils later recordings."""
    code = """
import drjit as dr
from reports.machine.environment import activate
activate()
import mitsuba as mi
from realtime.kernels.table import upload_table
@dr.freeze
def function(x):
    upload_table(type(x), form="sun", size=17)
    return x + 1
try:
    function(dr.opaque(mi.Float, 1, 3))
except RuntimeError as error:
    print(error.__cause__)
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert "table is not on the device; call realtime.kernels.preparation.prepare_kernel before" in process.stdout, (
        process.stderr
    )
