# SPDX-License-Identifier: BSD-3-Clause
"""Scene files as people write them are taken with the right image, or refused by the
name of what is in the way.
"""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.droplets import optics
from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.read import read_reference
from airlight.validation.estimates.agreement import agreements
from airlight.validation.scenes.files.references import touching
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.scenes.parts import camera, fog, point_light, tabulated_phase
from tests.helpers.frames import render

COEFFICIENTS = '<float name="sigma_t" value="0.23"/><float name="albedo" value="0.83"/>'
FOG = f'<medium type="homogeneous" id="fog">{COEFFICIENTS}</medium>'
INSIDE, OUTSIDE = '<ref name="medium" id="fog"/>', '<ref name="exterior" id="fog"/>'
LOOK = '<transform name="to_world"><lookat origin="0.2, -4.1, 1.3" target="0.1, 0, 0.6" up="0, 0, 1"/></transform>'
CAMERA = f"""<sensor type="perspective" id="eye"><float name="fov" value="41.7"/>{LOOK}{{}}
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/></film></sensor>"""
FOGGY = CAMERA.format(INSIDE)
LAMP = """<emitter type="point" id="lamp"><point name="position" value="0.7, 0.3, 1.9"/>
<rgb name="intensity" value="5, 4, 3"/></emitter>"""
NULL = '<bsdf type="null"/>'
GREY = '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>'
GLOW = '<emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter>'


def shape(plugin, inside="", *, name="thing", at=(0.1, 0.1, 0.7), size=0.41):
    place = f'<scale value="{size}"/><rotate z="1" angle="17"/><translate x="{at[0]}" y="{at[1]}" z="{at[2]}"/>'
    return f'<shape type="{plugin}" id="{name}"><transform name="to_world">{place}</transform>{inside}</shape>'


@pytest.fixture
def load(variant, tmp_path):
    """Write a file of these parts and load it."""

    def loaded(*parts, camera=FOGGY, media=FOG, version="3.0.0"):
        path = tmp_path / "own.xml"
        path.write_text(f'<scene version="{version}">{media}{camera}{"".join(parts)}</scene>')
        return load_scene(str(path)).scene

    return loaded


def image(scene):
    reference = quadrature_image(read_reference(scene))
    return np.stack([reference.airlight, reference.surface])


def test_a_cylinder_is_one_mesh_for_all(load):
    """Its name, place and material stay, and its shadow is that of the round
    one except for the sides.
    """
    scene = load(LAMP, shape("cylinder", GREY, name="pipe", size=0.3))
    (pipe,) = scene.shapes()
    assert (pipe.id(), pipe.is_mesh(), pipe.face_count()) == ("pipe", True, 512)
    corners = np.array(mi.traverse(pipe)["vertex_positions"]).reshape(-1, 3) - [0.1, 0.1, 0.7]
    np.testing.assert_allclose(np.hypot(corners[:, 0], corners[:, 1]), 0.3, atol=1e-6)
    assert np.ptp(corners[:, 2]) == pytest.approx(0.3, abs=1e-6)
    assert np.isfinite(image(scene)).all()


def test_references_to_the_medium_that_is_there_change_nothing(load):
    """Walls and lamps of Mitsuba 0.6 say in which medium they stand; volpath and both
    readers see the plain scene.
    """
    fog = '<ref name="exterior" id="fog"/>'
    ball, lamp = (
        shape("sphere", GREY + fog),
        shape("rectangle", fog + GLOW, name="glow", at=(-0.6, 0.2, 1.6), size=0.1),
    )
    said = load(LAMP, ball, lamp)
    assert all(each.exterior_medium() is None for each in said.shapes())
    plain = load(LAMP, ball.replace(fog, ""), lamp.replace(fog, ""))
    np.testing.assert_array_equal(image(said), image(plain))


def test_what_is_around_a_box_of_a_centimetre_is_known_from_a_camera_in_it(load):
    """A ray from a thousand kilometres away passed the box, whose fog then seemed to be around it."""
    eye = CAMERA.format(INSIDE).replace(
        'origin="0.2, -4.1, 1.3" target="0.1, 0, 0.6"',
        'origin="0.002, -0.003, 0.001" target="0.001, 0, 0.001"',
    )
    box = shape(
        "cube", NULL + '<ref name="interior" id="fog"/>', name="box", at=(0, 0, 0), size=0.007
    )
    ball = shape("sphere", GREY + OUTSIDE, at=(0.03, 0.04, 0), size=0.003)
    with pytest.raises(InputError, match="medium 'fog' as exterior, where there is no medium"):
        load(LAMP, box, ball, camera=eye)


