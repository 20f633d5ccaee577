# SPDX-License-Identifier: BSD-3-Clause
"""Claim: each fault of the medium, the lights and the values makes of a
guess what its words say.
"""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from airlight.analytic.height_fog import HeightFog, Layer
from airlight.reference.monte_carlo.volpath_gaps import CannotTrace
from airlight.reference.scene.model import Law, Range
from airlight.validation.engine import prediction
from airlight.validation.engine.fault import Fault, factor_name
from airlight.validation.engine.faults import FAULTS
from airlight.validation.engine.prediction import Guess, Predictor, SceneLight
from airlight.validation.engine.targets import position_held, scaled
from airlight.validation.engine.transforms import OPTICS
from airlight.validation.fog_model.laws import LawFactor, Window
from airlight.validation.fog_model.radiance import Fog
from airlight.validation.fog_model.view import Scenery

FOG = Fog(
    sigma_t=((0.5, 0.5, 0.4), (0.0, 0.0, 0.0)),
    albedo=((0.8, 0.6, 1.0), (0.9, 0.9, 0.9)),
    phase=(0.3, None),
    intensity=(2.0, 3.0),
    airlight=(1.0, 1.0),
    surface=(1.0, 1.0),
    moved=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
)
LAYERED = replace(FOG, height=HeightFog((Layer(1.0, 2.0, 4.0), Layer(0.5, -1.0, 8.0))))


def fault(*words: str) -> Fault:
    found = [each for each in FAULTS if all(word in each.words for word in words)]
    (chosen,) = [each for each in found if each.words == words[0]] or found
    return chosen


def changed(each: Fault, *values: float, fog: Fog = FOG, predictor: Any = None) -> Guess:
    return each.change(predictor, Guess(fog), values)


@pytest.mark.parametrize(
    ("words", "values", "sigma_t", "albedo"),
    [
        ("one over what it should be: a mean free path", (), (2.0, 2.0, 2.5), (0.8, 0.6, 1.0)),
        ("the extinction is {0:.4g} times", (2.0,), (1.0, 1.0, 0.8), (0.8, 0.6, 1.0)),
        ("the absorption is {0:.4g} times", (2.0,), (0.6, 0.7, 0.4), (4 / 6, 3 / 7, 1.0)),
        ("the medium does not absorb", (), (0.4, 0.3, 0.4), (1.0, 1.0, 1.0)),
        ("taken for the scattering coefficient", (), (0.625, 0.5 / 0.6, 0.4), (0.8, 0.6, 1.0)),
        ("the albedo was applied twice", (), (0.5, 0.5, 0.4), (0.64, 0.36, 1.0)),
        ("the albedo was left out", (), (0.5, 0.5, 0.4), (1.0, 1.0, 1.0)),
        ("the albedo was decoded", (), (0.5, 0.5, 0.4), (0.60383, 0.31855, 1.0)),
        ("the albedo was encoded", (), (0.5, 0.5, 0.4), (0.90633, 0.79774, 1.0)),
    ],
)
def test_optics_by_hand(words, values, sigma_t, albedo):
    fog = changed(fault(words), *values).fog
    assert fog.sigma_t[0] == pytest.approx(sigma_t)
    assert fog.albedo[0] == pytest.approx(albedo, abs=1e-5)
    # Nothing stays nothing, and what does not scatter has no scattering coefficient.
    assert OPTICS["extinction as scattering"](0.5, 0.0) == (0.5, 0.0)
    assert (fog.sigma_t[1], fog.albedo[1]) == (FOG.sigma_t[1], FOG.albedo[1])


def test_phase_functions_are_normalised_and_have_their_shapes():
    laws = {
        "Schlick's, with k = g": (1 - 0.09) / (1 - 0.3 * 0.5) ** 2,
        "Schlick's, with k = 1.55": None,
        "Cornette and Shanks's": 1.5 * 0.91 / 2.09 * 1.25 / (1.09 - 0.3) ** 1.5,
        "Rayleigh's": 0.75 * 1.25,
        "a cosine was taken": 2.0,
    }
    for words, at_half in laws.items():
        law = changed(fault(words)).fog.phase[0]
        assert quad(lambda c, law=law: float(law(np.array(c))), -1, 1, points=[0])[
            0
        ] / 2 == pytest.approx(1)
        if at_half is not None:
            assert float(law(np.array(0.5))) == pytest.approx(at_half)
    k = 1.55 * 0.3 - 0.55 * 0.027
    law = changed(fault("Schlick's, with k = 1.55")).fog.phase[0]
    assert float(law(np.array(-0.5))) == pytest.approx((1 - k * k) / (1 + 0.5 * k) ** 2)


