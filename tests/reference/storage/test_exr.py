# SPDX-License-Identifier: BSD-3-Clause
import resource

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.storage.exr import Image, layer, read_exr, write_exr

SIZE = (5, 7)


@pytest.fixture
def image():
    rng = np.random.default_rng(3)
    layers = {
        name: rng.gamma(0.3, 1.7, (*SIZE, 3)).astype(np.float32)
        for name in ("airlight", "surface", "airlight_se", "surface_se")
    }
    depth = rng.random(SIZE).astype(np.float32)
    depth[0, 0] = np.inf
    attributes = {"airlight:method": "ray-march é", "airlight:spp": 256, "airlight:step": 0.125}
    return Image(layers, depth, attributes)


def write_raw(path, channels, header=None):
    import OpenEXR

    OpenEXR.File(header or {}, channels).write(str(path))


@pytest.mark.claim("image-files", tolerance="none: equal")
def test_round_trip_is_exact(tmp_path, image):
    write_exr(tmp_path / "a.exr", image)
    back = read_exr(tmp_path / "a.exr")
    assert sorted(back.layers) == ["airlight", "airlight_se", "surface", "surface_se", "total"]
    for name, values in image.layers.items():
        assert back.layers[name].dtype == np.float32
        np.testing.assert_array_equal(back.layers[name], values)
    np.testing.assert_array_equal(
        back.layers["total"], image.layers["airlight"] + image.layers["surface"]
    )
    np.testing.assert_array_equal(back.depth, image.depth)
    assert dict(back.attributes) == dict(image.attributes)
    # An image that was read can be written again, total included.
    write_exr(tmp_path / "b.exr", back)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.claim("image-files")
def test_file_is_single_part_float32_zip_with_plain_names(tmp_path, image):
    import OpenEXR

    write_exr(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        names = {f"{name}.{c}" for name in image.layers for c in "RGB"} | {"R", "G", "B", "depth.Z"}
        assert len(file.parts) == 1
        assert set(file.channels()) == names
        assert {c.pixels.dtype for c in file.channels().values()} == {np.dtype(np.float32)}
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION


@pytest.mark.parametrize(
    ("odd", "layer"), [(np.nan, "surface"), (np.inf, "airlight"), (-np.inf, "airlight")]
)
def test_what_is_not_finite_is_not_written(tmp_path, odd, layer):
    layers = {name: np.ones((2, 3, 3)) for name in ("airlight", "surface")}
    layers[layer][1, 2, 0] = odd
    with pytest.raises(
        InputError,
        match=f"layer '{layer}': 1 of 6 pixels are not finite, first in column 2 of row 1",
    ):
        write_exr(tmp_path / "a.exr", Image(layers))
    depth = np.array([[np.nan, np.inf], [1.0, 2.0]])
    with pytest.raises(InputError, match="layer 'depth': 1 of 4 pixels"):
        write_exr(tmp_path / "a.exr", Image({"airlight": np.ones((2, 2, 3))}, depth))
    assert list(tmp_path.iterdir()) == []
    # nothing was hit
    write_exr(tmp_path / "a.exr", Image({"airlight": np.ones((1, 1, 3))}, np.array([[np.inf]])))


def test_a_total_that_float32_does_not_hold_is_not_written(tmp_path):
    large = np.full((1, 1, 3), 3e38)
    with pytest.raises(InputError, match="3 values of 'total' exceed what float32 holds"):
        write_exr(tmp_path / "a.exr", Image({"airlight": large, "surface": large}))
    assert list(tmp_path.iterdir()) == []


def test_attributes_keep_their_value(tmp_path):
    attributes = {
        "airlight:seed": 2**40 + 1,  # beyond the 32 bits of the format
        "airlight:small": np.int64(-3),
        "airlight:third": np.float64(1 / 3),
        "airlight:huge": 1e300,
        "airlight:a-name-of-more-than-thirty-one-letters": "long",
        "owner": "",
    }
    write_exr(tmp_path / "a.exr", Image({"airlight": np.ones((1, 1, 3))}, attributes=attributes))
    back = read_exr(tmp_path / "a.exr").attributes
    assert back["airlight:seed"] == str(2**40 + 1)
    assert back["airlight:small"] == -3
    assert back["airlight:third"] == pytest.approx(1 / 3, rel=6e-8)  # float32
    assert float(back["airlight:huge"]) == 1e300
    assert back["airlight:a-name-of-more-than-thirty-one-letters"] == "long"
    assert back["owner"] == ""
    assert len(attributes) == len(back)


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ({}, "without layers"),
        ({"airlight": np.ones((2, 2))}, r"shape \(2, 2\); expected \(height, width, 3\)"),
        (
            {"airlight": np.ones((2, 2, 3)), "surface": np.ones((2, 3, 3))},
            "two sizes: 'airlight'.*'surface'",
        ),
        (
            {"airlight": np.ones((2, 2, 3)), "total": np.full((2, 2, 3), 1.01)},
            "'total' is not airlight",
        ),
    ],
)
def test_refuses_layers_that_do_not_fit(tmp_path, layers, message):
    (tmp_path / "a.exr").write_bytes(b"old")
    with pytest.raises(InputError, match=message):
        write_exr(tmp_path / "a.exr", Image(layers))
    assert (tmp_path / "a.exr").read_bytes() == b"old"