def test_a_wall_in_a_box_of_fog_may_name_it(load):
    box = shape("cube", NULL + '<ref name="interior" id="fog"/>', name="box", size=1.1)
    ball = shape("sphere", GREY + '<ref name="exterior" id="fog"/>', size=0.3)
    assert all(
        each.exterior_medium() is None
        for each in load(LAMP, box, ball, camera=CAMERA.format("")).shapes()
    )
    with pytest.raises(
        InputError,
        match=(
            r"'thing' is opaque and references medium 'fog' as exterior, where there is no medium; "
            r'expected .* or <bsdf type="null"/>'
        ),
    ):
        load(LAMP, box, ball.replace('x="0.1"', 'x="2.1"'), camera=CAMERA.format(""))


def test_a_medium_written_twice_is_one(load):
    """A camera within a box, and a wall in it, may write out the medium of the
    box instead of naming it.
    """
    fog = '<medium type="homogeneous" name="{}">' + COEFFICIENTS + "</medium>"
    box = shape("cube", NULL + fog.format("interior"), name="box", size=6)
    scene = load(
        LAMP,
        box,
        shape("sphere", GREY + fog.format("exterior")),
        camera=CAMERA.format(fog.format("medium")),
    )
    plain = load(
        LAMP,
        box.replace("<medium", "<medium id='fog'"),
        shape("sphere", GREY),
        camera=FOGGY,
        media="",
    )
    np.testing.assert_array_equal(image(scene), image(plain))


def test_a_floor_in_the_bound_of_a_medium_is_noted(load):
    """There rays that pass the bound miss the floor: volpath and single-scatter lose a
    quarter of such surfaces.
    """
    box = shape(
        "cube", NULL + '<ref name="interior" id="fog"/>', name="box", at=(0, 0, 0.7), size=0.7
    )
    for name, height, noted in (("floor", 0.0, True), ("lower", -0.01, False)):
        floor = shape("rectangle", GREY, name=name, at=(0, 0, height), size=3)
        notes = touching(load(LAMP, box, floor, camera=CAMERA.format("")))
        assert (f"shape '{name}' lies in the bound of a medium" in "".join(notes)) == noted


def test_shapes_keep_their_names_and_are_not_merged(load):
    box = NULL + '<ref name="interior" id="fog"/>'
    boxes = [
        shape("cube", box, name=name, at=(x, 0.2, 0.6), size=0.2)
        for name, x in (("a", -0.4), ("b", 0.5))
    ]
    assert [each.id() for each in load(LAMP, *boxes, camera=CAMERA.format("")).shapes()] == [
        "a",
        "b",
    ]


def test_instances_give_the_image_of_shapes_written_out(load):
    post = '<shape type="{}" id="{}"><transform name="to_world"><scale x="0.1" y="0.2" z="0.4"/></transform>{}</shape>'
    places = [
        (f"post-{number}", f'<translate x="{0.5 * number}" y="0.3" z="0.4"/>')
        for number in (-1, 0, 1)
    ]
    group = f'<shape type="shapegroup" id="posts">{post.format("cube", "post", GREY)}</shape>'
    instances = [
        f'<shape type="instance" id="{name}"><ref id="posts"/><transform '
        f'name="to_world">{place}</transform></shape>'
        for name, place in places
    ]
    flat = [
        post.format("cube", name, GREY).replace("</transform>", place + "</transform>")
        for name, place in places
    ]
    scene = load(LAMP, group, *instances)
    assert [each.id() for each in scene.shapes()] == ["post--1", "post-0", "post-1"]
    # transforms are float32 numbers
    np.testing.assert_allclose(image(scene), image(load(LAMP, *flat)), rtol=1e-5)


@pytest.mark.parametrize("turn", ["", '<boolean name="flip_normals" value="true"/>'])
def test_a_lamp_on_a_quad_of_two_triangles_is_the_rectangle(load, tmp_path, turn):
    """The corners run round the quad, as modelling programs write them; the side
    that shines is the mesh's.
    """
    (tmp_path / "quad.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n")
    mesh = '<string name="filename" value="quad.obj"/>' + turn + GLOW
    quad, rectangle = (
        load(shape(plugin, inside))
        for plugin, inside in (("obj", mesh), ("rectangle", turn + GLOW))
    )
    found, wanted = (read_reference(scene).area[0] for scene in (quad, rectangle))
    for name in ("centre", "normal", "area", "power"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(wanted, name), rtol=1e-5, atol=1e-6
        )


