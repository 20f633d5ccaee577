# SPDX-License-Identifier: BSD-3-Clause
"""Changes and movements of a scene by name: both sides read the same, nothing
is read or compiled twice.
"""

import dataclasses
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.methods.registry import FOG_METHODS
from airlight.realtime.scene.read_scene import read_again, read_scene
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.animation import animate, moved_parts
from airlight.validation.scenes.changes import change_scene, change_words, changeable, parse_changes
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study.configuration import configuration, prepared
from tests.helpers.scenes import LAMP, scene_xml

pytestmark = pytest.mark.usefixtures("variant")

CHANGES = {
    "colonnade": {
        "camera.origin": (1.3, 1.9, 4.1),
        "camera.target": (4.7, 1.5, 4.3),
        "camera.up": (0.0, 0.1, 1.0),
        "camera.fov": (61.7,),
        "light.position": (5.3, 1.7, 3.9),
        "light.intensity": (111.0, 97.0, 53.0),
        "medium.sigma_t": (0.13,),
        "medium.albedo": (0.71, 0.63, 0.57),
        "medium.g": (-0.41,),
    },
    "windows": {
        "light.direction": (0.7, -0.31, -0.61),
        "light.irradiance": (11.0,),
        "medium.sigma_t": (0.37,),
    },
    "sphere-spot": {
        "light.position": (0.41, 0.3, 4.5),
        "light.direction": (0.1, 0.05, -1.0),
        "camera.fov": (31.0,),
    },
    "three-media": {"medium-3.g": (0.23,), "medium-2.sigma_t": (0.61,), "medium.albedo": (0.5,)},
    "soft-hall": {"light.radiance": (211.0, 307.0, 401.0)},
    "valley": {"medium.H_1": (3.1,), "medium.sigma_2": (0.031,), "medium.z_2": (0.7,)},
}


def _numbers(value):
    """All numbers in a tree of dataclasses, tuples and arrays."""
    if dataclasses.is_dataclass(value):
        return [
            number
            for item in dataclasses.fields(value)
            for number in _numbers(getattr(value, item.name))
        ]
    if isinstance(value, tuple | list):
        return [number for item in value for number in _numbers(item)]
    if dr.is_array_v(value) or isinstance(value, int | float | bool | str | np.ndarray):
        return [np.array(value).tolist()]
    return []


def _read(scene):
    parts = read_scene(scene)
    return [
        _numbers(part)
        for part in (parts.camera, parts.medium, parts.lights, parts.area_lights, parts.features)
    ]


@pytest.mark.parametrize("name", CHANGES)
def test_a_scene_that_is_read_again_is_the_scene_read_anew(name):
    loaded = load_scene(name, (16, 12))
    before = read_scene(loaded.scene)
    change_scene(loaded.scene, CHANGES[name])
    again = read_again(before, loaded.scene)
    read = [
        _numbers(part)
        for part in (again.camera, again.medium, again.lights, again.area_lights, again.features)
    ]
    assert read == _read(load_scene(name, (16, 12), CHANGES[name]).scene)
    assert read != _read(load_scene(name, (16, 12)).scene)
    assert again.geometry is before.geometry


def test_methods_and_reference_see_the_same_camera_light_and_medium():
    loaded = load_scene("colonnade", (16, 12), CHANGES["colonnade"])
    scene, reference = read_scene(loaded.scene), read_reference(loaded.scene)
    np.testing.assert_allclose(np.array(scene.camera.origin).ravel(), reference.origin, rtol=1e-6)
    middle = reference.direction.reshape(12, 16, 3)[5:7, 7:9].mean(axis=(0, 1))
    aim = np.subtract((4.7, 1.5, 4.3), (1.3, 1.9, 4.1))
    np.testing.assert_allclose(
        middle / np.linalg.norm(middle), aim / np.linalg.norm(aim), atol=1e-5
    )
    np.testing.assert_allclose(reference.lights[0].position, (5.3, 1.7, 3.9), rtol=1e-6)
    np.testing.assert_allclose(reference.lights[0].intensity, (111.0, 97.0, 53.0), rtol=1e-6)
    np.testing.assert_allclose(
        np.array(scene.lights[0].position).ravel(), (5.3, 1.7, 3.9), rtol=1e-6
    )
    np.testing.assert_allclose(reference.medium.sigma_t, 0.13, rtol=1e-6)
    np.testing.assert_allclose(float(scene.medium.sigma_t[0][0]), 0.13, rtol=1e-6)
    assert reference.medium.phase.g == pytest.approx(-0.41, rel=1e-6)
    assert float(scene.medium.phase.g[0]) == pytest.approx(-0.41, rel=1e-6)
    assert mi.traverse(loaded.scene.sensors()[0])["x_fov"][0] == pytest.approx(61.7)