def test_lobes_have_another_g_and_other_phase_functions_stay():
    assert changed(fault("has the other sign")).fog.phase == (-0.3, None)
    assert changed(fault("g of the phase function is {0"), 0.7).fog.phase == (0.7, None)
    assert changed(fault("the phase function is isotropic")).fog.phase == (0.0, None)
    assert changed(fault("Henyey and Greenstein's with g"), 0.7).fog.phase == (0.7, 0.7)


@pytest.mark.parametrize(
    ("words", "segments"),
    [
        (("the way from the light is not attenuated",), {"light_segment": (0.0, 0.0)}),
        (("the way to the camera is not attenuated",), {"camera_segment": (0.0, 0.0)}),
        (("from the light", "for the fog, for surfaces it is"), {"light_segment": (0.0, 1.0)}),
        (("from the light", "for surfaces, for the fog it is"), {"light_segment": (1.0, 0.0)}),
        (("way to the camera", "for the fog, for surfaces it is"), {"camera_segment": (0.0, 1.0)}),
        (("way to the camera", "for surfaces, for the fog it is"), {"camera_segment": (1.0, 0.0)}),
        (
            ("nothing is attenuated", "is missing, w"),
            {"light_segment": (0.0, 0.0), "camera_segment": (0.0, 0.0)},
        ),
    ],
)
def test_ways_that_are_not_attenuated(words, segments):
    assert changed(fault(*words)).fog == replace(FOG, **segments)
    # On top of an equation with a constant path, that is missing with the way from the light.
    constant = replace(FOG, light_segment=(0.0, 0.0), light_length=6.0)
    without = segments.get("light_segment", (1.0, 1.0))[0] == 0
    assert (changed(fault(*words), fog=constant).fog.light_length == 0) is without


def test_fog_without_attenuation_may_end():
    ended = {"far": 7.0, "camera_segment": (0.0, 0.0)}
    for words, fields in {
        ("the way to the camera is not", "farther than"): {"spherical": True},
        ("the way to the camera is not", "beyond a plane"): {},
        ("nothing is", "farther than"): {"spherical": True, "light_segment": (0.0, 0.0)},
        ("nothing is", "beyond a plane"): {"light_segment": (0.0, 0.0)},
    }.items():
        assert changed(fault(*words), 7.0).fog == replace(FOG, **ended, **fields)


def test_terms_of_engines_alone():
    constant = changed(fault("however long it is"), 3.0).fog
    assert constant == replace(FOG, light_segment=(0.0, 0.0), light_length=3.0)
    assert changed(fault("lamps have no phase function")).fog == replace(FOG, bare=True)
    assert changed(fault("the fog alone took")).fog.planar == {"nodes", "steps"}
    # Three times the light without its albedo is what is dense, in the image of all lights.
    lit = changed(fault("the density is lit"), 3.0).fog
    assert lit == replace(FOG, albedo=((1.0, 1.0, 1.0),) * 2, lit=3.0)
    by_light = np.array([[0.1], [0.2], [0.05]]).reshape(3, 1, 1) * np.ones((2, 3, 1, 3))
    fog, surface = lit.combined(by_light)
    light = 2.0 * 0.1 + 3.0 * 0.2
    np.testing.assert_allclose(fog, 1 - math.exp(-3 * light) + 0.05)
    np.testing.assert_allclose(surface, light + 0.05)


