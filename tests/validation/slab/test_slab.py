# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the orders of a slab by computation are those of photons and of Mitsuba's path tracer."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.phase import HgDraine
from airlight.errors import InputError
from airlight.reference.monte_carlo.slab_walk.estimates import slab_estimate
from airlight.reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein
from airlight.reference.monte_carlo.slab_walk.walk import Slab
from airlight.validation.slab.light import _estimated, slab_numbers
from airlight.validation.slab.phases import phase_pair, read_phase_file
from airlight.validation.slab.request import slab_request
from tests.helpers.hg_draine import hg_draine_moments


def paired(first, second, errors):
    """Yield numbers of two structures with the standard error of the second, where there is one."""
    if isinstance(errors, dict):
        for name in errors:
            if name not in ("depth", "orders", "mu", "phi") or isinstance(errors[name], list):
                yield from paired(first[name], second[name], errors[name])
    elif isinstance(errors, list):
        for each in zip(first, second, errors, strict=True):
            yield from paired(*each)
    elif errors:
        yield first, second, errors


def compared(tau, sun, phase, photons, **more):
    numbers = slab_numbers(slab_request(tau, sun, phase=phase, **more), photons=photons, seed=5)
    walked = numbers["photons"]
    triples = list(paired(numbers, walked, walked["standard_error"]))
    return numbers, np.array([(second - first) / error for first, second, error in triples])


@pytest.mark.statistical
@pytest.mark.claim(
    "slab-orders-are-photons",
    tolerance=(
        "4.5 standard errors each, mean square 0.3 to 2.5, as for 15 independent; seeds are fixed"
    ),
)
@pytest.mark.parametrize(
    ("tau", "sun", "phase", "albedo"),
    [(5.0, 60.0, "hg:0.75", 0.9), (1.0, 25.0, "isotropic", 1.0), (0.3, 80.0, "hg:-0.3", 0.7)],
)
def test_orders_are_those_of_photons(tau, sun, phase, albedo):
    numbers, z = compared(
        tau, sun, phase, 400_000, albedo=albedo, orders="1,2,3-4,5-inf,all", depths=[tau / 3, tau]
    )
    assert np.abs(z).max() < 4.5
    assert 0.3 < (z**2).mean() < 2.5
    assert len(z) > 60
    errors = numbers["photons"]["standard_error"]["orders"]
    assert errors[0]["reflectance"] < 0.01 * numbers["orders"][0]["reflectance"]


def test_an_order_that_no_photon_reached_has_no_known_error():
    """200 photons in half a mean free path: none is scattered 40 times."""
    request = slab_request(0.5, 0.0, orders="1,40", depths=[0.2])
    slab = Slab(request.tau, request.mu0, request.albedo, HenyeyGreenstein(0.0), request.depths)
    estimate = slab_estimate(slab, request.ranges, photons=200, workers=1)
    (few, none), (few_error, no_error) = (
        _estimated(request, estimate, which)["orders"] for which in (0, 1)
    )
    for name in ("reflectance", "transmittance"):
        assert few[name] > few_error[name] > 0
        assert none[name] == 0
        assert np.isnan(no_error[name])
    assert np.isnan(no_error["fluence"][0]["value"])


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.claim("slab-orders-are-photons", tolerance="4.5 standard errors each; seeds are fixed")
@pytest.mark.parametrize(("phase", "tau"), [("mie", 3.7), ("mie-modified", 2.1)])
def test_orders_of_droplets_are_those_of_photons(phase, tau):
    """Both sides compute the droplets by themselves; 44 % of the light is below 5 degrees."""
    _, z = compared(
        tau, 40.0, phase, 500_000, albedo=0.97, orders="1,2,3-4,5-6,7-inf", depths=[0.0, tau / 2]
    )
    assert np.abs(z).max() < 4.5
    assert 0.3 < (z**2).mean() < 2.5


@pytest.mark.parametrize(
    "diameter", [12.0, *(pytest.param(d, marks=pytest.mark.slow) for d in (5.0, 31.7))]
)
def test_the_fit_to_droplets_is_the_same_on_both_sides(diameter):
    pair = phase_pair(f"hg-draine:{diameter}")
    assert pair.deterministic.moments(300) == pytest.approx(
        hg_draine_moments(diameter, 300), abs=1e-12
    )
    cosines = np.linspace(-1, 1, 1001)
    assert pair.deterministic.values(cosines) == pytest.approx(
        HgDraine(diameter)(cosines), rel=1e-9
    )
    drawn = pair.sampled().cosines((np.arange(200_000) + 0.5) / 200_000)
    assert drawn.mean() == pytest.approx(pair.deterministic.moments(2)[1], abs=1e-5)


