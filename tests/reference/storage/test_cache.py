# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import fields

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.cache import cache_folder, drop_arrays, is_kept, load_arrays, store_arrays
from reference.storage.scene_digest import cache_key, scene_digest
from tests.helpers.scenes import spot, tiny_scene


def load(**changes):
    import mitsuba as mi

    return mi.load_dict(tiny_scene(size=(5, 4), **changes))


def changed(name, **entries):
    """The scene with other values in one of its entries."""
    return load(**{name: tiny_scene()[name] | entries})


def rgb(*values):
    return {"type": "rgb", "value": list(values)}


CHANGES = {
    "extinction": lambda: changed("fog", sigma_t=0.3100001),
    "scale of the extinction": lambda: changed("fog", scale=1.1),
    "red albedo": lambda: changed("fog", albedo=rgb(0.91, 0.8, 0.7)),
    "blue albedo": lambda: changed("fog", albedo=rgb(0.9, 0.8, 0.71)),
    "Rayleigh phase function": lambda: changed("fog", phase={"type": "rayleigh"}),
    "HG phase function": lambda: changed("fog", phase={"type": "hg", "g": 0.3}),
    "HG phase function, g": lambda: changed("fog", phase={"type": "hg", "g": 0.31}),
    "light's position": lambda: changed("lamp", position=[0.9, 0.7, 1.91]),
    "light's green intensity": lambda: changed("lamp", intensity=rgb(5.0, 4.1, 3.0)),
    "spot": lambda: load(lamp=spot()),
    "spot's beam": lambda: load(lamp=spot(beam=17.0)),
    "spot's cutoff": lambda: load(lamp=spot(cutoff=34.0)),
    "radius": lambda: changed("ball", radius=0.411),
    "centre": lambda: changed("ball", center=[0.1, 0.1, 0.71]),
    "blue reflectance": lambda: changed("ball", bsdf={"type": "diffuse", "reflectance": rgb(0.6, 0.5, 0.31)}),
    "both sides": lambda: changed("ball", bsdf={"type": "twosided", "bsdf": tiny_scene()["ball"]["bsdf"]}),
    "turned inside out": lambda: changed("ball", flip_normals=True),
    "without the sphere": lambda: load(ball=None),
    "field of view": lambda: changed("sensor", fov=49.5),
    "size": lambda: changed("sensor", film=tiny_scene(size=(6, 4))["sensor"]["film"]),
}


@pytest.mark.parametrize("what", CHANGES)
def test_every_change_of_a_scene_changes_its_digest(variant, what):
    """A key that does not change would answer with the truth of another scene."""
    digests = {name: scene_digest(make()) for name, make in CHANGES.items() if name != what}
    assert scene_digest(CHANGES[what]()) not in {scene_digest(load()), *digests.values()}


def test_one_vertex_changes_the_digest(variant):
    import mitsuba as mi

    from validation.scenes.loading import load_scene

    scene = load_scene("colonnade", (5, 4)).scene
    before = scene_digest(scene)
    parameters = mi.traverse(scene)
    vertices = np.array(parameters["columns.vertex_positions"])
    vertices[-1] = np.nextafter(vertices[-1], np.float32(np.inf))
    parameters["columns.vertex_positions"] = vertices
    parameters.update()
    assert scene_digest(scene) != before


UNNAMED = """<scene version="3.0.0">
    <medium type="homogeneous" id="fog"><float name="sigma_t" value="0.31"/></medium>
    <emitter type="point"><rgb name="intensity" value="5, 4, 3"/></emitter>
    <sensor type="perspective"><ref name="medium" id="fog"/></sensor>
    <shape type="sphere"><bsdf type="conductor"/></shape>
    <shape type="sphere"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
</scene>"""


def test_plugins_without_a_name_have_the_same_digest_at_every_load(variant):
    import mitsuba as mi

    first = mi.load_string(UNNAMED)
    keep = [mi.load_dict({"type": "sphere"}) for _ in range(7)]  # so that the next scene lies elsewhere in memory
    second = mi.load_string(UNNAMED)
    assert len(keep) == 7
    assert scene_digest(first) == scene_digest(second)
    assert scene_digest(load()) == scene_digest(load())


def test_digest_is_the_same_in_another_process(variant, tmp_path):
    """Names by address, hash seeds and set order must not enter."""
    import os
    import subprocess
    import sys

    import mitsuba as mi

    script = (
        "import sys, mitsuba as mi; mi.set_variant(sys.argv[1])\n"
        "from reference.storage.scene_digest import scene_digest\n"
        "print(scene_digest(mi.load_string(sys.argv[2])))"
    )
    here = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
    environment = os.environ | {"PYTHONHASHSEED": "4711", "PYTHONPATH": here}
    process = subprocess.run(
        [sys.executable, "-c", script, variant, UNNAMED], env=environment, capture_output=True, text=True, check=True
    )
    assert process.stdout.split()[-1] == scene_digest(mi.load_string(UNNAMED))


def test_key_depends_on_estimator_and_settings(variant):
    scene = load()
    settings = {"samples": 256, "shadow_scale": 1.0}
    keys = {
        cache_key(scene, "quadrature", settings),
        cache_key(scene, "volpath", settings),
        cache_key(scene, "quadrature", settings | {"samples": 255}),
        cache_key(scene, "quadrature", settings | {"shadow_scale": 1 - 8.94e-4}),
    }
    assert len(keys) == 4
    assert cache_key(scene, "quadrature", dict(reversed(settings.items()))) in keys