def test_another_unit_of_length_leaves_the_lengths_of_an_equation():
    """A law of 16/(r^2 + 1) had its metre scaled with the scene: --diagnose --model found no unit."""
    law, window = LawFactor(Law("softened", 1.0, scale=16.0)), Window(Range("quartic", 8.0))
    equation = replace(
        FOG,
        law=(law, None),
        window=window,
        corners=(8.0,),
        near=0.5,
        far=300.0,
        fade=(10.0, 20.0),
        lobe=(4.0, 2.0),
        light_length=6.0,
    )
    predictor = SimpleNamespace(reference=SimpleNamespace(lights=[None]))
    fog = changed(fault("another unit of length"), 0.01, fog=equation, predictor=predictor).fog
    r = np.array([1.0, 30.0, 500.0])
    # The engine has r/100: the light is I f(r/100), of which I p^-2/r^2 stands in the intensity.
    assert fog.law[0](r) == pytest.approx((0.01 * r) ** 2 * 16 / ((0.01 * r) ** 2 + 1))
    assert fog.law[1] is None
    assert fog.window(r) == pytest.approx((1 - (r / 800).clip(0, 1) ** 4) ** 2)
    assert (fog.near, fog.far) == pytest.approx((50.0, 30_000.0))
    assert (fog.corners, fog.fade, fog.lobe) == ((800.0,), (1000.0, 2000.0), (4.0, 200.0))
    assert fog.sigma_t[0][0] * fog.light_length == pytest.approx(0.5 * 6.0)
    same = changed(fault("another unit of length"), 1.0, fog=equation, predictor=predictor).fog
    assert same == equation


def test_another_unit_of_length_dims_lights_at_places_alone():
    predictor = SimpleNamespace(reference=SimpleNamespace(lights=(None,)))
    fog = changed(fault("another unit of length"), 10.0, predictor=predictor).fog
    assert fog.intensity == pytest.approx((0.02, 3.0))  # the second light is far
    assert fog.sigma_t[0] == pytest.approx((5.0, 5.0, 4.0))


def test_the_medium_begins_and_ends_at_planes_and_distances():
    found = {
        "up to 0.3 m before": (0.3, np.inf, False),
        "up to {0:.4g} m before the camera: its near plane": (2.5, np.inf, False),
        "a start distance": (2.5, np.inf, True),
        "the fog ends {0:.3g} m before the camera, at a plane": (0.0, 2.5, False),
        "the fog ends {0:.3g} m away from the camera": (0.0, 2.5, True),
    }
    for words, expected in found.items():
        each = fault(words)
        fog = changed(each, *([2.5] if each.parameters else [])).fog
        assert (fog.near, fog.far, fog.spherical) == expected
    view = SimpleNamespace(
        distance=np.array([*np.arange(11.0), np.inf]),
        reference=SimpleNamespace(
            lights=(SimpleNamespace(position=np.array([0.0, 3.0, 4.0])),), origin=np.zeros(3)
        ),
    )
    ends = fault("the fog ends", "at a plane").begin(SimpleNamespace(view=view), Guess(FOG))
    assert ends == [pytest.approx((9 * part,)) for part in (0.9, 0.6, 0.35)]
    view.distance = np.array([np.inf])
    assert fault("the fog ends", "at a plane").begin(SimpleNamespace(view=view), Guess(FOG))[0] == (
        9.0,
    )


def test_depths_are_taken_for_distances_where_the_words_say():
    for words, where in {
        "in the attenuation and where rays end": {"surfaces", "ends"},
        "in the attenuation and the steps of the march": {"nodes", "surfaces", "steps"},
        "in the attenuation of surfaces": {"surfaces"},
    }.items():
        assert changed(fault("taken for distances", words)).fog.planar == where