def test_layer_names_what_is_there_and_the_nearest(image):
    assert layer(image, "surface") is image.layers["surface"]
    with pytest.raises(
        InputError,
        match=r"x\.exr has no layer 'airligth'; it has airlight, .*did you mean 'airlight'",
    ):
        layer(image, "airligth", "x.exr")
    with pytest.raises(InputError, match="ask for one of them"):
        layer(image, "qqq")
    with pytest.raises(InputError, match="no layer of colours at all"):
        layer(Image({}), "airlight")


@pytest.mark.parametrize(
    ("name", "read"), [("Y", True), ("y", True), ("luminance", False), ("R", False)]
)
def test_a_lone_channel_is_grey_or_named_in_what_is_refused(tmp_path, name, read):
    pixels = np.full((3, 4), 0.7, np.float32)
    write_raw(tmp_path / "a.exr", {name: pixels})
    image = read_exr(tmp_path / "a.exr")
    if read:
        np.testing.assert_array_equal(image.layers["total"], np.stack([pixels] * 3, axis=-1))
    else:
        with pytest.raises(
            InputError, match=rf"no layer of colours at all \(channels left out: {name}\)"
        ):
            layer(image, "")


def test_reads_plain_half_images_and_says_so(tmp_path):
    # Thirds are not half floats; the file holds their roundings.
    thirds = (np.arange(12, dtype=np.float32).reshape(3, 4) / 3).astype(np.float16)
    write_raw(
        tmp_path / "a.exr",
        {"R": thirds, "G": thirds, "B": thirds, "A": np.ones((3, 4), np.float16)},
    )
    image = read_exr(tmp_path / "a.exr")
    assert list(image.layers) == ["total"]
    assert layer(image, "").dtype == np.float32
    np.testing.assert_array_equal(layer(image, "")[:, :, 2], thirds.astype(np.float32))
    assert "half floats" in image.attributes["airlight:read"]
    assert "channels left out: A" in image.attributes["airlight:read"]


@pytest.mark.parametrize("names", ["rgb", ("Red", "Green", "Blue"), "RGB"])
@pytest.mark.parametrize("prefix", ["", "Final."])
def test_reads_colours_by_the_names_of_other_programs(tmp_path, names, prefix):
    path = tmp_path / "other.exr"
    pixels = [np.full((3, 4), value, dtype=np.float32) for value in (0.1, 0.2, 0.3, 1.0)]
    channels = {prefix + name: values for name, values in zip([*names, "A"], pixels)}
    write_raw(path, channels)
    image = read_exr(path)
    np.testing.assert_array_equal(
        image.layers[prefix[:-1] or "total"], np.stack(pixels[:3], axis=-1)
    )
    assert image.attributes["airlight:read"] == f"channels left out: {prefix}A"