def test_words_of_changes_come_back_to_the_last_digit():
    changes = {"camera.origin": (0.1, -1e-7, float(np.float32(1) / 3)), "medium.g": (1 / 3,)}
    words = change_words(changes)
    assert words[0] == "camera.origin=0.1,-0.0000001,0.33333334"
    assert {name: tuple(np.float32(value)) for name, value in parse_changes(words).items()} == {
        name: tuple(np.float32(value)) for name, value in changes.items()
    }
    assert parse_changes(words)["medium.g"] == (1 / 3,)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("medium.sigma=1", "did you mean 'medium.sigma_t'?"),
        ("light.position=1,2", "light.position: got 2 numbers, expected 3"),
        ("medium.g=1", "medium.g: got 1, expected finite numbers from -0.99 to 0.99"),
        ("medium.sigma_t=thick", "got 'medium.sigma_t=thick', expected NAME=NUMBER"),
        ("camera.up=0,0,0", "camera.up: got 0,0,0, expected a direction"),
        ("camera.target=0,0,0", ""),
    ],
)
def test_a_change_that_cannot_be_is_one_line(change, message):
    if not message:  # a target where the camera is
        origin = changeable(load_scene("colonnade").scene)["camera.origin"].value
        change, message = (
            f"camera.target={','.join(map(repr, origin))}",
            "got a target at the origin",
        )
    with pytest.raises(InputError) as raised:
        load_scene("colonnade", (16, 12), parse_changes([change]))
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_changes_to_where_float32_loses_lengths_are_refused_as_in_files():
    far = {"camera.origin": (1e7, 0.0, 0.0), "camera.target": (1e7, 9.0, 1.0)}
    with pytest.raises(InputError, match="m from the camera, and coordinates there are up to 1e"):
        load_scene("colonnade", (16, 12), far | {"light.position": (1e7, 3.0, 0.0)})


def test_a_lobe_that_no_medium_has_is_one_line_where_the_medium_is_isotropic_too():
    """It ended in a RuntimeError of Mitsuba, which built the phase function first."""
    with pytest.raises(InputError, match=r"got 1, expected finite numbers from -0\.99 to 0\.99"):
        load_scene("open-fog", (16, 12), {"medium.g": (1.0,)})


@pytest.mark.parametrize("as_file", [False, True])
def test_an_isotropic_medium_gets_a_lobe_for_methods_and_reference(tmp_path, as_file):
    name = "open-fog"
    if as_file:
        name = str(tmp_path / "fog.xml")
        parsed = mi.parser.parse_dict(
            mi.parser.ParserConfig(mi.variant()), SCENES["open-fog"].build()
        )
        mi.parser.write_file(parsed, name)
    scene = load_scene(name, (16, 12), {"medium.g": (0.31,), "medium.sigma_t": (0.2,)}).scene
    assert float(read_scene(scene).medium.phase.g[0]) == pytest.approx(0.31)
    reference = read_reference(scene)
    assert (reference.medium.phase.name, reference.medium.phase.g) == ("hg", pytest.approx(0.31))
    np.testing.assert_allclose(reference.medium.sigma_t, 0.2, rtol=1e-6)
    same = load_scene(name, (16, 12), {"medium.g": (0.0,)}).scene
    assert read_reference(same).medium.phase.name == "isotropic"
    assert changeable(same)["medium.g"].value == (0.0,)