def test_key_depends_on_the_version_of_mitsuba(variant, monkeypatch):
    import importlib.metadata

    before = cache_key(load(), "quadrature", {})
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "3.10.0")
    assert cache_key(load(), "quadrature", {}) != before


def test_arrays_come_back_bit_by_bit():
    given = {"image": np.array([[1 / 3, -0.0], [np.inf, np.nan]]), "count": np.int64(7), "word": "fog"}
    store_arrays("round-trip", given)
    loaded = load_arrays("round-trip")
    assert loaded is not None
    assert set(loaded) == set(given)
    assert loaded["image"].tobytes() == given["image"].tobytes()
    assert (int(loaded["count"]), str(loaded["word"])) == (7, "fog")


def test_storing_again_replaces():
    store_arrays("twice", {"a": np.zeros(3), "b": np.zeros(1)})
    store_arrays("twice", {"a": np.ones(2)})
    loaded = load_arrays("twice")
    assert loaded is not None
    assert {name: value.tolist() for name, value in loaded.items()} == {"a": [1.0, 1.0]}
    assert [path.name for path in cache_folder().glob("*twice*")] == ["twice.npz"]


def test_what_is_not_there_is_none():
    assert load_arrays("never-stored") is None


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.99, 0.9999])
def test_truncated_file_counts_as_none(share):
    store_arrays("cut", {"a": np.arange(1000.0)})
    path = cache_folder() / "cut.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    assert load_arrays("cut") is None


@pytest.mark.claim("damaged-cache")
@pytest.mark.parametrize("damage", ["flipped bit", "text", "a lone array", "pickle"])
def test_damaged_file_counts_as_none(damage, tmp_path):
    store_arrays("damaged", {"a": np.arange(1000.0)})
    path = cache_folder() / "damaged.npz"
    if damage == "flipped bit":
        content = bytearray(path.read_bytes())
        content[4000] ^= 1
        path.write_bytes(content)
    elif damage == "text":
        path.write_text("not an archive at all\n" * 100)
    elif damage == "a lone array":
        np.save(tmp_path / "lone.npy", np.arange(3.0))
        path.write_bytes((tmp_path / "lone.npy").read_bytes())
    else:
        # Loading a pickle would run what a stranger wrote into the cache.
        np.savez(path, a=np.array([{"code": 1}], dtype=object))
    assert load_arrays("damaged") is None


def test_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own"
    monkeypatch.delenv("AIRLIGHT_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "airlight"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "airlight"


def test_folder_is_made_when_first_needed(monkeypatch, tmp_path):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "deep" / "er"))
    assert load_arrays("x") is None
    assert not (tmp_path / "deep").exists()
    store_arrays("x", {"a": 1})
    assert load_arrays("x") == {"a": 1}


def test_folder_that_cannot_be_made_is_the_users_to_mend(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "file"))
    assert load_arrays("x") is None
    with pytest.raises(InputError, match="is not a folder"):
        store_arrays("x", {"a": 1})


def test_nothing_half_written_stays_behind(monkeypatch):
    """A run that is killed while it writes leaves the old arrays."""
    import reference.storage.files

    store_arrays("killed", {"a": np.zeros(3)})

    def killed(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(reference.storage.files.os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        store_arrays("killed", {"a": np.ones(3)})
    loaded = load_arrays("killed")
    assert loaded is not None
    assert loaded["a"].tolist() == [0.0, 0.0, 0.0]
    assert len(list(cache_folder().glob("*killed*"))) == 1


def test_fields_of_a_truth_image_are_what_the_cache_keeps(variant):
    """A field added to one and not to the other would make every look-up fail."""
    from reference.quadrature.ray_values import TruthImage
    from validation.estimates.quadrature import truth_image

    scene = load()
    truth_image(scene, samples=16)
    loaded = load_arrays(cache_key(scene, "quadrature", {"samples": 16, "shadow_scale": 1.0}))
    assert loaded is not None
    # Lights with extent alone have standard errors and are seen.
    extent = {"airlight_se", "surface_se", "emitted"}
    assert set(loaded) == {field.name for field in fields(TruthImage)} - extent


@pytest.mark.parametrize("change", ["a number", "a name", "a shape", "a kind", "one more", "no digest"])
def test_content_that_is_not_what_was_stored_counts_as_none(change):
    """Written by NumPy, so that the archive is whole in itself."""
    store_arrays("edited", {"a": np.arange(6.0), "b": np.int64(3)})
    path = cache_folder() / "edited.npz"
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    if change == "a number":
        arrays["a"][2] += 1e-12
    elif change == "a name":
        arrays["c"] = arrays.pop("b")
    elif change == "a shape":
        arrays["a"] = arrays["a"].reshape(2, 3)
    elif change == "a kind":
        arrays["a"] = arrays["a"].view(np.int64)
    elif change == "one more":
        arrays["c"] = np.zeros(1)
    else:
        del arrays["digest"]
    np.savez(path, **arrays)
    assert load_arrays("edited") is None
    assert is_kept("edited")


def test_a_file_under_another_name_counts_as_none():
    """A copy of one scene's truth is not another's."""
    store_arrays("folder/one", {"a": np.arange(6.0)})
    (cache_folder() / "folder" / "two.npz").write_bytes((cache_folder() / "folder" / "one.npz").read_bytes())
    assert load_arrays("folder/one") is not None
    assert load_arrays("folder/two") is None
    drop_arrays("folder/one")
    drop_arrays("folder/one")
    assert not is_kept("folder/one")
