# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes of a light at infinity, in bounded media.

Claim: they are as exact as those of a light with a place, whatever lies along the light. The truth casts its own rays,
bisects its lit intervals and shares nothing with this side.
"""

from typing import Any

import numpy as np
import pytest

from tests.helpers.planes import CAMERA, casters_of, index_of
from tests.helpers.sunlit import plank, read, relative_rmse, render, shaded, sun
from tests.realtime.methods.shadow_planes.test_view_culling import boxes, camera_at, sees
from validation.scenes.parts import mitsuba_mesh, placed, rotation
from validation.scenes.solids import box

CAMERA_AT = np.array([0.2, -4.1, 1.3])  # of `tests.helpers.scenes`


def solid(sides, centre) -> Any:
    """Return a box that casts shadows."""
    return mitsuba_mesh("solid", placed(box(sides), centre), (0.4, 0.5, 0.3))


NAMES = ["aslant", "two media", "along the view", "against the view", "parallel to edges", "in a shadow"]


def scenes() -> dict[str, dict[str, Any]]:
    """Return sunlit scenes with casters that are meshes, by what is hard about them."""
    beam = solid((0.5, 0.4, 0.3), (0.33, 0.27, 1.75))
    ahead = np.array([0.1, 0.0, 0.6]) - CAMERA_AT
    plate = solid((3.1, 0.07, 3.3), CAMERA_AT + np.array([0.3, -0.9, 0.2]))
    return {
        "aslant": shaded(solid=beam),
        "two media": shaded(solid=beam, plank=plank(), other=solid((0.2, 0.3, 0.9), (-0.6, 0.1, 2.6))),
        # The image of the light is the middle of the image: rays beside it lie along the planes.
        "along the view": shaded(solid=solid((0.4, 0.3, 0.3), (0.753, -1.67, 1.17)), lamp=sun(ahead)),
        "against the view": shaded(solid=solid((0.5, 0.3, 0.4), (0.2, 1.4, 0.6)), lamp=sun(-ahead), floor=None),
        # Four sides of the box are edge-on, and its upright edges are points as the light sees it.
        "parallel to edges": shaded(solid=beam, lamp=sun((0.0, 0.0, -1.0))),
        "in a shadow": shaded(solid=beam, plate=plate, lamp=sun((0.05, 0.9, -0.3))),
    }


@pytest.mark.parametrize("name", NAMES)
def test_against_the_truth(variant, name):
    import mitsuba as mi

    from validation.estimates.quadrature import truth_image

    scene = scenes()[name]
    truth = truth_image(mi.load_dict(scene)).airlight
    loaded = read(scene)
    unshadowed = render(loaded).airlight
    assert relative_rmse(unshadowed, truth) > 0.02  # there is a shadow
    # The panels of two media leave 3e-6 without any shadow; the rest is the truth's rays, cast in float32.
    allowed = 1e-5 if name == "two media" else 2e-6
    assert relative_rmse(render(loaded, "shadow-planes").airlight, truth) < allowed
    assert relative_rmse(render(scene, "shadow-planes", precision="single").airlight, truth) < 5e-5


@pytest.mark.parametrize("name", ["torus", "open cylinder"])
def test_planes_are_the_limit_of_a_light_far_away(variant, name):
    """In the frame of each: quotients over D, spans and gains agree to the ratio of sizes."""
    casters = casters_of(name)
    toward = np.array([0.37, -0.61, 0.7]) / np.linalg.norm([0.37, -0.61, 0.7])
    far = 1e7
    directional = index_of(casters, np.append(toward, 0.0), precision="double")
    faraway = index_of(casters, CAMERA + far * toward, precision="double")
    assert float(np.array(directional.layers)[0]) == float(np.array(faraway.layers)[0])
    spans, distant = (np.array(index.spans).reshape(-1, 4) for index in (directional, faraway))
    count = int(np.max(np.flatnonzero(np.any(spans != 0, axis=1)))) + 1
    assert count > 10
    assert np.array_equal(spans[:count, 2], distant[:count, 2])  # layers gained
    np.testing.assert_allclose(spans[:count, :2], distant[:count, :2], atol=1e-5)
    lines, distant = (np.array(index.lines).reshape(-1, 4)[:count] for index in (directional, faraway))
    # 1/x = P x + Q y is the limit of (A x + B y - z)/D, and A - D P that of A.
    scale = np.abs(lines[:, :2]).max(axis=1, keepdims=True)
    assert np.max(np.abs(distant[:, :2] / far - lines[:, :2]) / scale) < 1e-5
    assert np.max(np.abs(distant[:, 2:] - lines[:, :2]) / scale) < 1e-5


def test_layers_towards_a_light_at_infinity_are_counted(variant):
    from realtime.methods.shadow_planes.plane_table import layers_between, light_basis

    casters = casters_of("nested spheres", "open cylinder")
    rng = np.random.default_rng(4)
    used = np.ones(len(casters.closed), dtype=bool)
    counts = []
    for _ in range(60):
        camera = 1.2 * rng.normal(size=3)
        light = np.append(unit(rng.normal(size=3)), 0.0)
        far = camera + 1e5 * light[:3]
        here = layers_between(casters, light, light_basis(light, camera), used=used)
        assert here == layers_between(casters, far, light_basis(far, camera), used=used)
        counts.append(here)
    assert len(set(counts)) > 1


def unit(vector):
    return vector / np.linalg.norm(vector)


def test_no_component_is_dropped_whose_parallel_shadow_is_seen(variant):
    from realtime.methods.shadow_planes.view_culling import components_in_view

    rng = np.random.default_rng(12)
    dropped = 0
    for _ in range(20):
        casters = boxes(rng, 8)
        along, origin, target = rng.normal(size=(3, 3)) * 3
        camera = camera_at(origin, target)
        used = components_in_view(casters, camera, np.append(-unit(along), 0.0))
        for component, (low, high) in enumerate(casters.boxes):
            points = rng.uniform(low, high, (4000, 3))
            beyond = rng.exponential(10, (len(points), 1)) * (rng.random((len(points), 1)) < 0.9)
            if sees(camera, points + beyond * unit(along)).any():
                assert used[component]
        dropped += int(np.sum(~used))
    assert dropped > 20


@pytest.mark.parametrize("parameters", [{"order": "none"}, {"order": "paper"}, {"buffer": "8bit"}, {"sum": "gamma"}])
def test_published_variants_take_it(variant, parameters):
    """Where one caster stands before the light all orders agree; what the paper's buffer cuts off is a 255th."""
    scene = shaded(solid=solid((0.5, 0.4, 0.3), (0.33, 0.27, 1.75)), floor=None)
    frame = render(scene, "shadow-planes")
    exact, brightest = frame.airlight, float((frame.airlight + frame.surface).max())
    # The buffer holds surfaces too.
    white = {"white": 2 * brightest} if "buffer" in parameters else {}
    published = render(scene, "shadow-planes", **parameters, **white).airlight
    assert np.max(np.abs(published - exact)) < (0.05 * brightest if white else 1e-9 * exact.max())


def test_adaptive_sampling_and_one_record_for_a_light_that_turns(variant):
    from dataclasses import replace

    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.animate import turned_light

    scene = read(shaded(solid=solid((0.5, 0.4, 0.3), (0.33, 0.27, 1.75)), size=(48, 36)), "single")
    method, kernel = METHODS["shadow-planes"], KERNELS["exact"].function
    renderer = frame_renderer(scene, method, kernel=kernel)
    first = render_frame(renderer).airlight
    assert relative_rmse(render(scene, "shadow-planes", tolerance=0.01).airlight, first) < 0.01
    moved = replace(scene, lights=(turned_light(scene.lights[0], np.zeros(3), rotation((0, 0, 1), 40.0)),))
    again = render_frame(replace(renderer, scene=moved)).airlight
    assert relative_rmse(again, render(moved, "shadow-planes").airlight) < 1e-6
    assert relative_rmse(again, first) > 0.01