def test_height_fog_by_hand():
    def layers(*words: str, values: tuple[float, ...] = ()) -> list[tuple[float, float, float]]:
        height = changed(fault(*words), *values, fog=LAYERED).fog.height
        assert height is not None
        return [(each.sigma_t, each.base, each.scale_height) for each in height.layers]

    assert layers("a falloff was asked for") == [(1.0, 2.0, 0.25), (0.5, -1.0, 0.125)]
    half = [(1.0, 2.0, pytest.approx(4 / math.log(2))), (0.5, -1.0, pytest.approx(8 / math.log(2)))]
    assert layers("densities halve") == half
    doubled = [
        (1.0, 2.0, pytest.approx(4 * math.log(2))),
        (0.5, -1.0, pytest.approx(8 * math.log(2))),
    ]
    assert layers("ln 2 times") == doubled
    assert layers("bases of layers are", values=(1.5,)) == [(1.0, 3.5, 4.0), (0.5, 0.5, 8.0)]
    assert layers("and bases {1", values=(0.5, 1.5)) == [(1.0, 3.5, 2.0), (0.5, 0.5, 4.0)]
    assert changed(fault("layers are clamped"), fog=LAYERED).fog.height.clamped
    even = changed(fault("the fog is homogeneous"), 0.2, fog=LAYERED).fog
    assert (even.sigma_t, even.height.density([-5.0, 9.0]).tolist()) == (
        ((0.2, 0.2, 0.2),),
        [1.0, 1.0],
    )
    lights = (SimpleNamespace(position=np.array([0.0, 0.0, 2.0])),)
    predictor = SimpleNamespace(
        reference=SimpleNamespace(origin=np.array([5.0, 5.0, -1.0]), lights=lights)
    )
    # Densities 1 + 0.5 exp(-3/8) at the lamp, exp(3/4) + 0.5 at the camera.
    mean = (1 + 0.5 * math.exp(-3 / 8) + math.exp(3 / 4) + 0.5) / 2
    begun = fault("the fog is homogeneous").begin(predictor, Guess(LAYERED))
    assert begun == [pytest.approx((mean * part,)) for part in (1.0, 0.3, 3.0)]


def test_light_by_distance_is_what_the_words_say():
    r = np.array([0.5, 1.0, 2.0, 5.0])

    def law(*words: str, values: tuple[float, ...] = ()) -> np.ndarray:
        fog, surface = changed(fault(*words), *values).fog.law
        assert fog is surface
        return fog(r)

    def window(*words: str, values: tuple[float, ...]) -> np.ndarray:
        found = changed(fault(*words), *values).fog.window
        assert found is not None
        return found(r)

    softened = [0.2, 0.5, 0.8, 25 / 26]
    np.testing.assert_allclose(law("(r^2 + e)", "softened", values=(1.0,)), softened)
    disk = 2 / (r**2 + 4 + r * np.sqrt(r**2 + 4))
    np.testing.assert_allclose(law("that of a disk", values=(2.0,)) / r**2, disk)
    s = np.minimum(r / 4, 1)
    np.testing.assert_allclose(law("and ends by", values=(1.0, 4.0)), softened)
    np.testing.assert_allclose(law("and no more within", values=(2.0,)), [1 / 16, 1 / 4, 1, 1])
    np.testing.assert_allclose(window("and ends by", values=(1.0, 4.0)), (1 - s**4) ** 2)
    for words, expected in {
        "(1 - (r/R)^4)^2 with R = {0": (1 - s**4) ** 2,
        "by 1 - (r/R)^4": 1 - s**4,
        "(1 - (r/R)^2)^2": (1 - s**2) ** 2,
        "by 1 - r/R": 1 - s,
        "they end at": (s < 1).astype(float),
    }.items():
        np.testing.assert_allclose(window("lights have a range", words, values=(4.0,)), expected)
    np.testing.assert_allclose(law("not over its square") / r**2, 1 / r)
    np.testing.assert_allclose(law("does not fall with the distance") / r**2, 1)


def test_spots_and_places_are_those_of_the_scenery():
    assert changed(fault("a half angle was taken")).scenery.cone == 2.0
    assert changed(fault("a whole angle was taken")).scenery.cone == 0.5
    assert changed(fault("the angles of spots are {0"), 1.2).scenery.cone == 1.2
    assert changed(fault("hard edge")).scenery.edge == "hard"
    assert changed(fault("from their axis on")).scenery.edge == "smooth"
    assert changed(fault("as a line in the cosine")).scenery.edge == "linear"
    assert changed(fault("as glTF has it")).scenery.edge == "square"
    assert changed(fault("3 x^2 - 2 x^3")).scenery.edge == "smoothstep"
    assert changed(fault("Blender's do"), 0.4).scenery.blend == 0.4
    assert changed(fault("are spheres of the radius"), 0.4).scenery.radius == 0.4
    assert changed(
        fault("the first light is off by ({0:.3g}, {1:.3g}, {2:.3g}) m"), 1.0, -2.0, 0.5
    ).scenery.moved == ((1.0, -2.0, 0.5),)


