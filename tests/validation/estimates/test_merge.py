# SPDX-License-Identifier: BSD-3-Clause
"""References of several machines as one."""

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.exr import Image
from validation.estimates.merge import merged_references

SHAPE = (3, 4, 3)


def batch_means(seeds):
    """Random batch means, the same for a seed in every file, (batches, 2, height, width, 3)."""
    return np.stack([np.random.default_rng(seed).exponential(size=(2, *SHAPE)) for seed in seeds])


def header(seeds, words):
    return {
        "airlight:scene": "fog",
        "airlight:scene_digest": "ab12",
        "airlight:estimator": "volpath",
        "airlight:spp": 16 * len(seeds),
        "airlight:batch_spp": 16,
        "airlight:batches": len(seeds),
        "airlight:seed": min(seeds),
        "airlight:seeds": words,
        "airlight:version:mitsuba": "3.9.1",
    }


def reference(numbers, words, **changes):
    means = batch_means(numbers)
    layers = {}
    for number, name in enumerate(("airlight", "surface")):
        layers[name] = means[:, number].mean(axis=0)
        layers[f"{name}_se"] = means[:, number].std(axis=0, ddof=1) / np.sqrt(len(numbers))
    own = {f"airlight:{name.replace('__', ':')}": value for name, value in changes.items()}
    return Image(layers, np.full(SHAPE[:2], 7.0), header(numbers, words) | own)


A, B, C = (range(4), "0-3"), ((4, 5, 9), "4-5,9"), ((6, 7, 8, 10, 11), "6-8,10-11")


@pytest.mark.claim("merge")
def test_moments_are_those_of_all_batches():
    merged = merged_references([(words, reference(seeds, words)) for seeds, words in (A, B, C)])
    means = batch_means(range(12))
    for number, name in enumerate(("airlight", "surface")):
        np.testing.assert_allclose(merged.layers[name], means[:, number].mean(axis=0), rtol=1e-13)
        error = means[:, number].std(axis=0, ddof=1) / np.sqrt(12)
        np.testing.assert_allclose(merged.layers[f"{name}_se"], error, rtol=1e-12)
    expected = {"spp": 192, "batches": 12, "seed": 0, "seeds": "0-11", "merged": 3, "estimator": "volpath"}
    assert {name: merged.attributes[f"airlight:{name}"] for name in expected} == expected


@pytest.mark.claim("merge")
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"scene_digest": "cd34"}, r"a.exr and b.exr differ in the scene or its size \(ab12 and cd34\)"),
        ({"estimator": "single-scatter"}, r"differ in the estimator \(volpath and single-scatter\)"),
        ({"seeds": "3-5"}, "a.exr and b.exr share the seeds 3; compute one of them again with another --seed"),
        ({"seeds": "4-9"}, "b.exr: its header names 6 seeds and 3 batches"),
        ({"seeds": ""}, "b.exr is no Monte Carlo reference of `airlight reference`: it lacks seeds"),
    ],
)
def test_files_that_do_not_go_together_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        merged_references([("a.exr", reference(*A)), ("b.exr", reference(*B, **changes))])
