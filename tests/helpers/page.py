# SPDX-License-Identifier: BSD-3-Clause
"""A small report by hand, with its EXR files, and its page as a reader of HTML sees it."""

import copy
import json
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture

from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.data.records import Report, named_files
from tests.helpers.reports import (
    agreement,
    checked,
    engine,
    entry,
    errors,
    flip,
    report_of,
    scene,
    settings,
)

WIDTH, HEIGHT = 32, 24
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """The page as a reader of HTML sees it; every tag must be closed in order."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.source = text
        self.open, self.tags, self.words, self.scripts = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append((dict(attrs), []))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "script" in self.open:
            self.scripts[-1][1].append(data)
        elif not {"style", "svg"} & set(self.open):
            self.words.append(data)

    def addresses(self):
        """Addresses in tags: pairs of tag and address."""
        names = ("src", "href", "xlink:href", "data", "poster", "srcset", "action")
        found = ((tag, attributes.get(name)) for tag, attributes in self.tags for name in names)
        return [(tag, address) for tag, address in found if address is not None]

    def attributes(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]

    def script(self, name):
        """The content of the script element with an id."""
        (script,) = (
            "".join(parts) for attributes, parts in self.scripts if attributes.get("id") == name
        )
        return script

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def method(label, **changes):
    files = {"picture": "s/good.png", "error": "s/good-error.png", "exr": "s/good.exr"}
    error = errors(0.0123, relative_bias=-0.0045, p50=0.0011, p99=0.0555)
    return entry(label, 0.0123, 3.21, error=error, flip=flip(0.0321), files=files) | changes


AGREEMENT = agreement(margin=0.005, detectable=0.0021, relative_bias_ci=[-0.0011, 0.0014])
_FLAT = {"picture": "s/flat.png", "error": "s/flat-error.png", "exr": "s/flat.exr"}
_REFERENCE = {"mean": 0.98765, "relative_error": 1.2e-6, "transitions": 4321, "missed": 0.0007}
_REFERENCE |= {"checked": 98765, "disagreements": 12, "refined": 11, "left": 1}
_HALL = scene(
    "hall",
    [method("good (k)"), method("flat", knows_shadows=False, files=_FLAT)],
    purpose="A hall.",
    published="Billeter 2010",
    size=[WIDTH, HEIGHT],
    plan={"shadows": "visibility tests", "medium": "unbounded"},
    reference=_REFERENCE,
    agreement={"airlight": AGREEMENT, "surface": AGREEMENT | {"layer": "surface"}},
    exposure=2.5,
    files={
        "picture": "s/reference.png",
        "exr": "s/reference.exr",
        "airlight": "s/reference-airlight.png",
    },
)
DATA: dict[str, Any] = report_of(
    [_HALL],
    created="2026-11-21 12:34:56 +0000",
    command="airlight report --quick",
    seconds=12.3,
    computed=9,
    settings=settings(sizes=[[WIDTH, HEIGHT]], measure={"timed_size": [64, 48]}),
    claims=[
        {"kind": "reference", "text": "The reference is confirmed.", "good": True},
        {"kind": "left-out", "text": "Every method here scatters once.", "good": None},
    ],
)


def images() -> dict[str, dict[str, np.ndarray]]:
    """The layers of the files: `good` is wrong by 3e-6, `flat` by some per cent with one
    pixel that is no number.
    """
    rng = np.random.default_rng(11)
    across, down = np.meshgrid(np.linspace(0.1, 2, WIDTH), np.linspace(0.2, 1, HEIGHT))
    airlight = (across * down)[..., None] * np.array([1.0, 0.8, 0.5])
    airlight[:2] = 0  # no light there
    surface = np.where(across < 1, 0.3, 0.0)[..., None] * np.ones(3)
    good = airlight * (1 + 3e-6 * rng.standard_normal(airlight.shape))
    flat = airlight * (1 + 0.3 * np.sin(3 * across))[..., None]
    flat[5, 7, 1] = np.nan
    flip = np.clip(0.5 * across[..., None] * np.ones(3), 0, 1)
    return {
        "reference": {"airlight": airlight, "surface": surface},
        "good": {"airlight": good, "surface": surface},
        "flat": {"airlight": flat, "surface": 1.01 * surface, "flip": flip},
        "engine": {"total": 0.9 * (airlight + surface)},
    }


def write_files(folder: Path) -> Path:
    """Write the EXR files that `DATA` names, and one of an engine's image."""
    (folder / "s").mkdir(parents=True, exist_ok=True)
    for name, layers in images().items():
        write_exr(folder / "s" / f"{name}.exr", Image(layers), finite=False)
    return folder


def write_report_files(folder: Path) -> Path:
    """Write a whole report except for its page; pictures are of a few pixels."""
    write_files(folder)
    for name in named_files(small_report()):
        if not (folder / name).exists():
            Picture.new("RGB", (6, 4)).save(folder / name, "PNG")
    (folder / "report.json").write_text(json.dumps(DATA), encoding="utf-8")
    return folder


def report_data() -> dict[str, Any]:
    """Return a copy of `DATA` that a test may change."""
    return copy.deepcopy(DATA)


def small_report() -> Report:
    """Return the record of `DATA`."""
    return checked(DATA)


def engine_image() -> dict[str, Any]:
    """The entry of an engine's image: judged by its total, without times."""
    return engine("engine", 0.0123, method="engine", files={"exr": "s/engine.exr"})
