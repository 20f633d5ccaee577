# SPDX-License-Identifier: BSD-3-Clause
"""Makes pictures of the gallery and keeps their list, `gallery.json`, schema "airlight-gallery/1".

The list has for each picture its file, command, scene and method; the revision of the accuracy baseline of the scene
with which it was made; for an error map the relative RMSE; and the versions and the day.
"""

import hashlib
import io
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from analytic.errors import InputError, nearest
from realtime.frame.samples import render_samples
from realtime.scene.read_scene import read_scene
from reference.storage.files import ensure_folder, temporary_folder, write_bytes, write_text
from reports.data.reader import read_report
from reports.docs.build import source_folder
from reports.docs.data import baseline_revision
from reports.gallery.recipes import (
    SIZE,
    SMALL,
    STRIP,
    TUTORIAL,
    Picture,
    pictures,
    scene_picture,
)
from reports.gallery.sketches import sketch
from reports.machine.environment import MissingError, versions
from reports.plotting.pictures import error_map, preview, tone_curve
from validation.configurations.methods import configuration, parse_settings, prepared
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import error_metrics
from validation.scenes.changes import parse_changes
from validation.scenes.loading import LoadedScene, load_scene
from validation.scenes.registry import SCENES

SCHEMA = "airlight-gallery/1"
LIST = "gallery.json"
REPORT = Path("airlight-report")  #: of which the picture of a page is
LARGEST = 150_000  #: bytes of a file
COARSER = 3  #: by which error maps of lights with extent are coarser

Pixels = np.ndarray[Any, np.dtype[np.uint8]]
Progress = Callable[[float, str], None]


def chosen_pictures(names: Iterable[str]) -> list[Picture]:
    """Return the pictures of those names, all for no name; a scene's or a method's name stands for all of its own.

    That of a report's page, which takes a browser and a report in `airlight-report`, is made only by its name.

    Raises
    ------
    InputError
        For a name that no picture has; the nearest is named.
    """
    known = list(pictures())
    chosen: dict[str, Picture] = {}
    for name in names:
        found = [p for p in known if p.name == name or (name in (p.scene, p.method) and name in p.name)]
        if not found:
            near = nearest(name, [picture.name for picture in known])
            raise InputError(f"gallery: got {name!r}, wanted the name of a picture, a scene or a method{near}")
        chosen |= {picture.name: picture for picture in found}
    return list(chosen.values()) or [picture for picture in known if picture.kind != "page"]


def make(wanted: list[Picture], folder: Path, progress: Progress) -> list[Path]:
    """Make pictures and bring their list up to date; return the files.

    Parameters
    ----------
    wanted
        From `chosen_pictures`.
    folder
        Where they go, with `gallery.json`.
    progress
        Called with the share done and the name of the next picture.
    """
    ensure_folder(folder)
    path = folder / LIST
    kept = json.loads(path.read_text(encoding="utf-8"))["pictures"] if path.exists() else {}
    files = []
    for number, picture in enumerate(wanted):
        progress(number / len(wanted), picture.name)
        pixels, measured = _pixels(picture)
        write_bytes(folder / picture.file, _coded(pixels, picture.file))
        files.append(folder / picture.file)
        kept[picture.name] = _entry(picture) | measured
        text = json.dumps({"schema": SCHEMA, "pictures": dict(sorted(kept.items()))}, indent=1, allow_nan=False)
        write_text(path, text + "\n")
    return [*files, path]


def _entry(picture: Picture) -> dict[str, Any]:
    scenes: Iterable[str] = STRIP if picture.kind == "strip" else (picture.scene,) if picture.scene in SCENES else ()
    if picture.kind == "page":
        scenes = [scene["name"] for scene in read_report(REPORT)["scenes"] if scene["name"] in SCENES]
    made_by = versions()
    return {
        "file": picture.file,
        "kind": picture.kind,
        "command": picture.command,
        "scene": picture.scene,
        "method": picture.method,
        "baselines": {name: baseline_revision(name) for name in scenes},
        "digest": tutorial_digest() if picture.scene == TUTORIAL else None,
        "versions": {name: made_by[name] for name in ("airlight", "mitsuba", "drjit")},
        "made": datetime.now(UTC).date().isoformat(),
    }


def _pixels(picture: Picture) -> tuple[Pixels, dict[str, Any]]:
    """Return a picture and what was measured for it."""
    if picture.kind == "strip":
        parts = [_rendered(scene_picture(name), (360, 270)) for name in STRIP]
        gap = np.full((270, 6, 3), 255, np.uint8)
        return np.concatenate([part for each in parts for part in (each, gap)][:-1], axis=1), {}
    if picture.kind == "page":
        return _page(), {}
    if picture.kind == "sketch":
        return sketch(picture.method, SIZE), {}
    if picture.kind == "scene":
        return _rendered(picture, SIZE), {}
    if picture.kind == "method":
        return _rendered(picture, SMALL), {}
    # The truth of a light with extent takes minutes: a third of the pixels along each side, drawn larger.
    coarser = COARSER if read_scene(load_scene(picture.scene, (8, 6)).scene).area_lights else 1
    loaded, frame = _frame(picture, (SMALL[0] // coarser, SMALL[1] // coarser))
    truth = truth_image(loaded.scene).airlight
    error = error_metrics(truth, frame.airlight).relative_rmse
    colours = error_map(truth, np.asarray(frame.airlight, dtype=np.float64))
    return colours.repeat(coarser, axis=0).repeat(coarser, axis=1), {"relative_rmse": error}


def _page() -> Pixels:
    """Return the first window of the page of a report, as a browser shows it.

    Raises
    ------
    InputError
        If there is no report.
    MissingError
        If there is no browser, or no program to drive it.
    """
    read_report(REPORT)  # its page lies beside it
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise MissingError("gallery: report-page is taken by playwright, which the extra `dev` installs") from error
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        raise MissingError("gallery: report-page is taken by Chromium; install Debian's package chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        window = browser.new_page(viewport={"width": 1300, "height": 1000}, color_scheme="light")
        window.goto((REPORT / "report.html").resolve().as_uri())
        window.wait_for_selector("html[data-drawn]", timeout=120_000, state="attached")
        shot = window.screenshot()
        browser.close()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB").resize((1040, 800), Image.Resampling.LANCZOS))


def _rendered(picture: Picture, size: tuple[int, int]) -> Pixels:
    _, frame = _frame(picture, size)
    total = np.asarray(frame.airlight + frame.surface, dtype=np.float64)
    return preview(total, tone_curve(total))


def tutorial_digest() -> str:
    """Return what tells one scene of the tutorial from another."""
    return hashlib.blake2b(_tutorial_scene().encode(), digest_size=8).hexdigest()


def _tutorial_scene() -> str:
    """Return the scene that stands in docs/tutorial.md; raises MissingError if this is no checkout."""
    page = (source_folder() / "tutorial.md").read_text(encoding="utf-8")
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
            image.quantize(colours, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
            if buffer.tell() <= LARGEST:
                break
        return buffer.getvalue()
    for quality in (92, 88, 82, 75, 65, 50):
        buffer = io.BytesIO()
        image.save(buffer, format="JPEG", quality=quality, subsampling=0)
        if buffer.tell() <= LARGEST:
            break
    return buffer.getvalue()
