# SPDX-License-Identifier: BSD-3-Clause
import drjit as dr
import mitsuba as mi
import pytest

from reference.monte_carlo.volpath.integrator import volpath_batch
from reference.scene.read import read_reference
from tests.helpers.scenes import tiny_scene
from tests.helpers.volpath import assert_volpath_agrees


@pytest.fixture(scope="module")
def reference(variant):
    return read_reference(mi.load_dict(tiny_scene()))


def test_one_kernel_serves_any_number_of_samples(reference):
    """Rationale: a kernel is compiled anew for how the memory lies that it reads, and NumPy's lies anywhere."""
    kernels = [_large_kernels(reference, samples=samples, seed=samples) for samples in (3, 4, 5, 8)]
    assert len(set(map(tuple, kernels))) == 1


def _large_kernels(reference, *, samples, seed=0):
    """Return the hashes of the kernels of a batch that trace paths, in the order of their launches."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        volpath_batch(reference, seed, samples)
        return [each["hash"] for each in dr.kernel_history((dr.KernelType.JIT,)) if each["operation_count"] > 1000]


@pytest.mark.claim("volpath-agrees")
@pytest.mark.statistical
@pytest.mark.parametrize("colour", ["grey", "coloured"])
def test_agrees_with_the_quadrature(variant, colour):
    """Rationale: two routes that share no code lead to the same radiance, airlight and surface.

    Setup: sphere and floor, 16 x 12 pixels, 32 batches of 256 samples, shadow-ray epsilon corrected.
    Expected: pooled relative bias within four standard errors (a false alarm in 16 000 runs), which are below 2 %.
    """

    fog = tiny_scene()["fog"]
    if colour == "coloured":
        fog |= {"sigma_t": {"type": "rgb", "value": [0.1, 0.3, 0.7]}, "has_spectral_extinction": True}
    reference = read_reference(mi.load_dict(tiny_scene(fog=fog)))
    assert_volpath_agrees(reference, batches=32, least_precision=0.02)
