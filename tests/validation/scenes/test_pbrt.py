# SPDX-License-Identifier: BSD-3-Clause
"""Files of pbrt-v4 and pbrt-v3 are read as pbrt reads them, or refused by line and name."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.scene.read import read_reference
from airlight.reports.interchange.scene import surface
from airlight.validation.scenes.loading import load_scene, scene_identity

FOG = """MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [0.01 0.02 0.03]
  "rgb sigma_s" [0.2 0.3 0.4] "float scale" 0.5 "float g" 0.3
MediumInterface "" "fog"
"""
VIEW = """LookAt 1 2 -7  0.5 1 0  0.1 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 64 "integer yresolution" 32
"""
LAMP = 'LightSource "point" "rgb I" [3 4 5] "point3 from" [1 2 3]\n'
SPOT = 'LightSource "spot" "rgb I" [8 6 4] "point3 from" [1 2 3] "point3 to" [0 0 0] '


def pbrt(world=LAMP, view=VIEW, fog=FOG, end=""):
    return f"{fog}{view}WorldBegin\n{world}{end}"


@pytest.fixture
def read(variant, tmp_path):
    """Return a function that loads a text as a file."""

    def load(text, name="scene.pbrt", size=None):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return load_scene(str(path), size).scene

    return load


def seen_at(scene, name):
    """Return where in the image a shape is seen: the mean column and row of its pixels."""
    width, height = (int(n) for n in scene.sensors()[0].film().size())
    row, column = np.mgrid[:height, :width].reshape(2, -1)
    at = mi.Point2f((column + 0.5) / width, (row + 0.5) / height)
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, at, mi.Point2f(0.5))
    (shape,) = (shape for shape in scene.shapes() if shape.id() == name)
    found = np.array(scene.ray_intersect(ray).shape == mi.ShapePtr(shape))
    return np.array([column[found].mean() + 0.5, row[found].mean() + 0.5])


#: Where the place (0.9, 0.3, 1.2) of the world is in the camera of `LookAt`: to the right, up and
#: forward, by the axes that pbrt takes, of which right is up x forward.
EYE, TARGET, UP = np.array([[1.0, 2.0, -7.0], [0.5, 1.0, 0.0], [0.1, 1.0, 0.0]])
FORWARD = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
RIGHT = np.cross(UP, FORWARD) / np.linalg.norm(np.cross(UP, FORWARD))
PLACE = np.array([0.9, 0.3, 1.2])
LOOK = np.array([RIGHT, np.cross(FORWARD, RIGHT), FORWARD]) @ (PLACE - EYE)
LOOK_AT = "LookAt 1 2 -7  0.5 1 0  0.1 1 0"
SIN, COS = np.sin(np.deg2rad(5.0)), np.cos(np.deg2rad(5.0))
VIEWS = {
    "look-at": (LOOK_AT, LOOK),
    "a mirror": (f"Scale -1 1 1 {LOOK_AT}", LOOK * [-1, 1, 1]),
    "upside down and larger": (f"Scale 2 -2 2 {LOOK_AT}", LOOK * [2, -2, 2]),
    "turned": (
        "Rotate 5 1 0 0 Translate 0 0 6",
        np.array([0.9, 0.3 * COS - 7.2 * SIN, 0.3 * SIN + 7.2 * COS]),
    ),
    "a matrix": (
        "Transform [1 0 0 0  0 1 0 0  0 0 1 0  0.2 -0.4 5 1]",
        PLACE + np.array([0.2, -0.4, 5]),
    ),
}
BALL = 'AttributeBegin Translate 0.9 0.3 1.2 Shape "sphere" "float radius" 0.2 AttributeEnd\n'


@pytest.mark.claim("pbrt-read", tolerance="0.6 pixels, as a seen ball is some pixels wide")
@pytest.mark.parametrize(("size", "window"), [((128, 64), ""), ((64, 128), ""), ((128, 64), "1.5")])
@pytest.mark.parametrize("name", VIEWS)
def test_a_place_is_where_pbrt_shows_it(read, name, size, window):
    """Left and right, up and down, and the angle across the shorter side or a part of the screen."""
    (camera, (x, y, z)), (width, height) = VIEWS[name], size
    screen = f'"float screenwindow" [-{window} {window} -0.75 0.75]' if window else ""
    view = f'{camera}\nCamera "perspective" "float fov" 40 {screen}\n'
    view += f'Film "rgb" "integer xresolution" {width} "integer yresolution" {height}\n'
    scene = read(pbrt(BALL + LAMP, view))
    # The fov is across -1 to 1 of the screen, and the shorter side has that by default.
    pixels = 0.5 * (width / float(window) if window else min(size)) / np.tan(np.deg2rad(20.0))
    expected = [0.5 * width + pixels * x / z, 0.5 * height - pixels * y / z]
    np.testing.assert_allclose(seen_at(scene, "sphere-line-8"), expected, atol=0.6)
    if not window:  # at another size the shorter side has it too
        other = read(pbrt(BALL + LAMP, view), size=size[::-1])
        turned = np.subtract(expected, 0.5 * np.array(size)) + 0.5 * np.array(size[::-1])
        np.testing.assert_allclose(seen_at(other, "sphere-line-8"), turned, atol=0.6)


@pytest.mark.claim("pbrt-read")
def test_numbers_are_those_of_the_file(read):
    """Media, lights and shapes of a right-handed world, whose coordinates stay as they are."""
    world = (
        LAMP
        + SPOT
        + '"float coneangle" 20 "float conedeltaangle" 0 "float scale" 2\n'
        + 'AttributeBegin AreaLightSource "diffuse" "rgb L" [1 2 3] Material "diffuse" '
        + '"rgb reflectance" 0 Translate 0 3 0 Shape "sphere" "float radius" 0.25 AttributeEnd\n'
    )
    reference = read_reference(read(pbrt(world, "Scale -1 1 1 " + VIEW)))
    np.testing.assert_allclose(reference.medium.sigma_t, [0.105, 0.16, 0.215], rtol=1e-6)
    np.testing.assert_allclose(reference.medium.albedo, [20 / 21, 30 / 32, 40 / 43], rtol=1e-6)
    assert reference.medium.phase.g == pytest.approx(0.3)
    np.testing.assert_allclose(reference.origin, [1, 2, -7], rtol=1e-6)
    lamp, beam = reference.lights
    np.testing.assert_allclose(lamp.position, [1, 2, 3], rtol=1e-6)
    np.testing.assert_allclose(lamp.intensity, [3, 4, 5], rtol=1e-6)
    np.testing.assert_allclose(beam.intensity, [16, 12, 8], rtol=1e-6)
    np.testing.assert_allclose(beam.axis, -np.array([1, 2, 3]) / np.sqrt(14), atol=1e-6)
    assert not beam.is_soft
    assert np.rad2deg(beam.cutoff) == pytest.approx(20.0, abs=1e-5)
    (area,) = reference.area
    assert (area.kind, area.radius) == ("sphere", pytest.approx(0.25))
    np.testing.assert_allclose(area.radiance, [1, 2, 3])


@pytest.mark.parametrize("version", [3, 4])
def test_the_edge_of_a_spot_is_that_of_its_pbrt(read, version):
    """The linear spots that stand for it add up to pbrt's falloff, within a hundredth."""
    end = "WorldEnd" if version == 3 else ""
    world = SPOT + '"float coneangle" 25 "float conedeltaangle" 10\n'
    lights = read_reference(read(pbrt(world, end=end))).lights
    angle = np.linspace(0, 30, 301)
    total = sum(
        light.intensity[0]
        * np.clip(
            (np.rad2deg(light.cutoff) - angle) / np.rad2deg(light.cutoff - light.beam), 0.0, 1.0
        )
        for light in lights
    )
    start, stop = np.cos(np.deg2rad([15.0, 25.0]))
    t = np.clip((np.cos(np.deg2rad(angle)) - stop) / (start - stop), 0.0, 1.0)
    falloff = t**4 if version == 3 else t * t * (3 - 2 * t)
    assert np.abs(total / 8 - falloff).max() < 0.01
    assert total[0] == pytest.approx(8.0, rel=1e-6)


