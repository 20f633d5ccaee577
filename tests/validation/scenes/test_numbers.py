# SPDX-License-Identifier: BSD-3-Clause
"""Protects that a number of which no finite image can come is refused by name, in every place of a scene."""

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from realtime.scene.read_scene import read_scene
from reference.scene.read import read_truth
from tests.helpers.bad_inputs import cloud, scene
from validation.scenes.loading import load_scene

BROKEN = {
    "position": ("nan, 0, 1", "light 'lamp': position has nan"),
    "intensity": ("1e30, 1, 1", "light 'lamp': intensity.value has 1e[+]30 in 1 of 3 places; wanted .* to 1e[+]18"),
    "g": ("nan", "phase_function.g has nan"),
    "radius": ("nan", "shape 'ball': to_world has nan"),
    "scale": ("1e30", "medium 'fog': scale has 1e[+]30"),
    "sigma_t": ("nan, 0, 0", "medium 'fog': sigma_t.value.value has nan"),
}


def load(tmp_path, text):
    path = tmp_path / "scene.xml"
    path.write_text(text)
    return load_scene(str(path)).scene


@pytest.mark.parametrize("place", BROKEN)
def test_an_odd_number_is_refused_by_its_name(variant, tmp_path, place):
    value, words = BROKEN[place]
    with pytest.raises(InputError, match=words):
        load(tmp_path, scene(**{place: value}))


def test_the_python_interface_checks_scenes_that_are_built(variant):
    import airlight

    built = mi.load_string(scene(position="0, nan, 0"))
    with pytest.raises(InputError, match="light 'lamp': position has nan"):
        airlight.load_scene(built)


def test_overlapping_media_are_named(variant, tmp_path):
    """Without an id they were called ''."""
    loaded = load(tmp_path, scene(extra=cloud(name="") + cloud(name="")))
    for read in (read_scene, read_truth):
        with pytest.raises((InputError, RealtimeInputError), match=r"shapes 'sphere-\d' and 'sphere-\d'"):
            read(loaded)


def test_deep_elements_are_refused(variant, tmp_path):
    """Mitsuba's reader calls itself for each and ended the process."""
    deep = "<scene version='3.0.0'>" + "<shape>" * 20000 + "</shape>" * 20000 + "</scene>"
    with pytest.raises(InputError, match="nested 20001 deep; wanted at most 200"):
        load(tmp_path, deep)


def test_no_opaque_shape_without_a_name_is_lost_beside_bounded_media(variant):
    """A dictionary with one key for all of them kept the last alone."""
    text = scene(extra='<shape type="rectangle"/><shape type="cube"/>' + cloud())
    read = read_scene(mi.load_string(text))
    assert len(read.geometry.shapes()) == 3
    assert np.isfinite(np.array(read.geometry.bbox().max)).all()
