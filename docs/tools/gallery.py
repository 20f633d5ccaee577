# SPDX-License-Identifier: BSD-3-Clause
"""Makes the pictures of README and documentation: `python docs/tools/gallery.py [NAME ..]`.

A name is a picture's, a scene's or a method's; without one all are made, except for the page of a
report, which takes a browser and a report in `airlight-report`. `docs/gallery/gallery.json` lists
the file, the command and what it shows. How each method works is drawn in `method-NAME-sketch.png`,
which no program makes.
"""

import io
import json
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from airlight.errors import InputError, nearest
from airlight.realtime.frame.samples import render_samples
from airlight.realtime.methods.registry import METHODS, PUBLISHED_METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.storage.files import temporary_folder, write_bytes, write_text
from airlight.reports.data.records import read_report
from airlight.reports.machine.environment import MissingError, activate, versions
from airlight.reports.plotting.pictures import error_map, error_scale, preview, tone_curve
from airlight.reports.tables.table import number
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.scenes.changes import parse_changes
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study.configuration import configuration, parse_settings, prepared
from airlight.validation.study.turns import time_frame

DOCS = Path(__file__).resolve().parents[1]
FOLDER = DOCS / "gallery"
LIST = FOLDER / "gallery.json"
REPORT = Path("airlight-report")  #: of which the picture of a page is
LARGEST = 150_000  #: bytes of a file
COARSER = 3  #: by which error maps of area lights are coarser

Pixels = np.ndarray[Any, np.dtype[np.uint8]]
SIZE, SMALL = (640, 480), (480, 360)
SAMPLES = 16
# fewer light samples show as bands
_SOFT = ("ray-march", ("shadow=map", "steps=64", "points=64"), 4)
_CLOUDS = ("cloud-octaves", (), 1)  # seconds a frame
#: How a scene is shown where `shadow-planes` would be slow or refused:
#: method, settings, rays a pixel.
_OTHERWISE = {
    "tangle": ("light-volumes", ("map=1024",), SAMPLES),
    "smoke": ("ray-march", (), 4),
    **dict.fromkeys(("penumbra-plane", "fence", "soft-hall", "overlap"), _SOFT),
    **dict.fromkeys(
        (
            "cloud-slab",
            "stratocumulus",
            "cumulus",
            "cumulus-detail",
            "step-cloud",
            "ring",
            "two-lobes",
        ),
        _CLOUDS,
    ),
}
#: Scenes that are seen from elsewhere, as `--change` takes it.
_SEEN_FROM = {"two-lobes": ("camera.origin=-931.0,-713.0,1213.0", "camera.target=23.0,31.0,889.0")}
#: The scene in which a method is shown, and its settings, where that is not
#: `hall` and its defaults.
_METHOD_SCENES = {
    "soft-shafts": ("penumbra-plane", ()),
    "cloud-octaves": ("cumulus", ()),
    "cloud-collectors": ("stratocumulus", ()),
}
#: Methods without a map of their errors: the reference of clouds takes hours without noise.
_NO_ERROR = ("cloud-octaves", "cloud-collectors")
#: Clouds in other lights, by `cloud-collectors`: the scene, and what is changed in it.
_VIEWS = {
    "cloud-noon": ("cumulus", ("light.direction=0.13,0.17,-0.98",)),
    "cloud-silver-lining": ("cumulus", ("light.direction=0.11,-0.95,-0.29",)),
}
TUTORIAL = "gate.xml"  #: the scene of docs/scene-to-figure.md, in which it stands
STRIP = ("hall", "clutter", "three-media", "windows")  #: at the top of the README


@dataclass(frozen=True)
class Picture:
    """A picture of the gallery."""

    name: str
    kind: str  #: "scene", "method" (what it renders), "error", "strip" or "page" (of a report)
    scene: str  #: that it shows; the first of a strip
    method: str = ""
    settings: tuple[str, ...] = ()
    samples: int = 1  #: rays a pixel
    changes: tuple[str, ...] = ()  #: of the scene, as `--change` takes them

    @property
    def file(self) -> str:
        """The name of its file: JPEG for what is rendered, PNG where
        colours must stay as they are.
        """
        return f"{self.name}.{'png' if self.kind == 'error' else 'jpg'}"

    @property
    def command(self) -> str:
        """The command that shows the same to a reader."""
        if self.kind not in ("scene", "method"):
            return f"python docs/tools/gallery.py {self.name}"
        width, height = SIZE if self.kind == "scene" else SMALL
        words = [
            f"airlight render {self.scene} --method {self.method}",
            *(f"--set {word}" for word in self.settings),
        ]
        words += [f"--change {word}" for word in self.changes]
        words += [
            f"--size {width}x{height}",
            f"--samples {self.samples}" if self.samples > 1 else "",
        ]
        return " ".join([*filter(None, words), f"-o {self.scene.removesuffix('.xml')}.png"])