def test_missing_coefficients_are_those_of_the_version(read):
    fog = 'MakeNamedMedium "fog" "string type" "homogeneous" MediumInterface "" "fog"\n'
    new = read_reference(read(pbrt(fog=fog)))
    old = read_reference(read(pbrt(fog=fog, end="WorldEnd")))
    np.testing.assert_allclose(new.medium.sigma_t, [2, 2, 2])
    np.testing.assert_allclose(old.medium.sigma_t, [2.5511, 3.2124, 3.784], rtol=1e-6)


def test_the_camera_takes_the_medium_of_its_version(read):
    """pbrt-v4 looks at the media before Camera, pbrt-v3 at the end of the world."""
    fog = (
        FOG + 'MakeNamedMedium "thin" "string type" "homogeneous" "rgb sigma_a" 0 "rgb sigma_s" 0.1'
    )
    world = 'MediumInterface "" "thin"\n' + LAMP
    new, old = (
        read_reference(read(pbrt(world, fog=fog + "\n", end=end))) for end in ("", "WorldEnd")
    )
    np.testing.assert_allclose(new.medium.sigma_t, [0.105, 0.16, 0.215], rtol=1e-6)
    np.testing.assert_allclose(old.medium.sigma_t, 0.1, rtol=1e-6)


@pytest.mark.parametrize(("version", "reflectance"), [(3, 0.2), (4, 0.5)])
def test_the_end_of_a_transform_ends_what_its_version_says(read, version, reflectance):
    """pbrt-v4 takes TransformBegin for AttributeBegin, and its end takes the material back."""
    kind, end = (
        ('"matte" "rgb Kd"', "WorldEnd") if version == 3 else ('"diffuse" "rgb reflectance"', "")
    )
    world = (
        f"TransformBegin Material {kind} [0.2 0.2 0.2] Translate 3 0 0 TransformEnd\n" + BALL + LAMP
    )
    scene = read(pbrt(world, end=end))
    (ball,) = scene.shapes()
    assert surface(ball)["reflectance"] == pytest.approx(3 * [reflectance])
    middle = 0.5 * (np.ravel(ball.bbox().min) + np.ravel(ball.bbox().max))
    np.testing.assert_allclose(np.abs(middle), [0.9, 0.3, 1.2], atol=1e-6)