def test_a_lamp_on_a_box_is_its_six_sides(load):
    """Each of them an area light of its own, shining outwards; together they
    send what the box sends.
    """
    lights = read_reference(load(shape("cube", GLOW, size=0.3))).area
    assert sorted(light.name for light in lights) == [f"thing-{number}" for number in range(1, 7)]
    outwards = [light.normal @ (light.centre - (0.1, 0.1, 0.7)) for light in lights]
    np.testing.assert_allclose(outwards, 0.3, rtol=1e-5)
    np.testing.assert_allclose(
        sum(light.power for light in lights), np.pi * 6 * 0.36 * np.array([3, 2, 1]), rtol=1e-5
    )


def test_a_lamp_that_reflects_is_lit_like_any_surface(load):
    """Its emission does not change its reflection; it lights the scene like a black lamp."""
    rgb = '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf></bsdf>'
    turned = shape("rectangle", "{}", at=(0.1, 0.9, 0.7)).replace(
        "<rotate", '<rotate x="1" angle="90"/><rotate'
    )
    plain = image(load(LAMP, turned.format(rgb.format("0.5, 0.4, 0.3"))))
    black = image(load(LAMP, turned.format(rgb.format("0, 0, 0") + GLOW)))
    glowing = image(load(LAMP, turned.format(rgb.format("0.5, 0.4, 0.3") + GLOW)))
    np.testing.assert_allclose(glowing[0], black[0], rtol=1e-6)
    assert plain[1].max() > 0.01
    np.testing.assert_allclose(glowing[1], plain[1], rtol=1e-5)


def test_a_sky_is_seen_through_the_fog_and_lights_it(load):
    box = shape("cube", NULL + '<ref name="interior" id="fog"/>', name="box", size=1.1)
    sky = '<emitter type="constant" id="sky"><rgb name="radiance" value="0.2, 0.3, 0.4"/></emitter>'
    scene = load(LAMP, box, sky, camera=CAMERA.format(""))
    with_sky = quadrature_image(read_reference(scene), plan=PointPlan(most=2))
    without = image(load(LAMP, box, camera=CAMERA.format("")))[0].reshape(with_sky.airlight.shape)
    np.testing.assert_array_equal(with_sky.airlight > without, without > 0)
    assert with_sky.emitted is not None
    # Beer's law gives how much fog a ray has met [m]
    through = -np.log(with_sky.emitted / [0.2, 0.3, 0.4]) / 0.23
    assert through.max() == pytest.approx(2.2 / np.cos(np.deg2rad(17)), rel=0.1)
    assert through.min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(through[..., 0], through[..., 1], atol=1e-6)


@pytest.mark.parametrize("version", ["0.5.0", "0.6.0", "3.0.0"])
def test_scattering_and_absorption_become_extinction_and_albedo(load, capfd, version):
    media = """<medium type="homogeneous" id="fog-{2}"><rgb name="sigma{0}" value="0.15, 1.5, 0.14"/>
    <rgb name="sigma{1}" value="0.02, 0.5, 0.03"/><float name="scale" value="0.5"/></medium>"""
    old = version < "3"
    camera = CAMERA.format(INSIDE.replace("fog", f"fog-{version}"))
    camera = camera.replace("to_world", "toWorld").replace("<lookat", "<lookAt") if old else camera
    medium = read_reference(
        load(
            LAMP,
            camera=camera,
            media=media.format(*("SA" if old else ("_s", "_a")), version),
            version=version,
        )
    )
    np.testing.assert_allclose(medium.medium.sigma_t, [0.085, 1.0, 0.085], rtol=1e-6)
    np.testing.assert_allclose(medium.medium.albedo, [0.15 / 0.17, 0.75, 0.14 / 0.17], rtol=1e-6)
    said = capfd.readouterr()
    assert not said.out
    assert "sigma_t 0.17, 2, 0.17 and albedo 0.882353, 0.75, 0.823529" in said.err


@pytest.mark.parametrize(("version", "key"), [("3.0.0", "sigma_t"), ("0.6.0", "density")])
def test_one_extinction_of_a_heterogeneous_medium_is_noted_where_mitsuba_ends_it(
    load, capfd, version, key
):
    """Mitsuba 3 has a `constvolume` in the unit cube of its to_world, and vacuum around it."""
    volume = f'<volume type="constvolume" name="{key}"><float name="value" value="0.23"/></volume>'
    media = FOG.replace("homogeneous", "heterogeneous").replace(
        '<float name="sigma_t" value="0.23"/>', volume
    )
    read = read_reference(load(LAMP, media=media, version=version)).medium
    np.testing.assert_allclose(read.sigma_t, 0.23, rtol=1e-6)
    assert ("Mitsuba 3 also ends it at the unit cube" in capfd.readouterr().err) == (
        key != "density"
    )