def scene_picture(scene: str) -> Picture:
    """Return the picture of a built-in scene."""
    method, settings, samples = _OTHERWISE.get(scene, ("shadow-planes", (), SAMPLES))
    return Picture(
        f"scene-{scene}", "scene", scene, method, settings, samples, _SEEN_FROM.get(scene, ())
    )


def method_pictures(method: str) -> tuple[Picture, ...]:
    """Return the pictures of a method: what it renders, and its error."""
    scene, settings = _METHOD_SCENES.get(method, ("hall", ()))
    rendered = Picture(f"method-{method}", "method", scene, method, settings)
    error = Picture(f"method-{method}-error", "error", scene, method, settings)
    return (rendered,) if method in _NO_ERROR else (rendered, error)


def pictures() -> Iterator[Picture]:
    """Yield all pictures, in the order in which they are made."""
    yield from map(scene_picture, SCENES)
    for method in METHODS:
        if method not in PUBLISHED_METHODS:
            yield from method_pictures(method)
    for name, (scene, changes) in _VIEWS.items():
        yield Picture(name, "method", scene, "cloud-collectors", changes=changes)
    yield Picture("strip", "strip", STRIP[0])
    yield Picture("report-page", "page", "")
    yield Picture("tutorial-gate", "scene", TUTORIAL, "shadow-planes", (), SAMPLES)


def chosen_pictures(names: Iterable[str]) -> list[Picture]:
    """Return the pictures of those names, all but the page of a report for no name."""
    known = list(pictures())
    chosen: dict[str, Picture] = {}
    for name in names:
        found = [
            p for p in known if p.name == name or (name in (p.scene, p.method) and name in p.name)
        ]
        if not found:
            near = nearest(name, [picture.name for picture in known])
            raise InputError(
                f"gallery: got {name!r}, expected the name of a picture, a scene or a method{near}"
            )
        chosen |= {picture.name: picture for picture in found}
    return list(chosen.values()) or [picture for picture in known if picture.kind != "page"]


def make(wanted: list[Picture]) -> None:
    """Make pictures and bring their list up to date."""
    kept = json.loads(LIST.read_text(encoding="utf-8"))["pictures"]
    made_by = versions()
    for picture in wanted:
        pixels, measured = _pixels(picture)
        write_bytes(FOLDER / picture.file, _coded(pixels, picture.file))
        kept[picture.name] = {
            "file": picture.file,
            "kind": picture.kind,
            "command": picture.command,
            "scene": picture.scene,
            "method": picture.method,
            "versions": {name: made_by[name] for name in ("airlight", "mitsuba", "drjit")},
            "made": datetime.now(UTC).date().isoformat(),
        } | measured
        write_text(
            LIST,
            json.dumps({"pictures": dict(sorted(kept.items()))}, indent=1, allow_nan=False) + "\n",
        )
        print(FOLDER / picture.file, flush=True)


