# SPDX-License-Identifier: BSD-3-Clause
"""A user's shader is a method: it is given the rays, lights, maps and images that the page says,
and its faults have the user's file and line."""

import math
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.errors import NoDriverError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import find_method
from airlight.realtime.methods.shader.client import ShaderHost
from airlight.realtime.methods.shader.source import Pass, read_shader
from airlight.realtime.scene.animate import thicker_medium
from airlight.realtime.scene.camera import read_camera
from airlight.realtime.scene.phase import named_phase
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.frames import reference_of, relative_rmse, render
from tests.helpers.scenes import bounded_medium, spot, tiny_scene
from tests.helpers.shaders import EXAMPLES, need_opengl

pytestmark = pytest.mark.usefixtures("variant")

_EMPTY = {"ball": None, "floor": None}
_BLACK = "vec3 airlight(Ray ray) { return vec3(0.0); }"
_TABLE = {"type": "tabphase", "values": "1, 2, 9"}


@pytest.fixture
def drawn(tmp_path):
    """Return what a shader draws of a scene."""
    need_opengl()

    def draw(text: str, scene=None, **parameters):
        path = tmp_path / "fog.glsl"
        path.write_text(text)
        read = read_scene(mi.load_dict(tiny_scene(size=(31, 17)) if scene is None else scene))
        return render_frame(frame_renderer(read, find_method(str(path)), **parameters))

    return draw


def _refusal(path) -> str:
    with pytest.raises(InputError) as raised:
        frame_renderer(read_scene(mi.load_dict(tiny_scene(**_EMPTY))), find_method(str(path)))
    return str(raised.value)


def _fog(g: float) -> dict:
    fog = dict(tiny_scene()["fog"])
    return {"fog": fog | {"phase": {"type": "hg", "g": g}}}


# Inputs -------------------------------------------------------------------------------------------


def test_rays_are_those_of_the_camera_row_by_row_and_by_their_place_in_the_image(drawn):
    scene = tiny_scene(size=(31, 17))
    camera = read_camera(read_scene(mi.load_dict(scene)).camera)
    column, row = np.meshgrid(np.arange(31), np.arange(17))
    rays = (
        camera.forward
        + ((15 - column)[..., None] * camera.left)
        + ((8 - row)[..., None] * camera.up)
    )
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    np.testing.assert_allclose(
        drawn("vec3 airlight(Ray ray) { return ray.direction; }").airlight, rays, atol=2e-7
    )
    by_place = "vec3 airlight(Ray ray) { return ray_through((vec2(ray.pixel) + 0.5) / vec2(resolution)).direction; }"
    np.testing.assert_allclose(drawn(by_place).airlight, rays, atol=4e-7)


def test_surfaces_have_distance_normal_and_reflectance(drawn):
    found = drawn("vec3 airlight(Ray ray) { return ray.hit ? vec3(ray.distance) : vec3(0.0); }")
    np.testing.assert_allclose(
        found.airlight[..., 0], np.where(np.isfinite(found.distance), found.distance, 0)
    )
    floor = drawn(
        "vec3 airlight(Ray ray) { return texelFetch(g_normal, ray.pixel, 0).xyz; }"
    ).airlight[-1, 0]
    np.testing.assert_allclose(floor, [0, 0, 1], atol=1e-6)
    floor = drawn(
        "vec3 airlight(Ray ray) { return texelFetch(g_albedo, ray.pixel, 0).rgb; }"
    ).airlight[-1, 0]
    np.testing.assert_allclose(floor, [0.4, 0.4, 0.5], atol=1e-6)


