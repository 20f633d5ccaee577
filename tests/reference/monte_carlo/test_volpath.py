# SPDX-License-Identifier: BSD-3-Clause
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.monte_carlo.batches import merged
from airlight.reference.monte_carlo.volpath import stream_of, volpath_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from tests.helpers.scenes import bounded_medium, clear_scene, tiny_scene
from tests.helpers.suns import brick, pearl
from tests.reference.monte_carlo.single_scatter.test_integrator import COLOURED, HG, MEDIA


@pytest.fixture(scope="module")
def reference(variant):
    return read_reference(mi.load_dict(tiny_scene()))


def test_one_kernel_serves_any_number_of_samples(reference):
    """Rationale: a kernel is compiled again for how the memory lies that it reads,
    and NumPy's lies anywhere.
    """
    kernels = [_large_kernels(reference, samples=samples, seed=samples) for samples in (3, 4, 5, 8)]
    assert len(set(map(tuple, kernels))) == 1


def _large_kernels(reference, *, samples, seed=0):
    """Return the hashes of the kernels of a batch that trace paths, in the
    order of their launches.
    """
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        volpath_batch(reference, seed, samples)
        return [
            each["hash"]
            for each in dr.kernel_history((dr.KernelType.JIT,))
            if each["operation_count"] > 1000
        ]


def in_front_of_media():
    """Return a box and a sphere of fog, an occluder that casts a shadow through
    the sphere, and a floor.
    """
    occluder = tiny_scene()["ball"] | {"center": [0.7, 0.45, 1.2], "radius": 0.21}
    cloudy = pearl((0.6, 0.8, 0.3), scale=2.1)
    return clear_scene(brick=brick(**HG), pearl=cloudy, ball=occluder, floor=tiny_scene()["floor"])


def inside_of_media():
    """Return the same with a box of fog around the camera."""
    huge = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().translate([0.1, -3.5, 1.1]).scale(1.5),
    }
    near = bounded_medium(huge, 0.0, (0.0, 0.0, 0.0)) | {"interior": {"type": "ref", "id": "fog"}}
    camera = {"sensor": tiny_scene()["sensor"], "near": near}
    return {"type": "scene", "fog": tiny_scene()["fog"]} | in_front_of_media() | camera


#: Scenes, how many batches, and the standard error that these must leave.
TRACED = {
    "grey": (tiny_scene, 32, 0.02),
    "coloured": (lambda: tiny_scene(fog=tiny_scene()["fog"] | COLOURED), 32, 0.02),
    "camera outside of media": (in_front_of_media, 16, 0.03),
    "camera inside of one": (inside_of_media, 16, 0.03),
    **{
        name: (MEDIA[name], 16, 0.03)
        for name in ("sun on box and sphere", "thick, light from behind")
    },
}


@pytest.mark.claim(
    "volpath-agrees", "bounded-media", tolerance="four standard errors, one of 16 000 by chance"
)
@pytest.mark.statistical
@pytest.mark.parametrize("name", TRACED)
def test_agrees_with_the_quadrature(variant, name):
    """Rationale: two routes that share no code: Mitsuba finds media by walking
    from boundary to boundary.

    Setup: 16 x 12 pixels, batches of 256 samples, the shadow-ray epsilon corrected. Rays to a sun
    end at twice the radius of the scene's bounding sphere, less the epsilon: beyond all media.
    Expected: the pooled bias of each layer and channel within four standard errors, and those below
    what is named.
    """
    make, batches, least_precision = TRACED[name]
    reference = read_reference(mi.load_dict(make()))
    expected = quadrature_image(reference, shadow_scale=1 - measure_shadow_epsilon())
    traced = reduce(
        merged, (volpath_batch(reference, seed, 256) for seed in range(100, 100 + batches))
    )
    for number, image in enumerate((expected.airlight, expected.surface)):
        for channel in range(3):
            total = image[..., channel].sum()
            if total == 0:
                assert not traced.mean[number].any()
                continue
            bias = traced.mean[number][:, channel].sum() / total - 1
            error = np.sqrt(np.sum(traced.standard_error[number][:, channel] ** 2)) / total
            assert error < least_precision
            assert abs(bias) < 4 * error
    again = read_reference(reference.scene)  # tracing leaves the media as they were
    assert [each.sigma_t.tolist() for each in again.media] == [
        each.sigma_t.tolist() for each in reference.media
    ]


def test_no_two_images_channels_or_parts_share_a_stream():
    """The number of parts was a factor: an airlight in two parts and a surface in one of another
    batch shared streams.
    """
    random = np.random.default_rng(7)
    drawn = zip(
        random.integers(0, 2**21, 200_000).tolist(),
        random.integers(0, 3, 200_000).tolist(),
        random.integers(0, 64, 200_000).tolist(),
    )
    images = set(drawn)
    assert len({stream_of(*image) for image in images}) == len(images)