@pytest.mark.parametrize(("lobe", "g"), [("isotropic", 0.0), ("hg", 0.3)])
def test_a_change_of_one_medium_is_of_no_other(tmp_path, lobe, g):
    """Mitsuba's parser makes one phase function, and one albedo, of all that are equal."""
    inside = f'<float name="g" value="{g}"/>' if g else ""
    same = f'<phase type="{lobe}">{inside}</phase><volume type="constvolume" name="albedo">'
    same += '<rgb name="value" value="0.9, 0.8, 0.7"/></volume>'
    body = f"""<medium type="homogeneous" id="mist"><float name="sigma_t" value="0.7"/>{same}</medium>
    <shape type="sphere" id="body"><point name="center" value="1.4, 0.3, 0.7"/><float name="radius" value="0.4"/>
    <bsdf type="null"/><ref name="interior" id="mist"/><ref name="exterior" id="fog"/></shape>"""
    path = tmp_path / "fog.xml"
    path.write_text(scene_xml(LAMP, body, fog='<float name="sigma_t" value="0.31"/>' + same))
    changes = {"medium.g": (0.6,), "medium.albedo": (0.5,)}
    reference = read_reference(load_scene(str(path), (16, 12), changes).scene)
    assert reference.medium.phase.g == pytest.approx(0.6)
    np.testing.assert_allclose(reference.medium.albedo, 0.5, rtol=1e-6)
    (mist,) = reference.media
    assert getattr(mist.phase, "g", 0.0) == pytest.approx(g)
    np.testing.assert_allclose(mist.albedo, [0.9, 0.8, 0.7], rtol=1e-6)


@pytest.mark.parametrize("coefficient", ["albedo", "sigma_t"])
def test_a_coefficient_on_a_grid_is_refused_with_a_change_too(tmp_path, coefficient):
    """It ended in a KeyError: Mitsuba calls such a medium homogeneous."""
    mi.VolumeGrid(np.full((2, 2, 2, 1), 0.3, np.float32)).write(str(tmp_path / "grid.vol"))
    grid = f'<volume type="gridvolume" name="{coefficient}"><string name="filename" value="grid.vol"/></volume>'
    other = {"albedo": "sigma_t", "sigma_t": "albedo"}[coefficient]
    path = tmp_path / "fog.xml"
    path.write_text(scene_xml(fog=f'{grid}<float name="{other}" value="0.5"/>'))
    scene = load_scene(str(path), (16, 12), {"camera.fov": (31.0,)}).scene
    with pytest.raises(InputError, match=f"its {coefficient} differs from place to place"):
        read_reference(scene)


def test_a_camera_far_from_the_origin_looks_where_it_is_told():
    """In float32 a target a metre away would turn it by a milliradian."""
    scene = load_scene("open-fog", (16, 12)).scene
    origin, direction = (10000.3, -20000.7, 3.1), (0.36, 0.48, 0.8)
    aim = {"camera.origin": origin, "camera.target": tuple(np.add(origin, direction))}
    change_scene(scene, aim | {"camera.up": (0.0, 0.0, 1.0)})
    matrix = camera_matrix(scene.sensors()[0])
    np.testing.assert_allclose(matrix[:3, 2], direction, atol=1e-6)
    np.testing.assert_allclose(matrix[:3, 1], [-0.48, -0.64, 0.6], atol=1e-6)


def host(array) -> np.ndarray:
    return np.array(array, dtype=np.float64).ravel()


def read(name):
    loaded = load_scene(name, (16, 12))
    return read_scene(loaded.scene), loaded.animation


@pytest.mark.parametrize("name", ["open-fog", "sphere-spot"])
def test_lights_circle_at_one_height_and_come_back(variant, name):
    scene, animation = read(name)
    about = np.array(animation.about)
    places = np.array([host(moved.lights[0].position) for moved in animate(scene, animation, 8)])
    np.testing.assert_allclose(places[0], host(scene.lights[0].position), rtol=1e-7)
    np.testing.assert_allclose(places[:, 2], places[0, 2], rtol=1e-6)
    radius = np.linalg.norm(places[:, :2] - about[:2], axis=1)
    assert radius[0] > 0.1
    np.testing.assert_allclose(radius, radius[0], rtol=1e-5)
    steps = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
    # the step from the last to the first included
    np.testing.assert_allclose(steps, steps[0], rtol=1e-4)


