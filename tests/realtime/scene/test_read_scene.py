# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import pytest

from realtime.errors import InputError
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene


def read(**changes):
    return read_scene(mi.load_dict(tiny_scene(**changes)))


@pytest.mark.parametrize("names", [("a.b", "a-b"), ("Sphere-2", ""), ("", "Sphere-1"), ("", ""), ("a.b.c", "a-b.c")])
def test_every_opaque_shape_stays_whatever_its_name(variant, names):
    """Mitsuba's dictionaries have keys without dots, each once; beside a boundary the opaque shapes are a new scene."""
    bounded = bounded_medium({"type": "cube"}, 0.3, (0.9, 0.9, 0.9))
    scene = clear_scene(first={"type": "sphere"}, second={"type": "sphere", "center": [5.0, 0.0, 0.0]}, box=bounded)
    loaded = mi.load_dict(scene)
    opaque = [shape for shape in loaded.shapes() if shape.interior_medium() is None]
    for shape, name in zip(opaque, names, strict=True):
        shape.set_id(name)
    kept = read_scene(loaded).geometry.shapes()
    assert len({shape.id() for shape in kept}) == 2
    assert {name for name in names if name} <= {shape.id() for shape in kept}
    assert sorted(float(shape.bbox().min[0]) for shape in kept) == [-1.0, 4.0]


@pytest.mark.claim("not-needed-costs-nothing")
def test_plan_names_only_what_is_needed(variant):
    features = read(ball=None, floor=None).features
    assert not features.shadows
    assert not features.surfaces
    assert features.extinctions == 1
    assert features.isotropic
    assert (features.point_lights, features.spot_lights, features.soft_spots, features.vacuum) == (1, 0, False, False)
    features = read(spot=spot(beam=20.0)).features
    assert features.shadows
    assert features.soft_spots
    assert not read(spot=spot()).features.soft_spots


@pytest.mark.claim("scenes-refused-by-name")
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (lambda fog: {"lamp": None}, "no light"),
        (lambda fog: {"lamp": None, "sky": {"type": "constant"}}, "light 'sky' of type 'constant'"),
        (lambda fog: {"fog": fog | {"sigma_t": -1.0}}, "sigma_t is"),
        (lambda fog: {"fog": fog | {"sigma_t": float("nan")}}, "sigma_t is"),
        (lambda fog: {"fog": fog | {"albedo": 1.5}}, "albedo is"),
        (lambda fog: {"ball": {"type": "sphere", "bsdf": {"type": "null"}}}, "transparent"),
        (lambda fog: {"ball": {"type": "sphere", "interior": {"type": "homogeneous"}}}, "bounds a medium"),
        (lambda fog: {"spot": spot(cutoff=95.0, beam=90.0)}, "cutoff_angle"),
        (lambda fog: {"sensor": {"type": "thinlens", "aperture_radius": 0.1}}, "ThinLens"),
    ],
)
def test_refusals_name_what_is_in_the_way(variant, changes, message):
    with pytest.raises(InputError, match=message):
        read(**changes(tiny_scene()["fog"]))


def test_camera_outside_the_medium_is_refused(variant):
    sensor = {name: value for name, value in tiny_scene()["sensor"].items() if name != "medium"}
    with pytest.raises(InputError, match="would be in a vacuum"):
        read(sensor=sensor)


@pytest.mark.claim("glossy-surfaces-noted")
def test_glossy_surfaces_are_noted(variant):
    notes = read(ball={"type": "sphere", "bsdf": {"type": "roughplastic"}}).features.notes
    assert len(notes) == 1
    assert "not purely diffuse" in notes[0]
    assert read().features.notes == ()


@pytest.mark.claim("first-camera-noted")
def test_a_second_camera_is_noted(variant):
    """The first is used, and anyone who meant the other is told."""
    (note,) = read(other={"type": "perspective", "medium": {"type": "ref", "id": "fog"}}).features.notes
    assert "2 cameras: the first is used" in note
