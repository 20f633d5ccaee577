# SPDX-License-Identifier: BSD-3-Clause
"""A frame's airlight is the integral of the reference, in both precisions; frames replay what was recorded once."""

import numpy as np
import pytest

from tests.helpers.frames import frame, relative_rmse, truth
from tests.helpers.scenes import spot, tiny_scene

SCENES = {
    "grey": dict,
    "hard spot": lambda: {"lamp": spot()},
    "soft spot": lambda: {"lamp": spot(cutoff=37.0, beam=19.0)},
    "two lights, colour, HG": lambda: {
        "spot": spot(beam=11.0),
        "fog": {
            "type": "homogeneous",
            "id": "fog",
            "sigma_t": {"type": "rgb", "value": [0.1, 0.4, 0.9]},
            "albedo": 0.83,
            "phase": {"type": "hg", "g": 0.53},
        },
    },
    "tabulated": lambda: {
        "fog": tiny_scene()["fog"] | {"phase": {"type": "tabphase", "values": "0.3, 0.2, 0.4, 0.9, 2.0"}}
    },
}


def render(method, *, scene=None, **options):
    return frame(scene or tiny_scene(), method, **options)


def without_shadows(name):
    return tiny_scene(ball=None, floor=None, **SCENES[name]())


@pytest.mark.claim("unshadowed-integral")
@pytest.mark.parametrize(("name", "kernel"), [*((name, "exact") for name in SCENES), ("grey", "quadrature")])
def test_integral_without_shadows_is_that_of_the_reference(variant, name, kernel):
    """Two routes that share no code."""
    scene = without_shadows(name)
    integral = render("unshadowed", kernel=kernel, precision="double", scene=scene).airlight
    # Kernels promise 1e-6. Sixteen nodes a panel know nothing of the kinks of a coarse phase table: 1e-3.
    assert relative_rmse(integral, truth(scene).airlight) < (1e-3 if name == "tabulated" else 1e-6)


@pytest.mark.claim("one-source-two-precisions")
@pytest.mark.parametrize("name", ["soft spot", "tabulated"])
def test_single_and_double_precision_agree(variant, name):
    scene = tiny_scene(**SCENES[name]())
    single = render("unshadowed", kernel="quadrature", scene=scene)
    double = render("unshadowed", kernel="quadrature", precision="double", scene=scene)
    # Silhouette pixels see another surface if their ray differs in the last bit.
    same = np.isclose(single.distance, double.distance, rtol=1e-4)
    assert same.mean() > 0.97
    # The kinks of a coarse phase table fall between other nodes, as double precision looks at more of an endless ray.
    assert relative_rmse(single.airlight[same], double.airlight[same]) < (3e-3 if name == "tabulated" else 1e-5)
    assert single.airlight.dtype == np.float32
    assert double.airlight.dtype == np.float64


# Uniform steps see their order later: an endless ray is 65 m long, and the light 4 m away.
@pytest.mark.slow
@pytest.mark.claim("march-orders", tolerance="order 2 within 0.15")
@pytest.mark.parametrize(("spacing", "first"), [("equiangular", 32), ("uniform", 512)])
def test_marching_is_of_second_order_without_shadows(variant, spacing, first):
    # Away from the light, where few steps are enough to see the order.
    scene = tiny_scene(ball=None, lamp=tiny_scene()["lamp"] | {"position": [2.9, 1.3, 3.7]})
    exact = render("unshadowed", kernel="quadrature", precision="double", scene=scene).airlight
    steps = first * np.array([1, 2, 4, 8])
    errors = [
        relative_rmse(
            render("ray-march", precision="double", scene=scene, steps=int(n), spacing=spacing, shadow="none").airlight,
            exact,
        )
        for n in steps
    ]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2, abs=0.15)  # the midpoint rule


@pytest.mark.claim("march-maps", tolerance="2e-3 at the largest map")
def test_shadow_map_converges_to_shadow_rays(variant):
    scene = tiny_scene(size=(48, 36), spot=spot(beam=20.0))
    rays = render("ray-march", scene=scene, steps=200).airlight
    errors = [
        relative_rmse(render("ray-march", scene=scene, steps=200, shadow="map", map=size).airlight, rays)
        for size in (16, 128, 1024)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 2e-3
    assert render("ray-march", scene=scene, shadow="none").airlight.sum() > rays.sum()


@pytest.mark.claim("radiance", tolerance="1e-6 and 1e-4 relative: float32")
def test_radiance_scales_with_light_and_length(variant):
    """Intensity times k: radiance times k. Lengths times k, coefficients over k: radiance over k^2."""
    import mitsuba as mi

    base = tiny_scene(ball=None, floor=None)
    bright = base | {"lamp": base["lamp"] | {"intensity": {"type": "rgb", "value": [15.0, 12.0, 9.0]}}}
    airlight = render("unshadowed", kernel="quadrature", scene=base).airlight
    assert render("unshadowed", kernel="quadrature", scene=bright).airlight == pytest.approx(3 * airlight, rel=1e-6)
    large = base | {
        "fog": base["fog"] | {"sigma_t": 0.31 / 4},
        "lamp": base["lamp"] | {"position": [3.6, 2.8, 7.6]},
        "sensor": base["sensor"]
        | {"to_world": mi.ScalarTransform4f().look_at([0.8, -16.4, 5.2], [0.4, 0.0, 2.4], [0, 0, 1])},
    }
    scaled = render("unshadowed", kernel="quadrature", scene=large).airlight
    assert scaled == pytest.approx(airlight / 16, rel=1e-4)  # float32 of the camera's matrix, amplified near the light


@pytest.mark.claim("frames-are-replayed")
def test_frames_replay_without_new_kernels(variant):
    """The frozen stages are recorded once and launch the same few kernels each time, also after the light moved."""
    import dataclasses

    import drjit as dr
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer, run_stages
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    scene = read_scene(mi.load_dict(tiny_scene()))
    renderer = frame_renderer(scene, METHODS["unshadowed"], kernel=KERNELS["quadrature"].function)
    run_stages(renderer, ())
    counts, recordings = [], []
    for height in (1.9, 2.3, 2.7, 3.1):
        moved = dataclasses.replace(scene.lights[0], position=mi.Vector3f(0.9, 0.7, height))
        dr.make_opaque(moved.position)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            run_stages(dataclasses.replace(renderer, scene=dataclasses.replace(scene, lights=(moved,))), ())
            counts.append(len([k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]))
            recordings.append(renderer.render.n_recordings)
    assert counts[1:] == [2, 2, 2]  # surface, airlight
    assert recordings[1:] == [recordings[0]] * 3
