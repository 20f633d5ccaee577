# SPDX-License-Identifier: BSD-3-Clause
import csv

import numpy as np
import pytest

from realtime.errors import InputError


@pytest.fixture(scope="module")
def rows(data_folder):
    with open(data_folder / "airlight_integral.csv", newline="") as file:
        return list(csv.DictReader(file))


def evaluate(kernel, rows, precision, **parameters):
    """Run a kernel over rows of one phase function and return its values as float64."""
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types = array_types(precision)
    column = {key: types.scalar([float(row[key]) for row in rows]) for key in ("g", "t", "h", "x0", "x1", "sigma_t")}
    name = rows[0]["phase"]
    medium = Medium((column["sigma_t"],), types.color(1), named_phase(name, g=column["g"] if name == "hg" else None))
    geometry = RayGeometry(column["t"], column["h"], None, None)
    light = Light(None, None)
    return np.array(kernel(geometry, column["x0"], column["x1"], medium, light, **parameters), dtype=np.float64)


def worst(values, rows):
    """Return the largest relative error and its row; values that float32 cannot hold are compared in absolute terms."""
    expected = np.array([float(row["value"]) for row in rows])
    error = np.abs(values - expected) / np.maximum(expected, 1e-37)
    k = int(np.argmax(np.where(np.isfinite(values), error, np.inf)))
    return error[k], rows[k]


# Certified values at float32 inputs. Sixteen nodes alone reach 4e-6 (the double-precision column of the same nodes
# shows it: `near_light` is the worst tag); float32 adds rounding of the exponent, 6e-8 times an optical depth of up to
# 100.
@pytest.mark.claim("quadrature-kernel")
@pytest.mark.parametrize(
    ("precision", "nodes", "bound"), [("single", 16, 6e-6), ("double", 16, 6e-6), ("double", 32, 1e-11)]
)
def test_quadrature_isotropic(variant, rows, precision, nodes, bound):
    from realtime.kernels.quadrature import quadrature

    chosen = [row for row in rows if row["phase"] == "isotropic"]
    error, where = worst(evaluate(quadrature, chosen, precision, nodes=nodes), chosen)
    assert error < bound, where


# Sharp lobes (g up to 0.98 in the file) are wider than what 16 nodes a panel resolve: 1e-3; 64 nodes resolve all of
# them.
@pytest.mark.claim("quadrature-kernel")
@pytest.mark.parametrize("phase", ["rayleigh", "hazy", "murky", "hg"])
@pytest.mark.parametrize(("precision", "nodes", "bound"), [("single", 16, 2e-3), ("double", 64, 1e-9)])
def test_quadrature_anisotropic(variant, rows, phase, precision, nodes, bound):
    from realtime.kernels.quadrature import quadrature

    chosen = [row for row in rows if row["phase"] == phase]
    error, where = worst(evaluate(quadrature, chosen, precision, nodes=nodes), chosen)
    assert error < bound, where


@pytest.mark.parametrize("nodes", [0, 7, -2])
def test_quadrature_refuses_odd_numbers_of_nodes(variant, rows, nodes):
    from realtime.kernels.quadrature import quadrature

    with pytest.raises(InputError, match="nodes: got"):
        evaluate(quadrature, rows[:1], "single", nodes=nodes)


