# SPDX-License-Identifier: BSD-3-Clause
"""A grid of OpenVDB is the same field in a scene: its values, its place, and what is around it.

`tests/data/openvdb.vdb` was written by OpenVDB 12 (its version in Blender 5.0): the formula of
`VALUES` from the index (1, 0, 2) on, scales of 0.5, 0.4 and 0.3 m, moved by (1.5, -2.25, 0.75) m.
"""

import gzip
import importlib.util
import shutil
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError, MissingError
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene, scene_identity
from airlight.validation.scenes.vdb import read_vdb
from tests.helpers.density_grid import ALBEDO, INSIDE, grid_xml

FILE = Path(__file__).resolve().parents[2] / "data/openvdb.vdb"
NANO = FILE.with_name("nanovdb.nvdb.gz")
VALUES = 0.1 + (np.tensordot([7, 5, 3], np.indices((7, 5, 6)), 1) % 11) / 10
FIRST, STEP, MOVED = np.array([1, 0, 2]), np.array([0.5, 0.4, 0.3]), np.array([1.5, -2.25, 0.75])

needs_tinyvdb = pytest.mark.skipif(
    importlib.util.find_spec("tinyvdb") is None, reason="the extra `vdb` is not installed"
)


def openvdb(place):
    """Return the value of OpenVDB's grid at a place, by its definition: trilinear in the index
    space, 0 beyond the values.
    """
    index = (place - MOVED) / STEP - FIRST
    cell = np.floor(index).astype(int)
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        at = cell + corner
        if np.all(at >= 0) and np.all(at < VALUES.shape):
            total += np.prod(1 - np.abs(index - at)) * VALUES[tuple(at)]
    return total


def vdb_volume(file, more=""):
    return f'<volume type="gridvolume" name="sigma_t"><string name="filename" value="{file}"/>{more}</volume>'


def load(folder, extinction):
    path = folder / "scene.xml"
    path.write_text(grid_xml(extinction, INSIDE, albedo=ALBEDO))
    return load_scene(str(path)).scene


@pytest.mark.claim("vdb-grids", tolerance="2e-6, float32 of Mitsuba")
@needs_tinyvdb
def test_the_field_is_that_of_openvdb(variant, tmp_path):
    """At random places within, at the faces and beyond, also where a to_world moves the grid."""
    turned = '<transform name="to_world"><scale x="1.5"/><translate z="0.3"/></transform>'
    places = np.random.default_rng(5).uniform(-0.1, 1.1, (200, 3))
    places = MOVED + STEP * (FIRST - 1.5 + places * (np.array(VALUES.shape) + 2))
    expected = np.array([openvdb(place) for place in places])
    assert 50 < np.count_nonzero(expected) < 190
    for more, matrix in (("", np.eye(3)), (turned, np.diag([1.5, 1, 1]))):
        medium = load(tmp_path, vdb_volume(FILE, more)).sensors()[0].get_medium()
        moved = places @ matrix + ([0, 0, 0.3] if more else [0, 0, 0])
        interaction = mi.MediumInteraction3f()
        interaction.p = mi.Point3f(moved.T)
        found = np.array(medium.get_scattering_coefficients(interaction)[2])[0] / 0.8
        # Beyond its box Mitsuba's volume is not asked: a medium ends there.
        box = read_vdb(FILE).to_world
        low, high = box[:3, 3], box[:3, 3] + np.diag(box)[:3]
        within = np.all((places >= low) & (places <= high), axis=1)
        np.testing.assert_allclose(found[within], expected[within], atol=2e-6)
        assert not expected[~within].any()


