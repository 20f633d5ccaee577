# SPDX-License-Identifier: BSD-3-Clause
"""`single-scatter` and volpath under directional lights, against the quadrature, and what all of them refuse."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import t

from analytic.errors import InputError
from reference.monte_carlo.batches import merged
from reference.monte_carlo.single_scatter.distance_sampling import sample_stretch
from reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from reference.monte_carlo.single_scatter.scene_data import read_task
from reference.quadrature.image import quadrature_image
from reference.scene.read import read_reference
from tests.helpers.scenes import tiny_scene
from tests.helpers.suns import ball_over_floor, brick, pearl, sun, sunny
from tests.helpers.volpath import assert_volpath_agrees

HG = {"phase": {"type": "hg", "g": 0.6}}


def traced(scene, batches, samples=64):
    """Return quadrature image and batches of single-scatter."""
    reference = read_reference(mi.load_dict(scene))
    done = single_scatter_batch(reference, 0, samples)
    for seed in range(1, batches):
        done = merged(done, single_scatter_batch(reference, seed, samples))
    return quadrature_image(reference), done


def occluder():
    return tiny_scene()["ball"] | {"center": [0.3, 0.45, 1.2], "radius": 0.21}


CASES = {
    "box and sphere": lambda: sunny(
        size=(16, 12), brick=brick(**HG), pearl=pearl(), occluder=occluder(), **ball_over_floor()
    ),
    "thick, light from behind": lambda: sunny(
        size=(16, 12), brick=brick((0.71, 0.3, 0.02), scale=3.1), sun=sun([0.1, -1.0, -0.2]), occluder=occluder()
    ),
    "two suns and a lamp": lambda: sunny(
        size=(16, 12),
        brick=brick(**HG),
        pearl=pearl(),
        second=sun([0.4, 0.9, -0.3], (1.0, 2.0, 3.0)),
        lamp=tiny_scene()["lamp"],
    ),
}


@pytest.mark.claim("single-scatter-agrees", tolerance="four to six standard errors")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "box and sphere" else pytest.mark.statistical) for name in CASES]
)
def test_single_scatter_agrees_with_the_quadrature(variant, name):
    """Rationale: legs are walked from boundary to boundary, distances are random: no derivation is shared.

    Setup: 16 x 12 pixels, 32 batches of 64 distances, fixed seeds.
    Expected: each pixel within its error at a family level of 1e-4, pooled bias within four standard errors, and those
    below 0.1 %; surfaces to single precision.
    """
    image, batches = traced(CASES[name](), 32)
    expected = image.airlight.reshape(-1, 3)
    mean, error = batches.mean[0], batches.standard_error[0]
    lit = expected > 0
    assert lit.sum() > 60
    assert np.all(mean[~lit] == 0)
    # Single precision puts boundaries and legs that are some metres long to 1e-6 m: 3e-6 of a value, and of its mean.
    score = (mean - expected)[lit] / np.hypot(error[lit], 3e-6 * (expected[lit] + expected[lit].mean()))
    assert np.abs(score).max() < t.isf(0.5e-4 / lit.sum(), 31)
    for channel in range(3):
        total = expected[:, channel].sum()
        pooled = np.sqrt(np.sum(error[:, channel] ** 2)) / total
        assert pooled < 1e-3
        assert abs(mean[:, channel].sum() / total - 1) < 4 * pooled + 3e-6
    assert batches.mean[1] == pytest.approx(image.surface.reshape(-1, 3), rel=1e-5, abs=1e-12)


@pytest.mark.claim("sampled-distances")
def test_sampled_distances_have_their_density(variant):
    """The mean of 1/density over the samples is the length; the density is below 1/(2 length) nowhere."""
    count = 4096
    u = mi.Float((np.arange(count) + 0.5) / count)
    for sigma_t in ([0.0], [1.3], [0.2, 3.0, 40.0]):
        y, density = (np.array(part, dtype=np.float64) for part in sample_stretch(u, mi.Float(1.7), sigma_t))
        assert np.all((y >= 0) & (y <= 1.7000001))
        assert density.min() >= 0.5 / 1.7 * (1 - 1e-6)
        # The midpoint rule in u, whose integrand has a jump between the techniques: 1/count.
        assert np.mean(1 / density) == pytest.approx(1.7, rel=2e-3)
        assert np.mean(y**2 / density) == pytest.approx(1.7**3 / 3, rel=2e-3)


@pytest.mark.claim("volpath-agrees")
@pytest.mark.statistical
@pytest.mark.parametrize("name", ["box and sphere", "thick, light from behind"])
def test_volpath_agrees(variant, name):
    """Rationale: Mitsuba's own path tracer, which finds the media by walking towards the light.

    Its shadow rays end at twice the radius of the scene's bounding sphere, less the epsilon: beyond all media.
    """

    assert_volpath_agrees(read_reference(mi.load_dict(CASES[name]())), batches=16, least_precision=0.03)


@pytest.mark.claim("directional-wants-bounds")
@pytest.mark.parametrize("estimator", ["quadrature", "single-scatter"])
@pytest.mark.parametrize("bounded", [False, True], ids=["fog alone", "a body in fog"])
def test_medium_without_bounds_is_refused(variant, estimator, bounded):
    body = {"brick": brick() | {"exterior": {"type": "ref", "id": "fog"}}} if bounded else {}
    scene = mi.load_dict(tiny_scene(lamp=None, sun=sun(), **body))
    medium = scene.sensors()[0].get_medium()
    read = {"quadrature": lambda: read_reference(scene), "single-scatter": lambda: read_task(scene, medium, 4)}[
        estimator
    ]
    with pytest.raises(InputError, match=r"light 'sun' is directional: .* give the medium bounds") as refusal:
        read()
    assert "\n" not in str(refusal.value)