def test_broken_files_give_one_line_and_nothing_on_the_terminal(tmp_path, capfd):
    noise = np.random.default_rng(1).random((64, 64, 3))
    write_exr(tmp_path / "good.exr", Image({"airlight": noise}))
    good = (tmp_path / "good.exr").read_bytes()
    path = tmp_path / "bad.exr"
    for cut in (0, 3, 8, 100, 400, len(good) // 2, len(good) - 600, len(good) - 1):
        path.write_bytes(good[:cut])
        with pytest.raises(
            InputError, match=r"bad\.exr is (not an EXR|a broken EXR) file"
        ) as caught:
            read_exr(path)
        assert "\n" not in str(caught.value)
    path.write_text("<scene/>")
    with pytest.raises(InputError, match="not an EXR file"):
        read_exr(path)
    assert capfd.readouterr() == ("", "")


def write_parts(path, parts):
    import OpenEXR

    OpenEXR.File([OpenEXR.Part(header, channels, name) for name, header, channels in parts]).write(
        str(path)
    )


def test_plain_channels_are_the_total_whatever_layer_has_that_name(tmp_path):
    channels = {f"total.{key}": np.full((2, 2), 5, np.float32) for key in "RGB"}
    channels |= {key: np.ones((2, 2), np.float32) for key in "RGB"}
    write_parts(tmp_path / "a.exr", [("", {}, channels)])
    image = read_exr(tmp_path / "a.exr")
    assert list(image.layers) == ["total"]
    assert image.layers["total"].tolist() == np.ones((2, 2, 3)).tolist()
    assert image.attributes["airlight:read"] == "channels left out: total.B, total.G, total.R"


@pytest.mark.claim("image-parts", tolerance="none: equal")
def test_reads_the_parts_of_a_file(tmp_path):
    """Blender names the layer in the channel, others in the part alone; a part named rgba is the
    image itself, and one of a single channel may be named by that."""
    value = iter(np.arange(1, 20, dtype=np.float32))
    plane = {
        key: np.full((3, 4), next(value))
        for key in ("C.R", "C.G", "C.B", "C.A", "V.R", "V.G", "V.B", "R", "Z")
    }
    blender = [
        ("View.C", {}, {f"View.{key}": plane[key] for key in ("C.R", "C.G", "C.B", "C.A")}),
        ("View.V", {}, {f"View.{key}": plane[key] for key in ("V.R", "V.G", "V.B")}),
    ]
    write_parts(tmp_path / "a.exr", blender)
    image = read_exr(tmp_path / "a.exr")
    assert sorted(image.layers) == ["View.C", "View.V"]
    np.testing.assert_array_equal(image.layers["View.V"][2, 3], [5, 6, 7])
    assert image.attributes["airlight:read"] == "channels left out: View.C.A"
    colours = {key: plane["R"] for key in "RGB"}
    write_parts(
        tmp_path / "b.exr",
        [
            ("rgba", {"owner": "me"}, colours),
            ("fog", {}, colours),
            ("depth", {}, {"Z": plane["Z"]}),
        ],
    )
    image = read_exr(tmp_path / "b.exr")
    assert sorted(image.layers) == ["fog", "total"]
    np.testing.assert_array_equal(image.depth, plane["Z"])
    assert image.attributes == {"owner": "me"}
    alone = [(key, {}, {"Y": plane["Z"]}) for key in ("R", "G", "fog.R", "fog.G", "fog.B")]
    write_parts(tmp_path / "c.exr", [*alone, ("B", {}, {"B": plane["R"]})])
    image = read_exr(tmp_path / "c.exr")
    assert sorted(image.layers) == ["fog", "total"]
    np.testing.assert_array_equal(image.layers["total"][2, 3], [9, 9, 8])


def test_the_image_is_the_frame_whatever_window_a_file_holds(tmp_path):
    """Overscan is cut off; where a file holds a part of the frame, a mask says which.
    Tiles are read as scan lines.
    """
    import OpenEXR

    values = np.arange(48, dtype=np.float32).reshape(6, 8)
    plane = {key: values for key in "RGB"}

    def window(left, top, right, bottom):
        return np.array([left, top], np.int32), np.array([right, bottom], np.int32)

    tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    write_raw(tmp_path / "tiled.exr", plane, tiles)
    np.testing.assert_array_equal(read_exr(tmp_path / "tiled.exr").layers["total"][..., 0], values)
    tiles["tiles"].mode = OpenEXR.MIPMAP_LEVELS
    write_raw(tmp_path / "levels.exr", plane, tiles)
    with pytest.raises(InputError, match="a mipmap"):
        read_exr(tmp_path / "levels.exr")
    write_raw(
        tmp_path / "over.exr",
        plane,
        {"dataWindow": window(-2, -1, 5, 4), "displayWindow": window(0, 0, 3, 2)},
    )
    over = read_exr(tmp_path / "over.exr")
    np.testing.assert_array_equal(over.layers["total"][..., 1], values[1:4, 2:6])
    assert over.window is None
    assert "beyond the frame" in over.attributes["airlight:read"]
    write_raw(
        tmp_path / "crop.exr",
        plane,
        {"dataWindow": window(3, 1, 10, 6), "displayWindow": window(0, 0, 8, 7)},
    )
    crop = read_exr(tmp_path / "crop.exr")
    np.testing.assert_array_equal(crop.layers["total"][1:7, 3:9, 0], values[:, :6])
    assert crop.window == (3, 1, 9, 7)
    assert crop.with_data().sum() == 36
    write_raw(
        tmp_path / "far.exr",
        plane,
        {"dataWindow": window(9, 9, 16, 14), "displayWindow": window(0, 0, 3, 2)},
    )
    with pytest.raises(InputError, match="no pixel of its frame"):
        read_exr(tmp_path / "far.exr")


def test_a_full_disk_names_the_file_and_leaves_it(tmp_path):
    """OpenEXR says in words what the system said; a limit on the size of a
    file stands for the disk.
    """
    write_exr(tmp_path / "a.exr", Image({"surface": np.zeros((2, 2, 3))}))
    before = (tmp_path / "a.exr").read_bytes()
    noise = np.random.default_rng(1).random((64, 64, 3))
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, old[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            write_exr(tmp_path / "a.exr", Image({"surface": noise}))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
    assert caught.value.filename == str(tmp_path / "a.exr")
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
    assert (tmp_path / "a.exr").read_bytes() == before