def test_a_bound_has_its_medium_inside_whichever_way_it_faces(read):
    """The medium inside is that of the inner side: of a sphere turned round the outer name."""
    outside = FOG.replace('MediumInterface "" "fog"', 'MediumInterface "fog" ""')
    for state, turned in (('"fog" ""', ""), ('"" "fog"', "ReverseOrientation ")):
        ball = (
            f'AttributeBegin MediumInterface {state} Material "interface" {turned}{{}} AttributeEnd'
        )
        for place in ("Translate 0 1 2", "Translate 0 1 2 Scale 1 1 -1 ReverseOrientation"):
            sphere = ball.format(f'{place} Shape "sphere" "float radius" 0.7') + "\n"
            (medium,) = read_reference(read(pbrt(sphere + LAMP, fog=outside))).media
            np.testing.assert_allclose(medium.sigma_t, [0.105, 0.16, 0.215], rtol=1e-6)
            np.testing.assert_allclose(medium.bounds.centre, [0, 1, 2], atol=1e-6)


TRIANGLE = 'Shape "trianglemesh" "integer indices" [0 1 2] "point3 P" [0 0 0 2 0 0 0 0 3]'


@pytest.mark.parametrize(
    ("state", "extra", "up"),
    [
        ("", "", -1),
        ("ReverseOrientation", "", 1),
        ("Scale 1 1 -1", "", -1),
        ("Scale 1 1 -1 ReverseOrientation", "", 1),
        ("", '"normal N" [0 1 0 0 1 0 0 1 0]', 1),
        ("ReverseOrientation", '"normal N" [0 1 0 0 1 0 0 1 0]', -1),
    ],
)
@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1 "])
def test_a_light_shines_on_the_side_of_pbrts_normal(read, state, extra, up, mirror):
    """(p1 - p0) x (p2 - p0) of the triangle is -y: turned by ReverseOrientation, kept by a mirror
    of its transform, and where vertices have normals by these.
    """
    world = f'AttributeBegin AreaLightSource "diffuse" {state} {TRIANGLE} {extra} AttributeEnd\n'
    (light,) = read_reference(read(pbrt(world, mirror + VIEW))).area
    first, second, third = light.triangles[0]
    normal = np.cross(second - first, third - first)
    np.testing.assert_allclose(normal / np.linalg.norm(normal), [0, up, 0], atol=1e-6)