def test_a_light_whose_shadows_are_held_moves_its_fog_alone():
    lamp = SimpleNamespace(reference=SimpleNamespace(lights=(SimpleNamespace(axis=None),)))
    held = position_held(lamp, Guess(FOG), (1.0, 2.0, 3.0), (0.5, 2.0, 2.0))
    assert held.scenery.moved == ((0.5, 2.0, 2.0),)
    assert held.fog.moved == ((0.5, 0.0, 1.0), (0.0, 0.0, 0.0))
    spot = SimpleNamespace(
        reference=SimpleNamespace(lights=(SimpleNamespace(axis=np.array([0.0, 0.0, -1.0])),))
    )
    held = position_held(spot, Guess(FOG), (1.0, 2.0, 3.0), (0.5, 2.0, 2.0))
    assert held.scenery.moved == ((1.0, 2.0, 3.0),)
    assert held.fog.moved == FOG.moved


def test_surfaces_with_paths_of_their_own_keep_the_lights_where_they_are():
    """Paths of the fog alone are held while a light moves."""
    asked = {}

    def radiance(observation, scenery, fog, layer):
        asked[layer] = scenery, fog.moved
        return np.ones((2, 3))

    light = SimpleNamespace(radiance=radiance, view=lambda *_: SimpleNamespace(pixels=np.arange(2)))
    observation = SimpleNamespace(holds="total")
    predictor = Predictor(observation, light)
    vars(predictor)["unchanged"] = Guess(FOG)  # what a predictor keeps of itself
    held, own = replace(FOG, moved=((1.0, 2.0, 3.0),)), Scenery(shadows=False)
    predictor.layers(Guess(held, surfaces=own))
    assert asked == {0: (Scenery(), held.moved), 1: (own, FOG.moved)}
    predictor.layers(Guess(held))
    assert asked[1] == (Scenery(), held.moved)


def test_values_and_the_camera_by_hand():
    colours = np.array([[1.0, 2.0, 4.0], [0.25, 0.5, 0.125]])

    def values(*words: str, numbers: tuple[float, ...] = (), predictor: Any = None) -> np.ndarray:
        (change,) = changed(fault(*words), *numbers, predictor=predictor).values
        return change(colours)

    np.testing.assert_allclose(values("channel order B, G, R"), colours[:, ::-1])
    np.testing.assert_allclose(values("channel order G, B, R"), colours[:, [1, 2, 0]])
    np.testing.assert_allclose(values("a black level", numbers=(0.5,)), colours + 0.5)
    np.testing.assert_allclose(values("a gamma of", numbers=(2.0,)), np.sqrt(colours))
    observation = SimpleNamespace(values=np.array([[1.5, np.nan, 0.3]]))
    np.testing.assert_allclose(
        values("cut off at", predictor=SimpleNamespace(observation=observation)),
        np.minimum(colours, 1.5),
    )
    cosines = SimpleNamespace(cosines=np.array([1.0, 0.5]))
    fallen = values("a vignette", numbers=(2.0,), predictor=cosines)
    np.testing.assert_allclose(fallen, colours * [[1.0], [0.25]])
    exposed = changed(
        fault("the image is {0:.4g} times as bright"),
        3.0,
        fog=replace(FOG, exposure=(1.0, 2.0, 1.0)),
    )
    assert exposed.fog.exposure == (3.0, 6.0, 3.0)
    assert changed(
        fault("the image is {0:.3g} pixels too far right"), 0.5, -1.25
    ).scenery.offset == (-0.5, 1.25)
    oblong = SimpleNamespace(shape=(30, 40))
    assert changed(fault("of the other axis"), predictor=oblong).scenery.zoom == pytest.approx(
        4 / 3
    )
    assert (
        changed(fault("the image shows {0:.4g} times the width that it should"), 1.25).scenery.zoom
        == 1.25
    )
    image = np.arange(12.0).reshape(2, 2, 3)
    assert (changed(fault("interchanged")).undo(image) == image.transpose(1, 0, 2)).all()
    assert (changed(fault("mirrored")).undo(image) == image[:, ::-1]).all()
    assert (changed(fault("turned by 180")).undo(image) == image[::-1, ::-1]).all()