# Steps beside a texel's edge fall on either side of it: one of 32 in a pixel here and there. Those of
# Dr.Jit's march lie in the cone of a spot, those of the shader on the whole ray: 0.4 % with one.
@pytest.mark.parametrize(("with_spot", "most", "usual"), [(False, 2e-3, 1e-5), (True, 8e-3, 3e-3)])
def test_a_marcher_with_shadow_maps_is_the_one_of_dr_jit_with_the_same_steps(
    drawn, with_spot, most, usual
):
    """Where a spot stands between two point lights, each has its own map."""
    between = {"spot": spot()} if with_spot else {}
    second = {
        "type": "point",
        "position": [-1.1, -0.6, 1.2],
        "intensity": {"type": "rgb", "value": [1.0, 4.0, 2.0]},
    }
    scene = tiny_scene(size=(31, 17), **between, lamp2=second, **_fog(0.4))
    ours = drawn((EXAMPLES / "marcher.glsl").read_text(), scene, STEPS=32, map=256).airlight
    same = render(scene, "ray-march", steps=32, shadow="map", map=256).airlight
    assert relative_rmse(ours, same) < most
    assert np.median(np.abs(ours / same - 1)) < usual


def test_a_marcher_converges_to_the_reference_under_a_soft_spot_in_a_lobe(drawn):
    scene = tiny_scene(size=(16, 12), lamp2=spot(beam=11.0), **_fog(0.7), **_EMPTY)
    text, expected = (EXAMPLES / "marcher.glsl").read_text(), reference_of(scene).airlight
    few, many = (
        relative_rmse(drawn(text, scene, STEPS=steps).airlight, expected) for steps in (64, 512)
    )
    assert many < few / 5
    assert many < 5e-4
    backward = text.replace("phase(-s / r)", "phase(s / r)")
    assert relative_rmse(drawn(backward, scene, STEPS=64).airlight, expected) > 0.2
    even = scene | _fog(0.0)
    assert (
        relative_rmse(drawn(backward, even, STEPS=64).airlight, reference_of(even).airlight) < 0.01
    )


@pytest.mark.parametrize(("phase", "g"), [({"type": "rayleigh"}, 0.0), (_TABLE, None)])
def test_phase_functions_are_in_one_over_steradian(drawn, phase, g):
    scene = tiny_scene(size=(8, 6), fog=dict(tiny_scene()["fog"]) | {"phase": phase}, **_EMPTY)
    found = drawn(
        "vec3 airlight(Ray ray) { return vec3(phase(-0.5), phase(0.25), medium.g); }", scene
    ).airlight[0, 0]
    own = read_scene(mi.load_dict(scene)).medium.phase
    wanted = [float(own.evaluate(mi.Float(c))[0]) / (4 * math.pi) for c in (-0.5, 0.25)]
    # 2 + c below 0 and 2 + 7 c above it: the integral of c p is 8/3, that of p 7
    np.testing.assert_allclose(
        found, [*wanted, 8 / 3 / 7 if g is None else g], rtol=2e-6, atol=1e-7
    )


def test_passes_in_two_and_three_dimensions_have_images_of_this_frame_and_the_last(drawn, tmp_path):
    text = """
#pragma airlight frames 3
#pragma airlight pass count size=W/2xH/2 format=r32f
#pragma airlight pass cells size=W/8x3x5 format=rgba16f
vec4 count(Ray ray) { return texelFetch(count_last, ray.pixel, 0) + 1.0; }
vec4 cells(ivec3 cell, ivec3 cells) { return vec4(cell.x, cell.z, cells.x, texelFetch(count_image, ivec2(0), 0).r); }
vec3 airlight(Ray ray) {
    return vec3(texelFetch(count_image, ray.pixel / 2, 0).r, texelFetch(cells_image, ivec3(3, 2, 4), 0).yw);
}
"""
    assert (drawn(text).airlight == [3, 4, 3]).all()
    renderer = frame_renderer(
        read_scene(mi.load_dict(tiny_scene(**_EMPTY))), find_method(str(tmp_path / "fog.glsl"))
    )
    moved = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    cache = next_frame(renderer, renderer.scene, None, **moved)[1]
    (_, _, airlight), cache = next_frame(renderer, renderer.scene, cache, **moved)
    assert (np.array(airlight[0]) == 4).all()
    assert Pass("a", ("W/4", "H", "64"), "r32f").pixels(31, 17) == (8, 17, 64)


