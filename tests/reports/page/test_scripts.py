# SPDX-License-Identifier: BSD-3-Clause
"""The scripts of pages compute what they should, in a JavaScript engine without a browser.

The viewer of a report shows what the files hold, and the camera of the view goes where the mouse
leads it. How pages look, and that browsers run them, is for `tests/reports/test_browser.py`.
"""

import base64
import json
import zlib
from pathlib import Path

import numpy as np
import pytest

from airlight.reference.storage.exr import read_exr
from airlight.reports.page.images import page_images
from airlight.reports.page.render import SCRIPTS
from airlight.reports.plotting.pictures import error_map, signed_colours, tone_mapped
from tests.helpers.page import HEIGHT, WIDTH, small_report, write_files

racer = pytest.importorskip("py_mini_racer", reason="the extra `test` has it")

ROOT = Path(__file__).resolve().parents[3]
BROWSER = ROOT / "tests/helpers/browser.js"


def engine(*scripts):
    """Return a JavaScript engine that has run some files."""
    context = racer.MiniRacer()
    for script in (BROWSER, *scripts):
        context.eval(script.read_text(encoding="utf-8"))
    return context


def asked(context, expression):
    return json.loads(context.eval(f"JSON.stringify({expression})"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("scripts"))


@pytest.fixture(scope="module")
def viewer(folder):
    """Return an engine with the viewer of the small report, whose images are decoded."""
    folder_of_scripts = ROOT / "reports/page/templates"
    context = engine(*(folder_of_scripts / name for name in SCRIPTS if name != "page.js"))
    (packed,) = page_images(small_report().scenes, folder, 10**8)
    # An engine has no zlib and no base64: their streams are given as they are after both.
    data = base64.b64decode(packed.data)
    entries = [*packed.index["reference"].values()]
    entries += [entry for each in packed.index["methods"] for entry in each["layers"].values()]
    streams = {
        each["at"]: [*zlib.decompress(data[each["at"] : each["at"] + each["bytes"]])]
        for each in entries
    }
    table = (signed_colours().astype(int) @ [1, 256, 65536] + 0xFF000000).tolist()
    context.eval(f"""
        bytesOfBase64 = () => new Uint8Array({len(data)});
        const streams = {json.dumps(streams)};
        inflated = async (bytes) => Uint8Array.from(streams[bytes.byteOffset]);
        const element = new Element();
        element.dataset.method = "0";
        const images = new SceneImages({json.dumps(packed.index)}, new Element());
        const viewer = new Viewer(element, images, {{signed: Uint32Array.from({table})}}, () => 0);
        viewer.showControls = viewer.showScale = () => 0;
        let failure = null;
        (async () => {{ for (const n of viewer.labels.keys()) await images.loadMethod(n); }})()
            .catch((error) => {{ failure = String(error); }});
    """)
    assert asked(context, "[failure, images.complete]") == [None, True]
    return context


def layer(folder, name, which="airlight"):
    return read_exr(folder / "s" / f"{name}.exr").layers[which].astype(np.float64)


def drawn(context, name):
    """Return the pixels of a canvas of the viewer, (height, width, 3)."""
    values = asked(context, f"[...viewer.canvases.{name}.pixels]")
    return np.array(values).reshape(HEIGHT, WIDTH, 4)[..., :3]


@pytest.mark.claim("report-stands-alone")
@pytest.mark.parametrize(("number", "name"), [(0, "good"), (1, "flat")])
@pytest.mark.parametrize("stops", [0, -2])
def test_the_viewer_draws_what_the_files_hold(viewer, folder, number, name, stops):
    viewer.eval(
        f"viewer.set({{method: {number}, layer: 'airlight', mode: 'signed', stops: {stops}}})"
    )
    # The table of sRGB has 16385 steps and the reference 16 digits: one level at most.
    for which, file in (("reference", "reference"), ("method", name)):
        expected = tone_mapped(layer(folder, file), 2.5 * 2.0**stops).astype(int)
        finite = np.isfinite(layer(folder, file)).all(axis=-1)
        assert np.abs(drawn(viewer, which) - expected)[finite].max() <= 1
    expected = error_map(layer(folder, "reference"), layer(folder, name)).astype(int)
    finite = np.isfinite(layer(folder, name)).all(axis=-1)
    # A step of the map where the coded difference falls on the other side of a bound.
    assert np.abs(drawn(viewer, "error") - expected)[finite].max() <= 6
    hatch = drawn(viewer, "error")[~finite].tolist()
    assert all(each in ([255, 0, 255], [122, 0, 122]) for each in hatch)


def as_number(words):
    mantissa, _, power = words.replace("\N{MINUS SIGN}", "-").removesuffix(" %").partition("·10")
    return float(mantissa) * 10.0 ** int(
        power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0
    )


@pytest.mark.parametrize("which", ["airlight", "surface", "total"])
def test_the_probe_says_what_the_files_hold(viewer, folder, which):
    row, column = 10, 12
    viewer.eval(f"viewer.set({{method: 1, layer: '{which}'}})")
    images = {}
    for name in ("reference", "flat"):
        layers = {each: layer(folder, name, each) for each in ("airlight", "surface")}
        images[name] = (layers | {"total": layers["airlight"] + layers["surface"]})[which]
    *radiance, error, flip = asked(viewer, f"viewer.probeRow(1, {row * WIDTH + column})")
    expected, reference = images["flat"][row, column], images["reference"][row, column]
    # Five digits of a reference in 16 binary ones, and of a difference that is coded to 0.2 %.
    allowed = 1e-4 * np.abs(expected) + 2.1e-3 * np.abs(expected - reference)
    assert np.all(np.abs([as_number(words) for words in radiance] - expected) <= allowed)
    relative = expected / reference - 1
    worst = relative[np.abs(relative).argmax()]
    # three digits of a difference coded to 0.2 %
    assert as_number(error) == pytest.approx(100 * worst, rel=6e-3)
    assert float(flip) == pytest.approx(
        layer(folder, "flat", "flip")[row, column, 0], abs=0.5 / 255 + 5e-4
    )


def test_the_pointer_meets_the_pixel_under_it(viewer):
    event = "{{target: new Element(), clientX: {}, clientY: {}}}"
    for x, y, pixel in (
        (10, 20, [0, 0]),
        (10 + 199.9, 20 + 99.9, [31, 23]),
        (10 + 105, 20 + 53.5, [16, 12]),
    ):
        assert asked(viewer, f"viewer.pixelAt({event.format(x, y)})") == pixel
    # outside: the nearest
    assert asked(viewer, f"viewer.pixelAt({event.format(-50, 900)})") == [0, 23]


@pytest.fixture
def view():
    context = engine(ROOT / "reports/view/page/view.js")
    context.eval("""takeCamera({"camera.origin": [1, -5, 2], "camera.target": [1.2, -4.1, 1.9], "camera.up": [0, 0, 1],
        "light.position": [1.8, -1, 1.2]})""")
    return context


def test_an_error_that_is_not_known_is_not_shown_as_none(view):
    """As in the dark, where the reference has no mean to be relative to."""
    unknown = dict.fromkeys(("relative_rmse", "interval", "relative_bias", "p99", "own_error"))
    error = json.dumps(unknown | {"known": 7, "pixels": 9})
    view.eval(f'hear.error({{failure: "", done: false, frames: 2, mean: null, error: {error}}})')
    words = asked(view, '$("#error").textContent')
    assert "RMSE not known" in words
    assert "%" not in words.replace("99 % of pixels", "")


def camera(context):
    return [np.array(asked(context, f"camera.{name}")) for name in ("origin", "target")]


@pytest.mark.parametrize("unit", [1e-6, 1.0])
def test_the_mouse_moves_the_camera_that_was_typed(view, unit):
    """The old aim stayed, and a camera in a scene of micrometres turned about a place 3 m away."""
    places = {"camera.origin": [1, -5, 2], "light.position": [1.8, -1, 1.2]}
    typed = {name: [unit * each for each in place] for name, place in places.items()}
    x, y, z = typed["camera.origin"]
    typed |= {"camera.target": [x, y + 1, z], "camera.up": [0, 0, 1]}
    view.eval(f"takeCamera({json.dumps(typed)})")
    origin, target = camera(view)
    np.testing.assert_allclose(origin, unit * np.array([1.0, -5, 2]))
    np.testing.assert_allclose(target, unit * np.array([1.0, -1, 2]))
    view.eval("dolly(-1)")
    np.testing.assert_allclose(camera(view)[0][1], unit * (-1 - 4 * np.exp(-1.0)))


@pytest.mark.claim("view-camera")
def test_the_camera_goes_where_it_is_led(view):
    """Round the target at the light's distance; nearer by a factor; beside and along its
    own axes; no flip overhead.
    """
    origin, target = camera(view)
    aim = np.array([0.2, 0.9, -0.1]) / np.linalg.norm([0.2, 0.9, -0.1])
    np.testing.assert_allclose(target, origin + aim * (aim @ [0.8, 4.0, -0.8]))
    view.eval("orbit(0.3, 0)")
    turned, same = camera(view)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(
        turned - target, np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ (origin - target)
    )
    np.testing.assert_array_equal(same, target)
    view.eval("dolly(-0.5)")
    np.testing.assert_allclose(camera(view)[0] - target, np.exp(-0.5) * (turned - target))
    # Seen from the camera, pan goes to the right and up, fly along the axis.
    before, target = camera(view)
    forward = (target - before) / np.linalg.norm(target - before)
    right = np.cross(forward, [0, 0, 1]) / np.linalg.norm(np.cross(forward, [0, 0, 1]))
    view.eval("pan(0.4, 0.7)")
    moved = 0.4 * right + 0.7 * np.cross(right, forward)
    np.testing.assert_allclose(camera(view), [before + moved, target + moved])
    view.eval("fly(0.5, 0, 0)")
    np.testing.assert_allclose(
        camera(view), [before + moved + 0.5 * forward, target + moved + 0.5 * forward]
    )
    # The pole is never passed: there the view would turn over.
    view.eval("for (let i = 0; i < 100; i++) orbit(0, 0.05)")
    origin, target = camera(view)
    assert abs((target - origin)[2]) / np.linalg.norm(target - origin) <= 0.998
    # The program is told of it in seven digits, and only of what it has not been told.
    view.eval("step(1016); step(1032)")
    (told,) = asked(view, "sent")
    np.testing.assert_allclose(told["changes"]["camera.origin"], origin, rtol=1e-6)
    assert told["moves"] == 1