@pytest.mark.claim("series-by-two-routes", tolerance="1e-12 relative")
@pytest.mark.parametrize("phase", ["isotropic", "rayleigh", "hazy", "murky", "hg"])
def test_taylor_is_the_integral_of_the_series(variant, phase):
    """Against mpmath: its own Taylor series of the integrand, integrated term by term in 30 digits."""
    import mpmath

    from analytic.phase import PhaseFunction
    from realtime.kernels.taylor import taylor

    g, t, h, sigma_t, x0, x1 = 0.37, 1.3, 0.7, 0.43, 0.0, 2.9
    row = {"phase": phase, "g": g, "t": t, "h": h, "x0": x0, "x1": x1, "sigma_t": sigma_t}
    value = evaluate(taylor, [row], "double")[0]
    with mpmath.workdps(30):
        p = PhaseFunction(phase, g=g if phase == "hg" else 0.0)

        def integrand(theta):
            return mpmath.exp(-sigma_t * h * (mpmath.sin(theta) + 1) / mpmath.cos(theta)) * p.mp(-mpmath.sin(theta))

        series = mpmath.taylor(integrand, 0, 4)
        low, high = mpmath.atan2(x0 - t, h), mpmath.atan2(x1 - t, h)
        total = sum(c * (high ** (n + 1) - low ** (n + 1)) / (n + 1) for n, c in enumerate(series))
        expected = float(total * mpmath.exp(-sigma_t * t) / h)
    assert value == pytest.approx(expected, rel=1e-12)  # float64 rounding of a dozen operations


@pytest.mark.claim("taylor-near-the-foot")
def test_taylor_converges_to_the_integral_near_the_foot(variant):
    from realtime.kernels.quadrature import quadrature
    from realtime.kernels.taylor import taylor

    row = {"phase": "isotropic", "g": 0, "t": 1.0, "h": 2.0, "x0": 0.3, "x1": 1.9, "sigma_t": 0.3}
    exact = evaluate(quadrature, [row], "double", nodes=32)[0]
    errors = [abs(evaluate(taylor, [row], "double", degree=n)[0] / exact - 1) for n in (2, 4, 8, 16)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-7


@pytest.mark.claim("refused-phase-functions")
def test_taylor_refuses_a_tabulated_phase_function(variant):
    from realtime.kernels.taylor import taylor

    row = {"phase": "tabulated", "g": 0, "t": 1.0, "h": 2.0, "x0": 0.3, "x1": 1.9, "sigma_t": 0.3}
    with pytest.raises(InputError, match="no Taylor series"):
        evaluate(taylor, [row], "single")


@pytest.mark.claim("refused-phase-functions")
@pytest.mark.parametrize("method", ["unshadowed", "shadow-planes", "light-volumes"])
def test_a_refusal_from_the_body_of_a_loop_stays_one(variant, method):
    """Dr.Jit wraps what is raised there: `random:13` ended `airlight render` with a traceback."""
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from tests.helpers.scenes import tiny_scene

    entries = tiny_scene()
    fog = entries["fog"] | {"phase": {"type": "tabphase", "values": "1.1, 0.4, 1.7"}}
    block = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.31)}
    scene = read_scene(mi.load_dict(entries | {"fog": fog, "ball": block}))
    with pytest.raises(InputError, match="no Taylor series"):
        render_frame(frame_renderer(scene, METHODS[method], kernel=KERNELS["taylor"].function))


@pytest.mark.parametrize("kernel_name", ["quadrature", "taylor"])
def test_zero_length_segments_give_zero(variant, kernel_name):
    from realtime.kernels.registry import KERNELS

    rows = [
        {"phase": "isotropic", "g": 0, "t": t, "h": 0.3, "x0": x, "x1": x, "sigma_t": 0.7}
        for t, x in ((1.0, 0.0), (1.0, 1.0), (-2.0, 5.0))
    ]
    assert np.all(evaluate(KERNELS[kernel_name].function, rows, "single") == 0)


def test_light_beside_the_segment_on_the_ray(variant):
    """Height 0: the closed form int exp(-sigma_t (x + |x - t|)) / (x - t)^2 dx, behind and before the light."""
    from scipy.integrate import quad

    from realtime.kernels.quadrature import quadrature

    rows = [{"phase": "isotropic", "g": 0, "t": t, "h": 0.0, "x0": 0.0, "x1": 1.0, "sigma_t": 0.7} for t in (-0.5, 2.5)]
    values = evaluate(quadrature, rows, "single")
    for value, t in zip(values, (-0.5, 2.5)):
        expected = quad(lambda x, t=t: np.exp(-0.7 * (x + abs(x - t))) / (x - t) ** 2, 0, 1)[0]
        assert value == pytest.approx(expected, rel=5e-6)  # the bound of the isotropic test above
