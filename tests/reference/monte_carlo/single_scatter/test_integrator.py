# SPDX-License-Identifier: BSD-3-Clause
"""The integrator `single-scatter` against everything that leads to the same
radiance without its code.
"""

from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import t

from airlight.reference.monte_carlo.batches import merged
from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from tests.helpers.scenes import spot, tiny_scene
from tests.helpers.suns import ball_over_floor, brick, pearl, sun, sunny

_BATCHES = 32


def _load(**changes):
    return mi.load_dict(tiny_scene(**changes))


def _run(reference, *, samples=64, batches=_BATCHES):
    return reduce(
        merged, (single_scatter_batch(reference, seed, samples) for seed in range(batches))
    )


FOG = {"type": "homogeneous", "id": "fog", "sigma_t": 0.31, "albedo": 0.8}
COLOURED = {"sigma_t": {"type": "rgb", "value": [0.1, 0.3, 0.7]}, "has_spectral_extinction": True}
HG = {"phase": {"type": "hg", "g": 0.6}}
FOGS = {
    "sphere and floor": tiny_scene,
    "no surface": lambda: tiny_scene(ball=None, floor=None),
    "spot": lambda: tiny_scene(lamp=spot()),
    "soft spot": lambda: tiny_scene(lamp=spot(beam=11.0)),
    "two lights": lambda: tiny_scene(second=spot(beam=11.0)),
    "forward lobe": lambda: tiny_scene(fog=FOG | {"phase": {"type": "hg", "g": 0.8}}),
    "backward lobe": lambda: tiny_scene(fog=FOG | {"phase": {"type": "hg", "g": -0.5}}),
    "rayleigh": lambda: tiny_scene(fog=FOG | {"phase": {"type": "rayleigh"}}),
    "coloured": lambda: tiny_scene(fog=FOG | COLOURED),
    "dense": lambda: tiny_scene(fog=FOG | {"sigma_t": 2.3}),
    "nine lamps": lambda: tiny_scene(**lamps(9), second=spot(beam=11.0)),
}


def in_media(**changes):
    """Return a box and a sphere of fog behind an occluder."""
    occluder = tiny_scene()["ball"] | {"center": [0.3, 0.45, 1.2], "radius": 0.21}
    scene = sunny(size=(16, 12), brick=brick(**HG), pearl=pearl(), occluder=occluder) | changes
    return {name: entry for name, entry in scene.items() if entry is not None}


def lamp(**changes):
    return tiny_scene()["lamp"] | changes


def lamps(count):
    """Return point lights of unlike power at unlike places."""
    x, y, z = tiny_scene()["lamp"]["position"]
    return {
        f"lamp-{k}": lamp(
            position=[x + 0.13 * k, y - 0.07 * (k % 3), z + 0.11 * (k % 4)],
            intensity={"type": "rgb", "value": [0.3 + k, 1.7, 2.9 / (1 + k)]},
        )
        for k in range(count)
    }


#: Media in bounds, under suns and lamps: segments are walked from boundary to boundary.
MEDIA = {
    "sun on box and sphere": lambda: in_media(**ball_over_floor()),
    "thick, light from behind": lambda: in_media(
        brick=brick((0.71, 0.3, 0.02), scale=3.1), pearl=None, sun=sun([0.1, -1.0, -0.2])
    ),
    "two suns and a lamp": lambda: in_media(
        second=sun([0.4, 0.9, -0.3], (1.0, 2.0, 3.0)), lamp=lamp(), occluder=None
    ),
    "three lamps in and about the box": lambda: in_media(
        sun=None, lamp=lamp(position=[-0.6, 0.3, 0.71]), occluder=None, **lamps(2)
    ),
    "lamp inside of the box": lambda: in_media(
        sun=None, lamp=lamp(position=[-0.6, 0.3, 0.71]), **ball_over_floor()
    ),
}
CASES = FOGS | MEDIA
FAST = (
    "sphere and floor",
    "soft spot",
    "coloured",
    "nine lamps",
    "sun on box and sphere",
    "lamp inside of the box",
)