def test_channels_of_the_image_or_of_a_layer_have_factors():
    airlight, surface = np.array([[1.0, 2.0, 4.0]]), np.array([[3.0, 5.0, 7.0]])

    def layers(words: str, *numbers: float) -> list[list[float]]:
        (change,) = changed(fault(words), *numbers).layers
        return [image[0].tolist() for image in change(airlight, surface)]

    assert layers("green is {0:.4g} times as bright as it should be, red", 0.5) == [
        [1.0, 1.0, 4.0],
        [3.0, 2.5, 7.0],
    ]
    assert layers("of the fog, blue is", 0.5) == [[1.0, 2.0, 2.0], [3.0, 5.0, 7.0]]
    assert layers("a white balance", 2.0, 1.0, 0.5) == [[2.0, 2.0, 2.0], [6.0, 5.0, 3.5]]
    assert layers("blue of the fog are", 2.0, 1.0, 0.5) == [[2.0, 2.0, 2.0], [3.0, 5.0, 7.0]]
    assert layers("blue of surfaces are", 2.0, 1.0, 0.5) == [[1.0, 2.0, 4.0], [6.0, 5.0, 3.5]]


def test_the_camera_moves_and_turns_by_what_the_words_say():
    assert changed(fault("the camera is off by"), 0.1, -0.2, 0.3).scenery.eye == (0.1, -0.2, 0.3)
    turned = changed(fault("the camera is turned by"), 1.0, -2.0, 3.0).scenery
    assert turned.turned == (1.0, -2.0, 3.0)
    assert changed(fault("rays end at {0:.3g} times"), 0.9).fog == replace(FOG, reach=0.9)


def test_light_of_higher_orders_is_added_to_the_fog_or_to_all():
    more = np.arange(24.0).reshape(2, 4, 3)
    predictor = SimpleNamespace(light=SimpleNamespace(higher_orders=more), pixels=np.array([2, 0]))
    ones = np.ones((2, 3))
    for words, of_surfaces in (("light of multiple scattering", 0), ("light of higher orders", 1)):
        (layer,) = changed(fault(words), 0.5, predictor=predictor).layers
        airlight, surface = layer(ones, 2 * ones)
        np.testing.assert_allclose(airlight, 1 + 0.5 * more[0][[2, 0]])
        np.testing.assert_allclose(surface, 2 + 0.5 * of_surfaces * more[1][[2, 0]])
    none = SimpleNamespace(light=SimpleNamespace(higher_orders=None))
    (layer,) = changed(fault("light of higher orders"), 0.5, predictor=none).layers
    assert layer(1.0, 2.0) == (1.0, 2.0)


def test_factors_that_have_a_name_get_it():
    assert factor_name(4 * math.pi) == " (4 pi)"
    assert factor_name(1 / math.pi) == " (1/(pi))"
    assert factor_name(1 / 12.9) == " (1/(12.92, the slope of the sRGB curve at black))"
    assert factor_name(1.02 * math.pi) == ""


def test_ranges_of_numbers_hold_their_starts_and_what_changes_nothing():
    for each in FAULTS:
        for number in each.parameters:
            assert all(number.low <= start <= number.high for start in number.starts), each.words
            # A factor of 1 and an amount of 0 change nothing; an edge without
            # a blend is another fault.
            nothing = 1.0 if number.scale == "log" else 0.0
            assert number.low <= nothing <= number.high or "blend" in each.words, each.words
            # Several numbers are looked for together from one place: where nothing is changed.
            assert len(each.parameters) == 1 or each.begin or number.starts == (nothing,), (
                each.words
            )
            assert "g {0" not in each.words or -1 < number.low < number.high < 1