@pytest.mark.claim("frames-are-replayed")
@pytest.mark.parametrize(
    ("name", "moves", "method"),
    [
        ("sphere-spot", ("light",), "shadow-planes"),
        ("open-fog", ("light", "medium", "colour"), "shadow-planes"),
        ("sphere-spot", ("light",), "light-volumes"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("clutter", ("light", "colour"), "shadow-planes"),
                ("fence", ("light",), "light-volumes"),
                *(
                    ("sphere-spot", ("light",), m)
                    for m in FOG_METHODS
                    if m not in ("shadow-planes", "light-volumes")
                ),
            )
        ),
    ],
)
def test_frames_record_nothing_and_compile_nothing(variant, name, moves, method):
    """From the second frame on every kernel is replayed; what moves is data."""
    scene, animation = read(name)
    parameters = {"points": 4} if scene.area_lights else {}
    renderer = prepared(scene, configuration(method, None, parameters))
    animation, kept = replace(animation, moves=moves), None
    for number, moved in enumerate(animate(scene, animation, 6)):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            _, kept = next_frame(renderer, moved, kept, **moved_parts(animation))
            kernels = dr.kernel_history((dr.KernelType.JIT,))
            compiled = [
                kernel for kernel in kernels if not kernel["cache_hit"] or kernel["cache_disk"]
            ]
        assert kernels
        if number:
            assert not compiled
    stages = renderer.stages
    assert stages.render.n_recordings == 1
    assert stages.surface.n_recordings == 1
    # a method that knows its shadows lights the surfaces itself
    assert stages.shade.n_recordings == (0 if renderer.method.provides_visibility else 1)


@pytest.mark.parametrize(
    ("moves", "casts", "prepared_frames"),
    [
        (("light",), 1, 4),
        (("medium", "colour"), 1, 1),
        (("light", "colour"), 1, 4),
        (("objects", "medium"), 4, 4),
    ],
)
def test_what_stands_still_is_kept(variant, moves, casts, prepared_frames):
    """Four frames: camera rays are cast again where objects move alone, planes are found
    again where the light does.
    """
    scene, animation = read("two-pens")
    animation = replace(animation, moves=moves)
    renderer = prepared(scene, configuration("shadow-planes"))
    calls = {"surface": 0, "prepare": 0}

    def counted(name):
        def run(*arguments):
            calls[name] += 1
            return getattr(renderer.stages, name)(*arguments)

        return run

    stages = replace(renderer.stages, surface=counted("surface"), prepare=counted("prepare"))
    counting, kept = replace(renderer, stages=stages), None
    for moved in animate(scene, animation, 4):
        _, kept = next_frame(counting, moved, kept, **moved_parts(animation))
    assert calls == {"surface": casts, "prepare": prepared_frames}


def test_a_medium_that_refuses_late_leaves_camera_and_light_as_they_were():
    """Height fog sees only when all numbers are set that nothing bounds its density."""
    scene = load_scene("street", (16, 12)).scene
    before = {name: item.value for name, item in changeable(scene).items()}
    changes = {
        "camera.origin": tuple(value + 0.1 for value in before["camera.origin"]),
        "light.intensity": (7.0, 7.0, 7.0),
        "medium.z_1": (5000.0,),
    }
    with pytest.raises(InputError, match="nothing bounds the density"):
        change_scene(scene, changes)
    after = {name: item.value for name, item in changeable(scene).items()}
    assert after.keys() == before.keys()
    for name, value in before.items():
        np.testing.assert_allclose(after[name], value, rtol=1e-6, atol=1e-6, err_msg=name)


def test_a_sky_before_the_lights_has_the_last_name():
    """Frames of an animation name the lights that methods see, which count no sky."""
    description = SCENES["open-fog"].build()
    sky = {"sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.1}}}
    known = changeable(mi.load_dict({"type": "scene"} | sky | description))
    assert "light.position" in known
    assert "light-2.position" not in known
    assert "light-2.radiance" in known