@pytest.mark.claim(
    "single-scatter-agrees", "bounded-media", tolerance="family level 1e-4; bias within four errors"
)
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in FAST else pytest.mark.statistical) for name in CASES],
)
def test_agrees_with_the_quadrature(variant, name):
    """Rationale: the certified integral over lit intervals and this estimator share no derivation.

    Setup: 16 x 12 pixels, 32 batches of 64 stratified distances, fixed seeds. Expected: each pixel
    within its error at a family level of 1e-4, pooled bias within four standard errors, and those
    below 0.1 %; surfaces, which need no sampling, to the rounding of single precision.
    """
    reference = read_reference(mi.load_dict(CASES[name]()))
    image, batches = quadrature_image(reference), _run(reference)
    expected = image.airlight.reshape(-1, 3)
    mean, error = batches.mean[0], batches.standard_error[0]
    lit = expected > 0
    assert lit.sum() > 60
    assert np.all(mean[~lit] == 0)
    # Rounding in single precision: 3e-6 of a value, to be seen where the sampling error is smaller
    # still; it puts boundaries and segments that are some metres long to 1e-6 m.
    rounding = 3e-6 * (expected + (expected[lit].mean() if name in MEDIA else 0))[lit]
    score = (mean - expected)[lit] / np.hypot(error[lit], rounding)
    assert np.abs(score).max() < t.isf(0.5e-4 / lit.sum(), _BATCHES - 1)
    assert name in MEDIA or np.median(error[lit] / expected[lit]) < 0.01
    for channel in range(3):
        total = expected[:, channel].sum()
        pooled = np.sqrt(np.sum(error[:, channel] ** 2)) / total
        assert pooled < 1e-3
        assert abs(mean[:, channel].sum() / total - 1) < 4 * pooled + (
            3e-6 if name in MEDIA else 1e-6
        )
    # A pixel at the terminator or on an edge of a shadow may fall on either side:
    # none does in these scenes.
    close = 1e-5 if name in MEDIA else 5e-6
    assert batches.mean[1] == pytest.approx(image.surface.reshape(-1, 3), rel=close, abs=1e-12)
    assert np.all(batches.standard_error[1] == 0)


def test_a_lamp_may_stand_at_the_origin(variant):
    reference = read_reference(_load(ball=None, floor=None, lamp=lamp(position=[0.0, 0.0, 0.0])))
    total = _run(reference, batches=4).mean[0].sum(axis=0)
    expected = quadrature_image(reference).airlight.sum(axis=(0, 1))
    assert total == pytest.approx(expected, rel=0.02)


def test_a_sun_is_looked_for_from_the_points_and_not_from_afar(variant):
    """In a box of 40 km a walk from beyond all shapes lost the shadows next to a ball of 0.4 m, and
    2 % of the light of the floor.
    """
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().scale([2e4, 2e4, 3.0])}
    box |= {"bsdf": {"type": "null"}, "interior": {"type": "ref", "id": "fog"}}
    reference = read_reference(_load(lamp=None, sun=sun(), box=box))
    surface = _run(reference, samples=1, batches=1).mean[1]
    expected = quadrature_image(reference).surface.reshape(-1, 3)
    assert (expected.max(axis=1) > 0).sum() > 20
    np.testing.assert_allclose(surface, expected, rtol=1e-4, atol=1e-5 * expected.max())


@pytest.mark.claim("enclosed-light")
def test_enclosed_light_gives_exactly_zero(variant):
    closed = {"type": "sphere", "center": [0.9, 0.7, 1.9], "radius": 0.21}
    batches = _run(read_reference(_load(shell=closed)), batches=2, samples=16)
    assert np.all(batches.mean == 0)


def _kernels(lamps: int) -> set:
    """The compiled kernels of a batch, by their hashes, in a scene with so many lamps."""
    more = {f"lamp-{number}": lamp(position=[0.1 * number, 0.8, 1.7]) for number in range(1, lamps)}
    reference = read_reference(_load(**more))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        single_scatter_batch(reference, 0, 2)
        return {kernel["hash"] for kernel in dr.kernel_history((dr.KernelType.JIT,))}


def test_lamps_share_their_compiled_kernels(variant):
    """A kernel with a loop for each lamp took minutes to compile for 32 of them,
    and did not end for 512.
    """
    assert _kernels(7) == _kernels(2)