def test_layers_by_the_opacity_of_the_fog_by_hand():
    transmittance = np.array([[0.25, 0.5, 1.0]])
    predictor = SimpleNamespace(transmittance=lambda guess: transmittance)
    airlight, surface = np.array([[2.0, 4.0, 0.0]]), np.array([[8.0, 8.0, 8.0]])

    def layers(words: str, *values: float) -> list[list[float]]:
        (layer,) = changed(fault(words), *values, predictor=predictor).layers
        return [image[0].tolist() for image in layer(airlight, surface)]

    same, thinned = [8.0, 8.0, 8.0], [2.0, 4.0, 8.0]
    assert layers("blended as a colour") == [[1.5, 2.0, 0.0], same]
    assert layers("was not premultiplied") == [pytest.approx([2.0 / 0.75, 8.0, 0.0]), same]
    assert layers("transmittance of the whole ray") == [[0.5, 2.0, 0.0], same]
    assert layers("on the way to the camera twice") == [[2.0, 4.0, 0.0], thinned]
    assert layers("at most: its opacity", 0.5) == [pytest.approx([2 * 0.5 / 0.75, 4.0, 0.0]), same]
    assert layers("mixed by the fog's opacity") == [[1.5, 2.0, 0.0], thinned]
    assert layers("ambient light", 1.0, 2.0, 3.0) == [[2.75, 5.0, 0.0], same]


def test_the_colour_of_ambient_light_is_what_most_of_the_fog_has_too_much():
    opacity = np.array([0.1, 0.2, 0.3, 0.4])[:, None] * np.ones(3)
    more = opacity * np.array([2.0, -1.0, 0.5])
    more[0] = 99.0  # a tenth of the opacity does not decide
    predictor = SimpleNamespace(
        transmittance=lambda guess: 1 - opacity,
        shown=lambda guess: 1 + more,
        predicted=lambda guess: np.ones((4, 3)),
    )
    assert fault("ambient light").begin(predictor, Guess(FOG)) == [pytest.approx((2.0, 0.0, 0.5))]


def test_a_factor_on_the_fog_or_on_surfaces_begins_where_it_explains_what_is_left():
    assert changed(fault("the fog is {0:.4g} times as bright"), 3.0).fog == replace(
        FOG, airlight=(3.0, 3.0)
    )
    assert changed(fault("surfaces are {0:.4g} times as bright"), 3.0).fog == replace(
        FOG, surface=(3.0, 3.0)
    )
    one = scaled("intensity", (1,))(None, Guess(FOG), (3.0,))
    assert one.fog.intensity == (2.0, 9.0)
    part = np.array([4.0, 3.0, 2.0, 1.0, 0.0])
    predictor = SimpleNamespace(
        predicted=lambda guess: 1 + guess.fog.airlight[0] * part,
        shown=lambda guess: 1 + np.array([2.5, 2.5, 2.5, 9.0, 7.0]) * part,
    )
    assert fault("the fog is {0:.4g} times as bright").begin(predictor, Guess(FOG)) == [
        pytest.approx((2.5,))
    ]
    part[:] = 0
    assert fault("the fog is {0:.4g} times as bright").begin(predictor, Guess(FOG)) == [(1.0,)]


COLOUR = np.array([1.0, 0.5, 0.1])


def test_higher_orders_are_the_light_beyond_one_scattering_smoothed(monkeypatch):
    asked = []

    def batch(reference, seed, paths, *, max_depth):
        asked.append((seed, max_depth))
        numbers = np.arange(1.0, 1 + len(prediction.LAYERS))[:, None, None]
        layers = numbers * np.ones((1, 12 * 16, 1)) * COLOUR
        return SimpleNamespace(mean=layers * {64: 5.0, 2: 3.0}[max_depth])

    monkeypatch.setattr(prediction, "volpath_batch", batch)
    orders = SceneLight(SimpleNamespace(width=16, height=12)).higher_orders
    for number, layer in enumerate(("airlight", "surface")):
        expected = 2.0 * (1 + prediction.LAYERS.index(layer))
        np.testing.assert_allclose(orders[number], np.full((12 * 16, 3), expected) * COLOUR)
    seeds = {seed for seed, _ in asked}
    assert sorted(asked) == [(seed, depth) for seed in sorted(seeds) for depth in (2, 64)]
    assert len(seeds) > 1
    assert SceneLight(SimpleNamespace(width=1 << 9, height=1 << 9)).higher_orders is None


def test_light_of_higher_orders_is_unknown_where_mitsuba_cannot_trace_it(monkeypatch):
    """Bodies that touch ended a diagnosis with a line about estimators."""

    def batch(*args, **options):
        raise CannotTrace("volpath: 0 m apart")

    monkeypatch.setattr(prediction, "volpath_batch", batch)
    assert SceneLight(SimpleNamespace(width=16, height=12)).higher_orders is None