def test_parameters_compile_again_or_are_uniforms(drawn):
    text = """
#pragma airlight set COUNT 3 "how many"
#pragma airlight uniform gain 0.5 "a factor"
#pragma airlight uniform bright true
vec3 airlight(Ray ray) { float all[COUNT]; return bright ? vec3(all.length(), gain, frame) : vec3(0.0); }
"""
    assert (drawn(text).airlight == [3, 0.5, 0]).all()
    assert (drawn(text, COUNT="5", gain="0.25").airlight == [5, 0.25, 0]).all()
    assert (drawn(text, bright="no").airlight == 0).all()
    with pytest.raises(
        InputError, match=r"got a parameter 'COUNTS', expected one of: .*did you mean 'COUNT'"
    ):
        drawn(text, COUNTS=1)


# Faults -------------------------------------------------------------------------------------------


def test_a_mistake_has_the_users_file_and_line_after_an_include_too(tmp_path):
    need_opengl()
    (tmp_path / "own.glsl").write_text(
        "// one\n/* two\nthree */ float own(float x) { return lenght(x); }\n"
    )
    (tmp_path / "fog.glsl").write_text(
        '#version 450\n#extension GL_ARB_gpu_shader5 : enable\n#include "right.glsl"\n'
        "vec3 airlight(Ray ray) {\n    return vec3(right(nowhere));\n}\n"
    )
    (tmp_path / "right.glsl").write_text("float right(float x) { return x; }\n")
    words = "fog.glsl, line 5: `nowhere' undeclared: return vec3(right(nowhere));"
    assert _refusal(tmp_path / "fog.glsl") == f"method {tmp_path / 'fog.glsl'}: {words}"
    (tmp_path / "fog.glsl").write_text(
        '#include "own.glsl"\nvec3 airlight(Ray ray) { return vec3(own(1.0)); }\n'
    )
    assert "own.glsl, line 3: no function with name 'lenght'" in _refusal(tmp_path / "fog.glsl")


@pytest.mark.parametrize(
    ("log", "words"),
    [
        ("0:2(12): error: syntax error\n", "fog.glsl, line 2: syntax error: second"),
        ("0(2) : error C1008: undefined\n", "fog.glsl, line 2: undefined: second"),
        (
            "WARNING: 0:1: that\nERROR: 0:2: 'texture2D' : no\n",
            "line 2: 'texture2D' : no; add `#define texture2D texture`",
        ),
        ("error: too many uniforms\n", "fog.glsl: error: too many uniforms"),
        (
            "0:2(9): error: no f(int); candidates are:\n0:2(9): error:    f(vec2)\n0:2(9): error:  "
            "  f(vec3)\n"
            "0:2(3): error: another\n",
            "line 2: no f(int); candidates are: f(vec2); f(vec3): second",
        ),
    ],
)
def test_messages_of_other_drivers_are_read(tmp_path, log, words):
    (tmp_path / "fog.glsl").write_text("vec3 airlight(Ray ray) {\n  second\n}")
    assert words in read_shader(tmp_path / "fog.glsl").mistake(log)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("// vec3 airlight(Ray ray) {}\n", r"fog\.glsl: no function vec3 airlight\(Ray ray\)"),
        (
            f"#pragma airlight pass half size=W/2xH/2\n{_BLACK}",
            r"no function vec4 half\(Ray ray\)",
        ),
        (
            f"#pragma airlight pass cells size=8x8x8\n{_BLACK}",
            r"no function vec4 cells\(ivec3 cell, ivec3 cells\)",
        ),
        ("#pragma airlight pass half size=2W\n", "line 1: got `pass half size=2W`, expected"),
        ("#pragma airlight pass half size=W/0xH\n", "line 1: got `pass half size=W/0xH`, expected"),
        ("#pragma airlight pass cells size=8x0x8\n", "line 1: got `pass cells size=8x0x8`"),
        ("\n#pragma airlight set STEPS many\n", "line 2: got `set STEPS many`, expected"),
        ("#pragma airlight step 3\n", "line 1: got `#pragma airlight step 3`, expected"),
        (f"#pragma airlight set render 3\n{_BLACK}", "cannot be called render"),
        ('#include "nothing.glsl"\n', "line 1: there is no file"),
        ('#include "fog.glsl"\n', "line 1: fog.glsl includes itself"),
    ],
)
def test_what_no_driver_must_see_is_found_in_the_text(tmp_path, text, words):
    (tmp_path / "fog.glsl").write_text(text)
    with pytest.raises(InputError, match=words):
        find_method(str(tmp_path / "fog.glsl"))


