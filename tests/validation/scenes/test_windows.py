# SPDX-License-Identifier: BSD-3-Clause
import numpy as np

from validation.scenes.windows import SCENE


def loaded(size):
    import mitsuba as mi

    from validation.scenes.loading import resize

    scene = mi.load_dict(SCENE.build())
    resize(scene, size)
    return scene


def test_sun_comes_in_by_the_windows_alone(variant):
    """Lit parts of rays lead back to a pane: what the wall's openings let through, in coordinates of the wall."""
    from reference.quadrature.segments import camera_segments, scattering_range
    from reference.quadrature.surface import surface_hits
    from reference.scene.read import read_truth
    from reference.visibility.directional_casting import directional_intervals
    from reference.visibility.parallel_rays import parallel_rays
    from validation.scenes.windows import _FRONT, _LEFT, _PANES_ALONG, _PANES_UP

    truth = read_truth(loaded((40, 30)))
    span = scattering_range(camera_segments(truth, surface_hits(truth).distance))
    rays = parallel_rays(truth.origin, truth.direction, truth.directional[0], span)
    intervals = directional_intervals(truth, rays)
    assert intervals.transitions > 500
    assert intervals.random_checks.left == 0
    x = rays.distance(intervals.ray, 0.5 * (intervals.low + intervals.high))
    point = truth.origin + x[:, None] * truth.direction[intervals.ray]
    towards = -truth.directional[0].direction
    at_wall = point + ((_LEFT - point[:, 0]) / towards[0])[:, None] * towards
    along, up = np.searchsorted(_PANES_ALONG, at_wall[:, 1] - _FRONT), np.searchsorted(_PANES_UP, at_wall[:, 2])
    assert np.all((along % 2 == 1) & (up % 2 == 1))