@pytest.mark.claim("vdb-grids")
@needs_tinyvdb
def test_a_grid_of_tinyvdb_has_the_reference_of_the_same_volume(variant, tmp_path):
    import tinyvdb

    values = np.random.default_rng(9).random((4, 5, 6)).astype(np.float32)  # x, y, z
    first = np.array([-2, 3, 5])
    file = tmp_path / "written.vdb"
    with tinyvdb.open(str(FILE)) as source:
        source.read_grids()
        coords = np.indices(values.shape).reshape(3, -1).T + first
        packed = coords.astype(np.int32).tobytes(), values.ravel().tobytes()
        source.replace_grid_from_sparse(0, *packed, "density")
        source.save(str(file))
    # The same field by hand: a layer of 0 around the values, at the centres of voxels.
    mi.VolumeGrid(np.pad(values, 1).transpose(2, 1, 0)[..., None]).write(str(tmp_path / "a.vol"))
    low, size = STEP * (first - 1.5) + MOVED, STEP * (np.array(values.shape) + 2)
    place = f'<scale value="{", ".join(map(repr, size.tolist()))}"/>'
    place += f'<translate value="{", ".join(map(repr, low.tolist()))}"/>'
    by_hand = vdb_volume("a.vol", f'<transform name="to_world">{place}</transform>')
    one, other = (
        quadrature_image(read_reference(load(tmp_path, each)))
        for each in (vdb_volume(file), by_hand)
    )
    assert other.airlight.max() > 0
    assert np.abs(one.airlight - other.airlight).max() <= 1e-6 * other.airlight.mean()


@needs_tinyvdb
def test_another_grid_is_another_scene(variant, tmp_path):
    """The identity is the key of cached results."""
    import tinyvdb

    file, path = tmp_path / "g.vdb", tmp_path / "scene.xml"
    shutil.copyfile(FILE, file)
    path.write_text(grid_xml(vdb_volume("g.vdb"), INSIDE))
    before = scene_identity(str(path))
    assert scene_identity(str(path)) == before
    with tinyvdb.open(str(file)) as source:
        source.read_grids()
        one = np.zeros((1, 3), np.int32).tobytes(), np.ones(1, np.float32).tobytes()
        source.replace_grid_from_sparse(0, *one, "density")
        source.save(str(tmp_path / "h.vdb"))
    shutil.copyfile(tmp_path / "h.vdb", file)
    assert scene_identity(str(path)) != before


@needs_tinyvdb
@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('<string name="grid_name" value="heat"/>', r"no grid of floats 'heat'.*density \(Tree"),
        ('<string name="filter_type" value="nearest"/>', "with filter_type 'trilinear'"),
    ],
)
def test_other_grids_and_filters_are_refused(variant, tmp_path, more, words):
    with pytest.raises(InputError, match=words):
        read_reference(load(tmp_path, vdb_volume(FILE, more)))


@needs_tinyvdb
@pytest.mark.parametrize("data", [b"", b"no grid at all", FILE.read_bytes()[:900]])
def test_a_broken_file_is_refused(variant, tmp_path, data):
    (tmp_path / "g.vdb").write_bytes(data)
    with pytest.raises(InputError, match=r"g.vdb: it cannot be read as OpenVDB"):
        load(tmp_path, vdb_volume("g.vdb"))


@pytest.mark.claim("vdb-grids")
@needs_tinyvdb
def test_a_grid_of_nanovdb_has_its_values_and_its_place(variant, tmp_path):
    """`tests/data/nanovdb.nvdb.gz` was written by NanoVDB's headers: the same values, one scale."""
    file = tmp_path / "g.nvdb"
    file.write_bytes(gzip.decompress(NANO.read_bytes()))
    grid = read_vdb(file)
    np.testing.assert_allclose(grid.values, np.pad(VALUES, 1).transpose(2, 1, 0), atol=1e-7)
    np.testing.assert_allclose(grid.to_world[:3, 3], 0.5 * (FIRST - 1.5) + MOVED)
    np.testing.assert_allclose(np.diag(grid.to_world)[:3], 0.5 * (np.array(VALUES.shape) + 2))
    assert load(tmp_path, vdb_volume("g.nvdb")).sensors()[0].get_medium() is not None


@needs_tinyvdb
@pytest.mark.parametrize("size", [0, 8, 300, 200_000])
def test_a_broken_file_of_nanovdb_is_refused(variant, tmp_path, size):
    (tmp_path / "g.nvdb").write_bytes(gzip.decompress(NANO.read_bytes())[:size])
    with pytest.raises(InputError, match=r"g.nvdb: it cannot be read as NanoVDB"):
        load(tmp_path, vdb_volume("g.nvdb"))


@pytest.mark.claim("extras-when-needed")
def test_without_the_package_the_extra_is_named(variant, tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "tinyvdb" else find(name)
    )
    with pytest.raises(MissingError, match="needs the package tinyvdb") as raised:
        load(tmp_path, vdb_volume(FILE))
    assert raised.value.extra == "vdb"