def test_the_help_of_a_parameter_is_no_code_and_may_hold_an_address(tmp_path):
    """Text behind its two slashes was a comment, and `frame` a word of the code."""
    path = tmp_path / "fog.glsl"
    path.write_text(f'#pragma airlight set N 3 "a frame, see http://a.b/c" // "d"\n{_BLACK} // "e')
    source = read_shader(path)
    assert [each.help for each in source.parameters] == ["a frame, see http://a.b/c"]
    assert not {"frame", "d", "e"} & source.words
    assert source.text.splitlines()[1:] == ["", f"{_BLACK}      "]


def test_a_byte_order_mark_before_the_text_changes_nothing(drawn):
    text = "vec3 airlight(Ray ray) { return vec3(ray.distance); }"
    np.testing.assert_array_equal(drawn(f"\ufeff{text}").airlight, drawn(text).airlight)


@pytest.mark.parametrize(
    ("given", "unset"),
    [
        ("uniform vec3 tint; uniform float time;", "time, tint"),
        (
            "uniform vec3 tint = vec3(1.0); uniform sampler2D noise; float time = texture(noise, "
            "vec2(0)).r;",
            "noise",
        ),
        ("buffer Tints { vec3 tint; float time; };", "Tints"),
        (
            "#pragma airlight uniform time 1.0\nuniform struct { vec3 on; } sky; vec3 tint = "
            "sky.on;",
            "sky.on",
        ),
        ("uniform float time = 0.0, other = 2.0; uniform vec3 tint=vec3(1.0);", ""),
    ],
)
def test_what_nothing_sets_is_refused_by_name(drawn, given, unset):
    """OpenGL makes it 0: the image would be black, and no error."""
    text = f"{given}\nvec3 airlight(Ray ray) {{ return tint * (1.0 + time); }}"
    if not unset:
        drawn(text)
        return
    with pytest.raises(InputError, match=f"fog.glsl: nothing sets {unset}; give a uniform a value"):
        drawn(text)


def test_radiance_that_is_not_finite_is_refused_by_pixel(drawn):
    text = "vec3 airlight(Ray ray) { return vec3(ray.pixel.x == 4 && ray.pixel.y < 3 ? sqrt(-ray.distance) : 1.0); }"
    with pytest.raises(
        InputError, match=r"3 of 527 pixels are not finite, the first in column 4 of row 14, ray\."
    ):
        drawn(text)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fog": None, "sensor": None}, "the medium has bounds: fog.glsl renders"),
        (
            {"lamp": {"type": "rectangle", "emitter": {"type": "area", "radiance": 2.0}}},
            "the scene has area lights",
        ),
        (
            {"fog": {"type": "homogeneous", "id": "fog", "sigma_t": 0.0}},
            "nothing is extinguished in a channel",
        ),
    ],
)
def test_scenes_out_of_scope_are_refused_by_name_before_the_driver_starts(
    tmp_path, monkeypatch, changes, words
):
    monkeypatch.setattr(ShaderHost, "__init__", None)
    (tmp_path / "fog.glsl").write_text(_BLACK)
    scene = tiny_scene(**(_EMPTY | changes))
    if "sensor" in changes:
        camera = dict(tiny_scene()["sensor"])
        del camera["medium"]
        body = bounded_medium({"type": "cube"}, 0.3, (0.9, 0.9, 0.9))
        scene |= {"sensor": camera, "body": body}
    with pytest.raises(InputError, match=words):
        frame_renderer(read_scene(mi.load_dict(scene)), find_method(str(tmp_path / "fog.glsl")))