@pytest.mark.statistical
def test_a_table_of_a_function_is_the_function(tmp_path):
    degrees = np.concatenate([np.linspace(0, 20, 401), np.linspace(20.25, 180, 640)])
    g = 0.75
    values = 17 / (1 + g * g - 2 * g * np.cos(np.deg2rad(degrees))) ** 1.5
    path = tmp_path / "phase.csv"
    rows = "\n".join(
        f"{angle:.4f}, {value:.10g}" for angle, value in zip(degrees, values, strict=True)
    )
    path.write_text(f"# of a measurement\nangle,value\n{rows}\n")
    tabulated, exact = (
        slab_numbers(
            slab_request(2.0, 30.0, phase=name, albedo=0.9, orders="1,2", directions="-0.5:20")
        )
        for name in (str(path), "hg:0.75")
    )
    assert tabulated["phase"] == str(path)
    for name in ("reflectance", "transmitted_rms"):
        assert tabulated["orders"][1][name] == pytest.approx(exact["orders"][1][name], rel=1e-4)
    ours, theirs = (each["total"]["radiance"][-1]["value"] for each in (tabulated, exact))
    assert ours == pytest.approx(theirs, rel=1e-4)
    _, z = compared(2.0, 30.0, str(path), 20_000, orders="1,2-inf")
    assert np.abs(z).max() < 4.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tau": 1e9}, "expected a thickness"),
        ({"sun": 90}, "at 90 no light enters"),
        ({"albedo": 1.01}, "expected a fraction from 0 to 1"),
        ({"orders": "0"}, "was never scattered"),
        ({"depths": "0,2.5"}, "expected depths of 0 to tau"),
        ({"directions": "0:0"}, "not horizontal"),
        ({"phase": "hg:0.99"}, "expected -0.98 to 0.98"),
    ],
)
def test_what_is_refused(change, words):
    with pytest.raises(InputError, match=r"got|missing\.csv") as refused:
        slab_request(**{"tau": 2.0, "sun": 30.0, **change})
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,1\n90,1\n", "expected 0 to 180 degrees"),
        ("0,1\n90,-2\n180,1\n", "line 2: got the value -2"),
        ("angle,p\n0,1\n90,1\n80,1\n180,1\n", "line 4: angles must increase"),
    ],
)
def test_files_that_are_no_phase_function(text, words, tmp_path):
    path = tmp_path / "phase.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"phase\.csv") as refused:
        read_phase_file(path)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("tau", "sun"),
    [
        (0.005, 0.0),
        *(
            pytest.param(t, s, marks=pytest.mark.slow)
            for t in (1e-6, 0.005, 210.0)
            for s in (0.0, 89.99)
        ),
    ],
)
def test_hard_cases_have_finite_numbers(tau, sun):
    numbers = slab_numbers(
        slab_request(
            tau, sun, phase="hg:0.85", orders="1,2-3,4-inf", directions="1:0,-1:0,0.001:180,-1e-6:0"
        )
    )
    values = [value for value, _, _ in paired(numbers, numbers, numbers["error"])]
    assert values
    assert np.all(np.isfinite(values))
    total = numbers["total"]
    assert total["reflectance"] + total["transmittance"] == pytest.approx(1, abs=1e-8)
    assert all(row["value"] >= 0 for row in total["radiance"])


TAU, SUN, G, ALBEDO = 1.5, 50.0, 0.5, 0.9
_WIDE = 2e4  #: of the slab and its thickness 1.5: what a cosine above 1e-4 sees
_SEEDS, _SAMPLES = 32, 1 << 15


def irradiance(scene, integrator, seed):
    image = mi.render(scene, integrator=integrator, spp=_SAMPLES, seed=seed)
    return float(np.asarray(image, dtype=np.float64)[..., 0].mean())


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.claim(
    "slab-orders-are-mitsubas", tolerance="4.5 standard errors of 32 seeds; seeds are fixed"
)
@pytest.mark.parametrize("side", ["reflectance", "transmittance"])
def test_orders_are_those_of_volpath(variant, side):
    """A meter above or below the slab, which light passes, sees the flux; depth n + 1
    less depth n is order n.
    """
    above = side == "reflectance"
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 180 if above else 0)
    meter = {
        "type": "irradiancemeter",
        "film": {
            "type": "hdrfilm",
            "width": 1,
            "height": 1,
            "rfilter": {"type": "box"},
            "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }
    sun = np.deg2rad(SUN)
    scene = mi.load_dict(
        {
            "type": "scene",
            "sun": {
                "type": "directional",
                "direction": [np.sin(sun), 0, -np.cos(sun)],
                "irradiance": 1.0,
            },
            "slab": {
                "type": "cube",
                "to_world": mi.ScalarTransform4f().scale([_WIDE, _WIDE, TAU / 2]),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "homogeneous",
                    "sigma_t": 1.0,
                    "albedo": ALBEDO,
                    "phase": {"type": "hg", "g": G},
                },
            },
            "meter": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, TAU if above else -TAU]) @ turn,
                "bsdf": {"type": "null"},
                "sensor": meter,
            },
        }
    )
    orders = (1, 2, 3)
    by_depth = {
        depth: mi.load_dict({"type": "volpath", "max_depth": depth, "rr_depth": 1_000_000})
        for depth in range(1, max(orders) + 2)
    }
    measured = np.array(
        [
            [irradiance(scene, integrator, seed) for seed in range(_SEEDS)]
            for integrator in by_depth.values()
        ]
    ) / np.cos(sun)
    by_order = np.diff(measured, axis=0)
    numbers = slab_numbers(slab_request(TAU, SUN, phase=f"hg:{G}", albedo=ALBEDO, orders=orders))
    for order, values in zip(orders, by_order, strict=True):
        error = values.std(ddof=1) / np.sqrt(_SEEDS)
        expected = numbers["orders"][order - 1][side]
        assert values.mean() == pytest.approx(expected, abs=4.5 * error), order
        assert error < 0.01 * expected