def test_a_mesh_of_a_file_is_the_mesh_itself(read, tmp_path):
    """A PLY file is read beside the scene, moved, and counts for the identity."""
    ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    ply += "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    mesh = tmp_path / "m.ply"
    mesh.write_text(ply + "0 0 0\n2 0 0\n0 0 3\n3 0 1 2\n")
    world = LAMP + 'Translate 0 5 0 Shape "plymesh" "string filename" "m.ply"\n'
    (shape,) = read(pbrt(world, "Scale -1 1 1 " + VIEW)).shapes()
    corners = np.array(mi.traverse(shape)["vertex_positions"]).reshape(-1, 3)
    assert sorted(map(tuple, corners.tolist())) == [(0, 5, 0), (0, 5, 3), (2, 5, 0)]
    before = scene_identity(str(tmp_path / "scene.pbrt"))
    mesh.write_text(mesh.read_text().replace("0 0 3\n", "0 0 4\n"))
    assert scene_identity(str(tmp_path / "scene.pbrt")) != before


def test_a_changed_file_has_another_identity(read, tmp_path):
    """The identity is the key of cached results: included files count, comments do not."""
    path, lamps = tmp_path / "scene.pbrt", tmp_path / "lamps.pbrt"
    lamps.write_text(LAMP)
    read(pbrt('Include "lamps.pbrt"\n'))
    first = scene_identity(str(path))
    assert scene_identity(str(path)) == first
    path.write_text("# a comment\n" + path.read_text())
    assert scene_identity(str(path)) == first
    lamps.write_text(LAMP.replace("3 4 5", "3 4 6"))
    assert scene_identity(str(path)) != first


def test_what_the_file_has_for_the_renderer_changes_nothing(read, tmp_path):
    """Samplers, integrators, and names of files."""
    scene = read(pbrt())
    options = (
        'Sampler "halton" "integer pixelsamples" [ 16 ] Option "bool disablepixeljitter" true '
    )
    options += 'Integrator "volpath" "integer maxdepth" [5] Accelerator "bvh" '
    other = read(options + pbrt().replace("[3 4 5]", "[ 3 4 # blue next\n 5 ]"), "other.pbrt")
    assert scene_identity(str(tmp_path / "scene.pbrt")) == scene_identity(
        str(tmp_path / "other.pbrt")
    )
    assert scene.emitters()[0].class_name() == other.emitters()[0].class_name()


FLOOR = 'Shape "trianglemesh" "integer indices" [0 1 2] "point3 P" [-9 0 -9 9 0 -9 0 0 9]\n'


@pytest.mark.parametrize(
    ("world", "said"),
    [
        (FLOOR + LAMP, True),  # its normal is down, lamp and camera are above: inside, vacuum
        ("ReverseOrientation " + FLOOR + LAMP, False),
        ('MediumInterface "fog" "fog"\n' + FLOOR + LAMP, False),
        (FLOOR + LAMP.replace("1 2 3", "1 -2 3"), False),  # the lamp is below
        ('Material "diffuse" "rgb reflectance" 0 ' + FLOOR + LAMP, False),
        ('Shape "sphere"\n' + LAMP, False),
        ('ReverseOrientation Shape "sphere"\n' + LAMP, True),
        ('MediumInterface "" ""\nShape "sphere"\n' + LAMP, True),
    ],
)
def test_a_note_says_where_pbrt_takes_another_medium(read, world, said, monkeypatch):
    notes = list[str]()
    monkeypatch.setattr(mi, "Log", lambda level, words: notes.append(words))
    read(pbrt(world))
    assert any("names another medium" in note for note in notes) == said