def test_a_phase_function_without_a_text_is_refused_and_not_black(tmp_path, monkeypatch):
    monkeypatch.setattr(ShaderHost, "__init__", None)
    (tmp_path / "fog.glsl").write_text(_BLACK)
    scene = read_scene(mi.load_dict(tiny_scene(**_EMPTY)))
    hazy = replace(scene, medium=replace(scene.medium, phase=named_phase("hazy")))
    with pytest.raises(InputError, match=r"the phase function is 'hazy': fog\.glsl renders"):
        frame_renderer(hazy, find_method(str(tmp_path / "fog.glsl")))


def test_extinction_that_falls_to_0_from_frame_to_frame_is_refused(drawn, tmp_path):
    drawn(_BLACK)
    scene = read_scene(mi.load_dict(tiny_scene(**_EMPTY)))
    renderer = frame_renderer(scene, find_method(str(tmp_path / "fog.glsl")))
    clear = replace(scene, medium=thicker_medium(scene.medium, 0.0))
    with pytest.raises(InputError, match="nothing is extinguished in a channel"):
        render_frame(replace(renderer, scene=clear))


def test_a_frame_that_takes_too_long_ends_with_its_process(drawn, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_METHOD_LIMIT", "1.5")
    text = """#pragma airlight frames 1000
vec3 airlight(Ray ray) { float x = ray.distance; for (int i = 0; i < 60000; ++i) x = sin(x + 1.0); return vec3(x); }
"""
    with pytest.raises(
        InputError,
        match=r"no answer within 1\.5 s; its process was ended; AIRLIGHT_METHOD_LIMIT=3 ",
    ):
        drawn(text)


@pytest.mark.parametrize("limit", ["0", "nan", "inf", "1e12", "soon"])
def test_a_limit_of_time_is_one_that_every_process_can_keep(monkeypatch, limit):
    monkeypatch.setenv("AIRLIGHT_METHOD_LIMIT", limit)
    with pytest.raises(
        InputError, match=r"AIRLIGHT_METHOD_LIMIT: got '.*', expected a time above 0 up to 2e\+06"
    ):
        ShaderHost("fog.glsl")


def test_the_longest_limit_of_time_draws(drawn, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_METHOD_LIMIT", "2e6")
    assert (drawn(_BLACK).airlight == 0).all()


def test_a_process_that_ends_is_a_fault_and_no_driver_is_missing(monkeypatch, tmp_path):
    need_opengl()
    host = ShaderHost("fog.glsl")
    host.ask("open", stages=[])
    host._process._process.kill()
    with pytest.raises(InputError, match=r"method fog\.glsl: ended its process, killed by SIGKILL"):
        host.ask("again", seconds=0.0)
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    with pytest.raises(NoDriverError):
        ShaderHost("fog.glsl").ask("open", stages=[])


def test_a_light_in_the_picture_is_finite_and_its_own_pixels_bright(drawn):
    # the light stands on the ray of no pixel's centre, but within a pixel
    lamp = {
        "type": "point",
        "position": [0.11, 0.03, 0.61],
        "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
    }
    airlight = drawn(
        (EXAMPLES / "marcher.glsl").read_text(), tiny_scene(size=(31, 17), lamp=lamp, **_EMPTY)
    ).airlight
    assert np.isfinite(airlight).all()
    assert np.unravel_index(airlight[..., 0].argmax(), (17, 31)) == (8, 15)
    assert dr.all(mi.Float(airlight.ravel()) > 0)
