# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of Billeter 2010: their meshes, what the lamp reaches, and that methods and truth agree about it."""

from functools import cache

import numpy as np
import pytest

from validation.scenes.omni_box import SCENE as OMNI_BOX
from validation.scenes.omni_box import _bars, _standing
from validation.scenes.tangle import _TUBES, _WAVES, _bent, _tubes
from validation.scenes.tangle import SCENE as TANGLE

RECORDS = {record.name: record for record in (OMNI_BOX, TANGLE)}


@cache
def parts(name):
    """Return the parts of a scene that must be closed, {part: mesh}."""
    if name == "omni-box":
        return {f"box {number}": mesh for number, mesh in enumerate([*_bars(), *_standing()])}
    vertices, faces = _tubes()
    ends = np.cumsum([tube.cells[0] * tube.cells[1] for tube in _TUBES]).tolist()
    cut = {}
    for number, (first, last) in enumerate(zip([0, *ends], ends, strict=False)):
        own = faces[(faces[:, 0] >= first) & (faces[:, 0] < last)]
        cut[f"tube {number}"] = vertices[first:last], own - first
    return cut


@cache
def scene_of(name, size):
    """Return a scene as methods read it."""
    from realtime.scene.read_scene import read_scene
    from validation.scenes.loading import load_scene

    return read_scene(load_scene(name, size).scene)


def test_tangle_is_bent_without_folding_space():
    """Two points move against each other by less than they are apart: the waves' Lipschitz bounds add to below 1."""
    assert sum(np.linalg.norm(displacement) * np.linalg.norm(wave) for displacement, wave, _ in _WAVES) < 1
    points = np.random.default_rng(20100621).uniform(-1.7, 1.7, (4000, 3))
    step = 1e-5
    columns = [(_bent(points + step * axis) - _bent(points - step * axis)) / (2 * step) for axis in np.eye(3)]
    determinants = np.linalg.det(np.stack(columns, axis=2))
    assert determinants.min() > 0
    assert determinants.max() / determinants.min() > 2  # and yet it is bent


def frame_of(name, method, *, kernel=None, **parameters):
    """Return a small frame of a scene."""
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS

    function = KERNELS[kernel].function if kernel else None
    return render_frame(frame_renderer(scene_of(name, (24, 18)), METHODS[method], kernel=function, **parameters))


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDS)
def test_shadows_take_most_of_some_pixels_and_little_of_others(variant, name):
    """By the truth against the same frame without volumetric shadows; and marching finds the same shadows."""
    from validation.estimates.quadrature import truth_image
    from validation.scenes.loading import load_scene

    truth = truth_image(load_scene(name, (24, 18)).scene).airlight[..., 1]
    kept = truth / frame_of(name, "unshadowed", kernel="exact").airlight[..., 1]
    assert kept.max() < 1 + 1e-5  # shadows add nothing; float32 keeps 1e-6
    assert kept.min() < 0.5
    assert kept.max() > 0.9
    marched = frame_of(name, "ray-march", steps=400).airlight[..., 1]
    # 400 steps miss a little at each edge of a shadow: 8e-4 and 3e-3 of the mean.
    assert np.sqrt(np.mean((marched - truth) ** 2)) < 0.01 * truth.mean()