REFUSED = {
    "a curve": (
        LAMP + 'Shape "curve"',
        'line 9: Shape "curve": is not read.*expected one of sphere',
    ),
    "an instance": (LAMP + 'ObjectBegin "a"', 'line 9: ObjectBegin "a": instances are not read'),
    "a glass": (
        LAMP + 'Material "dielectric"\nShape "sphere"',
        'line 9: Material "dielectric": the material "dielectric" is not read; expected diffuse',
    ),
    "a texture": (
        LAMP + 'Material "diffuse" "texture reflectance" "t"\nShape "sphere"',
        'line 9: Material "diffuse": got "texture reflectance" t; expected one colour',
    ),
    "a part": (LAMP + 'Shape "sphere" "float zmin" -0.5', "line 9: .*part of a sphere"),
    "an unknown parameter": (
        LAMP + 'Shape "sphere" "float radus" 2',
        'line 9: Shape "sphere": the parameter "float radus" is not read.*did you mean \'radius\'',
    ),
    "an unknown directive": (LAMP + 'Shpae "sphere"', "line 9: got 'Shpae'.*did you mean 'Shape'"),
    "an oval": (LAMP + 'Scale 1 2 1 Shape "sphere"', "line 9: .*one scale for all axes"),
    "an open bound": (
        LAMP + f'MediumInterface "fog" "" Material "interface"\n{FLOOR}',
        "line 10: .*bounds a medium and is open",
    ),
    "an emission of two sides": (
        'AreaLightSource "diffuse" "bool twosided" true\n' + FLOOR,
        'line 8: AreaLightSource "diffuse": twosided.*line 9.*write two shapes',
    ),
    "a power": ('AreaLightSource "diffuse" "float power" 3\n' + FLOOR, 'line 8: .*"power" is not'),
    "a map": (LAMP + 'LightSource "infinite" "string filename" "x.exr"', 'line 9: .*"filename"'),
    "a blackbody": ('LightSource "point" "blackbody I" 6500', "line 8: .*blackbody I.*rgb values"),
    "no medium": (
        'AttributeBegin MediumInterface "" "mist"\nShape "sphere" AttributeEnd\n' + LAMP,
        'line 9: Shape "sphere": its MediumInterface names "mist".*here fog',
    ),
    "no end": ("AttributeBegin\n" + LAMP, "line 8: AttributeBegin: has no end"),
    "no begin": ("AttributeEnd\n" + LAMP, "line 8: AttributeEnd: there is no AttributeBegin"),
    "no file": ('Include "x.pbrt"', 'line 8: Include "x.pbrt": there is no such file'),
    "itself": ('Include "scene.pbrt"', "line 8: Include .*the file includes itself"),
    "a string without an end": ('Shape "sphere\n' + LAMP, "line 8: a string has no end"),
    "a list without an end": ('Shape "sphere" "float radius" [ "1"\n', "line 8: .*has no end"),
    "no number": ('Shape "sphere" "float radius" [ big ]', "line 8: .*big; expected numbers"),
    "a vertex that is not there": (
        FLOOR.replace("[0 1 2]", "[0 1 3]"),
        "line 8: .*an index is 3; expected numbers from 0 to 2",
    ),
}


@pytest.mark.claim("pbrt-read")
@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_read_is_refused_by_line(read, name):
    world, words = REFUSED[name]
    with pytest.raises(InputError, match=words):
        read(pbrt(world))


@pytest.mark.claim("pbrt-read")
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no WorldBegin"),
        (pbrt().replace("40", "200"), "line 5: Camera .*fov is 200"),
        (pbrt().replace('"perspective"', '"orthographic"'), "line 5: .*expected perspective"),
        (
            pbrt().replace('Film "rgb"', 'Film "rgb" "float iso" 200'),
            "line 6: .*changes the values",
        ),
        (
            pbrt().replace('"rgb sigma_s"', '"rgb Le" [1 1 1] "rgb sigma_s"'),
            "line 1: .*emits light",
        ),
        (pbrt().replace("homogeneous", "cloud"), 'line 1: .*of type "cloud"; expected homogeneous'),
        (pbrt().replace("LookAt 1 2 -7", "Scale 1 2 1 LookAt 1 2 -7"), "line 5: .*several scales"),
    ],
)
def test_cameras_and_media_are_refused_by_line(read, text, words):
    with pytest.raises(InputError, match=words):
        read(text)