def test_a_light_that_mitsuba_never_samples_shines(load):
    """`volpath` had no light of a light of weight 0, and Mitsuba no scene with it alone."""
    dark = LAMP.replace("</emitter>", '<float name="sampling_weight" value="0"/></emitter>')
    (light,) = load(dark).emitters()
    assert light.sampling_weight() == 1


def medium(inside):
    return f'<medium type="homogeneous" id="fog">{inside}</medium>'


GRID = """<volume type="gridvolume" name="{}"><string name="filename" value="{}"/></volume>"""
REFUSED: dict[str, tuple[Any, ...]] = {
    "medium 'fog' names the material 'skimmilk'; expected its sigma_t .* in numbers": (
        {"media": medium('<string name="material" value="skimmilk"/>')},
    ),
    "medium 'fog' has a sigma_t of 0 in a channel with sigma_s or sigma_a": (
        {
            "media": medium(
                '<rgb name="sigma_t" value="0.3, 0, 0.3"/><rgb name="sigma_s" value="0.1, 0.1, 0.1"/>'
            )
        },
    ),
    "medium 'fog' has a density.*sigma_t": (
        {"media": medium('<float name="density" value="2"/>')},
    ),
    "light 'slide' is of type 'projector'": ({}, '<emitter type="projector" id="slide"/>'),
    "light 'gobo', of type 'spot', has a texture": (
        {},
        '<emitter type="spot" id="gobo"><texture type="checkerboard" name="texture"/></emitter>',
    ),
    "irregular of medium 'fog' is a spectrum.*expected an 'rgb' value": (
        {
            "media": medium(
                '<spectrum type="irregular" name="sigma_t"><string name="wavelengths" '
                'value="400, 700"/><string name="values" value="0.1, 0.6"/></spectrum>'
            )
        },
    ),
    "blackbody of emitter 'coal' is a spectrum.*expected an 'rgb' value": (
        {},
        '<emitter type="point" id="coal"><spectrum type="blackbody" name="intensity"/></emitter>',
    ),
    "light 'sun' is of type 'sunsky'": ({}, '<emitter type="sunsky" id="sun"/>'),
    'write another up, for example up="0, 1, 0"': (
        {"camera": FOGGY.replace("0.1, 0, 0.6", "0.2, -4.1, 0")},
    ),
    "camera 'eye' is of type 'orthographic'": (
        {
            "camera": CAMERA.format(INSIDE)
            .replace("perspective", "orthographic")
            .replace('<float name="fov" value="41.7"/>', "")
        },
    ),
    "camera 'eye' is of type 'thinlens'": (
        {
            "camera": CAMERA.format(INSIDE + '<float name="aperture_radius" value="0.1"/>').replace(
                "perspective", "thinlens"
            )
        },
    ),
    "camera 'eye' has principal_point_offset_x": (
        {"camera": CAMERA.format(INSIDE + '<float name="principal_point_offset_x" value="0.1"/>')},
    ),
    "a bumpmap of the scene is of a 'checkerboard'": (
        {},
        shape(
            "sphere",
            '<bsdf type="bumpmap"><texture type="checkerboard" name="arbitrary"/>'
            '<bsdf type="diffuse"/></bsdf>',
        ),
    ),
    "phase function of medium 'fog' is of type 'sggx'": (
        {"media": FOG.replace("</medium>", '<phase type="sggx"/></medium>')},
    ),
    "references medium 'smoke' as exterior, where there is medium 'fog'": (
        {"media": FOG + FOG.replace("fog", "smoke").replace("0.23", "0.31")},
        shape("sphere", GREY + '<ref name="exterior" id="smoke"/>'),
    ),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_no_command_takes_is_refused_by_its_name(load, words):
    settings, *parts = REFUSED[words]
    with pytest.raises(InputError, match=words) as caught:
        load(LAMP, *parts, **settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("coefficient", ["albedo", "sigma_t"])
def test_a_coefficient_on_a_grid_is_refused_by_both_readers(load, tmp_path, coefficient):
    """Mitsuba calls a medium homogeneous whose albedo differs from place to place."""
    mi.VolumeGrid(np.linspace(0.1, 0.9, 8, dtype=np.float32).reshape(2, 2, 2, 1)).write(
        str(tmp_path / "grid.vol")
    )
    other = {"albedo": "sigma_t", "sigma_t": "albedo"}[coefficient]
    scene = load(
        LAMP,
        media=medium(GRID.format(coefficient, "grid.vol") + f'<float name="{other}" value="0.4"/>'),
    )
    for read in (read_reference, read_scene):
        with pytest.raises(InputError, match=f"{coefficient} differs from place to place"):
            read(scene)


def written(plugin, kind):
    """Return the settings of a file and what it holds to try a plugin."""
    tag = {"PhaseFunction": "phase"}.get(kind, kind.lower())
    nested = (
        '<bsdf type="diffuse"/>'
        if plugin in ("twosided", "mask", "blendbsdf", "bumpmap", "normalmap")
        else ""
    )
    element = f'<{tag} type="{plugin}" id="tried">{{}}</{tag}>'
    inside = {"Sensor": INSIDE + LOOK, "Medium": COEFFICIENTS}.get(kind, nested)
    tried = element.format(inside)
    if kind == "Sensor":
        return {"camera": tried}, ""
    if kind == "Medium":
        return {"media": tried.replace("tried", "fog")}, ""
    if kind == "PhaseFunction":
        return {"media": FOG.replace("</medium>", tried + "</medium>")}, ""
    return {}, shape("sphere", tried) if kind == "BSDF" else tried


@pytest.mark.slow
def test_every_plugin_of_mitsuba_is_taken_or_refused_in_one_line(load):
    """By all readers, one plugin at a time, with Mitsuba's defaults where it has some."""
    from pathlib import Path

    from airlight.reports.interchange.scene import describe_scene

    kinds = ("Sensor", "Emitter", "Shape", "BSDF", "Medium", "PhaseFunction")
    folder = Path(mi.__file__).parent / "plugins"
    plugins = sorted({path.name.partition(".")[0] for path in folder.iterdir()})
    tried = {
        plugin: str(mi.PluginManager.instance().plugin_type(plugin)).rpartition(".")[2]
        for plugin in plugins
    }
    said = {}
    for plugin, kind in tried.items():
        if kind in kinds:
            settings, part = written(plugin, kind)
            try:
                scene = load(LAMP if kind != "Emitter" else "", part, **settings)
                said[plugin] = describe_scene(LoadedScene("own", scene, "", ""))["scene"]
            except InputError as refusal:
                said[plugin] = str(refusal)
    assert all("\n" not in words for words in said.values())
    assert {
        "perspective",
        "point",
        "sphere",
        "diffuse",
        "plastic",
        "homogeneous",
        "hg",
        "rayleigh",
        "isotropic",
    } <= {plugin for plugin, words in said.items() if words == "own"}
    assert "'projector'" in said["projector"]


def room(*, without="", mirror="", flip=""):
    """A window of a room of fog and its five walls, which reference the fog too; a
    lamp and a ball are inside. `mirror`, `flip`: of the window.
    """
    turns = {
        "window": '<rotate x="1" angle="90"/><translate y="-1.3"/>',
        "back": '<rotate x="1" angle="90"/><translate y="1.3"/>',
        "left": '<rotate y="1" angle="90"/><translate x="-1.3"/>',
        "right": '<rotate y="1" angle="-90"/><translate x="1.3"/>',
        "floor": '<translate z="-1.3"/>',
        "ceiling": '<rotate x="1" angle="180"/><translate z="1.3"/>',
    }
    wall, parts = GREY + OUTSIDE, [LAMP.replace("0.7, 0.3, 1.9", "0.4, 0.3, 0.9")]
    for name, turn in turns.items():
        if name != without:
            turn = mirror + turn if name == "window" else turn
            place = f'<transform name="to_world"><scale value="1.3"/>{turn}</transform>'
            sides = flip + NULL + '<ref name="interior" id="fog"/>' if name == "window" else wall
            parts.append(f'<shape type="rectangle" id="{name}">{place}{sides}</shape>')
    return [*parts, shape("sphere", wall, at=(0.1, 0.2, -0.3))]


def test_a_room_of_fog_behind_a_window_is_a_box(load):
    """The image is that of a box of fog within the same walls."""
    rooms = load(*room(), camera=CAMERA.format(""))
    assert next(each for each in rooms.shapes() if each.id() == "window").is_mesh()
    box = (
        '<shape type="cube" id="window"><transform name="to_world"><scale value="1.3"/></transform>'
    )
    walls = [part.replace(OUTSIDE, "") for part in room(without="window")]
    plain = load(
        *walls, f'{box}{NULL}<ref name="interior" id="fog"/></shape>', camera=CAMERA.format("")
    )
    expected = image(plain)
    assert expected[0].max() > 0
    # The box reaches 1e-4 of its size beyond the walls.
    np.testing.assert_allclose(image(rooms), expected, rtol=2e-3, atol=1e-3 * expected.max())


@pytest.mark.parametrize(
    ("mirror", "flip", "is_box"),
    [
        ('<scale x="-1"/>', "", True),
        ('<scale z="-1"/>', "", False),
        ("", '<boolean name="flip_normals" value="true"/>', False),
        ('<scale z="-1"/>', '<boolean name="flip_normals" value="true"/>', True),
    ],
)
def test_the_room_lies_behind_the_normal_of_its_window(load, mirror, flip, is_box):
    """Mitsuba moves a normal by the inverse transposed: a mirror of x alone leaves it as it was."""
    parts = room(mirror=mirror, flip=flip)
    if is_box:
        shapes = load(*parts, camera=CAMERA.format("")).shapes()
        assert next(each for each in shapes if each.id() == "window").is_mesh()
    else:  # the fog is before the window, where no room is
        with pytest.raises(InputError, match="'window' bounds a medium and is a rectangle"):
            load(*parts, camera=CAMERA.format(""))


def test_a_window_without_a_whole_room_is_refused(load):
    with pytest.raises(InputError, match="'window' bounds a medium and is a rectangle"):
        load(*room(without="left"), camera=CAMERA.format(""))


def table(words, values):
    text = tabulated_phase(words, values)["values"]
    return np.array([float(word) for word in text.split(",")])


@pytest.mark.claim(
    "droplets-in-scenes",
    tolerance="0.001 of the fraction and of g, 0.1 % of values from 10 to 30 degrees",
)
def test_a_table_keeps_the_light_of_the_peak(variant):
    values = table("mie", 2001)
    cosine = np.linspace(-1, 1, len(values))
    full = optics()
    fine = np.linspace(-1, 1, 400_001)
    p = np.interp(fine, cosine, values)
    assert 0.5 * np.trapezoid(p, fine) == pytest.approx(1, abs=1e-9)
    assert 0.5 * np.trapezoid(p * fine, fine) == pytest.approx(full.g, abs=1e-3)
    peak = fine >= np.cos(np.deg2rad(5))
    assert 0.5 * np.trapezoid(p[peak], fine[peak]) == pytest.approx(full.fraction(0, 5), abs=2e-3)
    angle = np.deg2rad(np.linspace(10, 30, 200))
    assert np.interp(np.cos(angle), cosine, values) == pytest.approx(full(np.cos(angle)), rel=1e-3)


def fog_of(phase, size=(8, 6)):
    return mi.load_dict(
        {
            "type": "scene",
            "fog": fog(0.21, (0.9, 0.9, 0.9), phase),
            "light": point_light((0.7, 3.1, 0.4), (5.0, 4.0, 3.0)),
            "camera": camera((0.1, -2.3, 0.2), (0.6, 1.9, 0.3), fov=47.0, size=size),
        }
    )


@pytest.mark.claim(
    "droplets-in-scenes", tolerance="2e-3 relative: kernels integrate across the kinks of the table"
)
def test_methods_and_reference_see_the_same_fog_of_droplets(variant):
    scene = fog_of(tabulated_phase("mie", 2001))
    assert read_scene(scene).medium.phase.lobe < 0.1
    reference = quadrature_image(read_reference(scene), checks=2).airlight.reshape(-1)
    frame = np.array(render(scene, "unshadowed").airlight, dtype=np.float64).T.reshape(-1)
    assert np.sort(frame) == pytest.approx(np.sort(reference), rel=2e-3)


@pytest.mark.claim(
    "droplets-in-scenes", tolerance="1 % bias of Mitsuba's sampling, by its own interval"
)
@pytest.mark.statistical
def test_mitsuba_sees_the_same_fog_of_droplets(variant):
    margins = {"single-scatter": 0.01, "volpath": 0.01}
    agreed = agreements(fog_of(tabulated_phase("mie", 2001), size=(16, 12)), margins, batches=2048)
    assert len(agreed) == len(margins)
    for estimator, agreement in agreed.items():
        assert agreement.statistics.equivalent, estimator