def _pixels(picture: Picture) -> tuple[Pixels, dict[str, Any]]:
    """Return a picture and what was measured for it."""
    if picture.kind == "strip":
        parts = [_rendered(scene_picture(name), (360, 270)) for name in STRIP]
        gap = np.full((270, 6, 3), 255, np.uint8)
        return np.concatenate([part for each in parts for part in (each, gap)][:-1], axis=1), {}
    if picture.kind == "page":
        return _page(), {}
    if picture.kind == "scene":
        return _rendered(picture, SIZE), {}
    if picture.kind == "method":
        return _rendered(picture, SMALL), {}
    # The reference of an area light takes minutes: a third of the pixels along
    # each side, drawn larger.
    coarser = COARSER if read_scene(load_scene(picture.scene, (8, 6)).scene).area_lights else 1
    loaded, frame = _frame(picture, (SMALL[0] // coarser, SMALL[1] // coarser))
    reference = reference_image(loaded.scene).airlight
    error = error_metrics(reference, frame.airlight).relative_rmse
    colours = error_map(reference, np.asarray(frame.airlight, dtype=np.float64))
    chosen = configuration(picture.method, None, parse_settings(picture.settings))
    whole = read_scene(load_scene(picture.scene, SMALL).scene)
    milliseconds = time_frame(prepared(whole, chosen)).frame.median_ms
    picture_of = _with_scale(
        colours.repeat(coarser, axis=0).repeat(coarser, axis=1), error, milliseconds
    )
    return picture_of, {"relative_rmse": error, "frame_ms": milliseconds}


def _with_scale(colours: Pixels, error: float, milliseconds: float) -> Pixels:
    """Return an error map above the scale of its colours, its number and the time of a frame."""
    width = colours.shape[1]
    below = Image.new("RGB", (width, 46), "white")
    below.paste(Image.fromarray(error_scale()).resize((width // 2, 12)), (10, 6))
    write = ImageDraw.Draw(below)
    for place, words in (
        (0.0, "-100 %"),
        (0.25, "-1 %"),
        (0.5, "0.01 %"),
        (0.75, "+1 %"),
        (1.0, "+100 %"),
    ):
        write.text(
            (10 + place * width / 2, 22),
            words,
            fill="black",
            anchor="ma" if 0 < place < 1 else "la",
            font_size=11,
        )
    said = f"rel. RMSE {number(100 * error, 2)} %, {milliseconds:.0f} ms"
    write.text((width - 10, 12), said, fill="black", anchor="ra", font_size=14)
    return np.concatenate([colours, np.asarray(below)])


def _page() -> Pixels:
    """Return the first window of the page of a report, as a browser shows it."""
    read_report(REPORT)  # its page lies beside it
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise MissingError(
            "gallery: report-page is taken by playwright, which the extra `test` installs"
        ) from error
    chromium = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    if chromium is None:
        raise MissingError(
            "gallery: report-page is taken by Chromium; install Debian's package chromium"
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        window = browser.new_page(viewport={"width": 1300, "height": 1000}, color_scheme="light")
        window.goto((REPORT / "report.html").resolve().as_uri())
        window.wait_for_selector("html[data-drawn]", timeout=120_000, state="attached")
        # so that shafts are seen in a small picture
        window.locator("#viewer-0 input[type=range]").fill("2")
        window.wait_for_selector("#viewer-0[data-drawn$=' 2']")
        shot = window.screenshot()
        browser.close()
    return np.asarray(
        Image.open(io.BytesIO(shot)).convert("RGB").resize((1040, 800), Image.Resampling.LANCZOS)
    )


def _rendered(picture: Picture, size: tuple[int, int]) -> Pixels:
    _, frame = _frame(picture, size)
    total = np.asarray(frame.airlight + frame.surface, dtype=np.float64)
    return preview(total, tone_curve(total))


def _tutorial_scene() -> str:
    """Return the scene that stands in docs/scene-to-figure.md."""
    page = (DOCS / "scene-to-figure.md").read_text(encoding="utf-8")
    return page.partition("```xml\n")[2].partition("```")[0]


def _loaded(scene: str, size: tuple[int, int], changes: Sequence[str]) -> LoadedScene:
    if scene != TUTORIAL:
        return load_scene(scene, size, parse_changes(changes))
    with temporary_folder() as folder:
        path = folder / TUTORIAL
        path.write_text(_tutorial_scene(), encoding="utf-8")
        return load_scene(str(path), size)


def _frame(picture: Picture, size: tuple[int, int]):
    loaded = _loaded(picture.scene, size, picture.changes)
    chosen = configuration(picture.method, None, parse_settings(picture.settings))
    return loaded, render_samples(prepared(read_scene(loaded.scene), chosen), picture.samples)


def _coded(pixels: Pixels, name: str) -> bytes:
    """Return a picture as a file of at most `LARGEST` bytes."""
    image, buffer = Image.fromarray(pixels), io.BytesIO()
    if name.endswith(".png"):
        # No dithering: error maps are read by colour, and noise would not compress.
        for colours in (256, 128, 64, 32):
            buffer = io.BytesIO()
            image.quantize(colours, dither=Image.Dither.NONE).save(
                buffer, format="PNG", optimize=True
            )
            if buffer.tell() <= LARGEST:
                break
        return buffer.getvalue()
    for quality in (92, 88, 82, 75, 65, 50):
        buffer = io.BytesIO()
        image.save(buffer, format="JPEG", quality=quality, subsampling=0)
        if buffer.tell() <= LARGEST:
            break
    return buffer.getvalue()


if __name__ == "__main__":
    activate()
    make(chosen_pictures(sys.argv[1:]))
