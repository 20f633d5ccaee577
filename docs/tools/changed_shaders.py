# SPDX-License-Identifier: BSD-3-Clause
"""Changes in the shaders of PlayCanvas, and what the diagnosis says of each:
`docs/data/changed-shaders.json`.

`python docs/tools/changed_shaders.py` captures PlayCanvas with the two edits that make its fog
right (see docs/adapters/README.md), asks the comparison whether that is right, captures it again
with one thing changed in the shader, in its settings or in its scene, lets the diagnosis say what
is wrong, and writes the record. A text that an update of the engine has changed fails the capture. The exit
status is 1 where a change is not named first, or the base is not right.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "docs/data/changed-shaders.json"
SCHEMA = "airlight-changed-shaders/1"
ENGINE, SIZE = "playcanvas", (160, 120)

FOG, FALLOFF = "volumetricFogLocalPS", "falloffInvSquaredPS"  # shader chunks
_SOFTENED = "1.0 / (sqrDist + 1.0)"
_EYE_PATH = "exp(-volFogOpticalDepth(t, rayDir.y))"
_LIGHT_DEPTH = "uVolMarchParams.w * uVolFogParams.x * length(lightVec)"
#: The law and the light path of physics, by an edit each.
LAW = f"{FALLOFF}~{_SOFTENED}~1.0 / sqrDist"
LIGHT_PATH = f"{FOG}~{_EYE_PATH}~exp(-volFogOpticalDepth(t, rayDir.y) - {_LIGHT_DEPTH})"
BASE = (LAW, LIGHT_PATH)

#: Scenes in which the base is judged, with settings: the shadows of colonnade need a larger atlas.
SCENES: dict[str, tuple[str, ...]] = {
    "open-fog": (),
    "sphere-spot": (),
    "colonnade": ("shadowResolution=4096",),
}
_PLACE = ("camera.origin=0.78,-5.21,1.97", "camera.target=0.698267,-4.214343,1.925418")
#: Names that an image without a fault of light, medium or camera may have.
NO_FAULT = ("right", "unexplained")


@dataclass(frozen=True)
class Change:
    """One thing that is changed."""

    name: str
    words: str  #: what was done
    injected: str  #: the name that the diagnosis should give it; one of `NO_FAULT` for any of them
    edits: tuple[str, ...] = BASE  #: of shaders, the base among them
    settings: tuple[str, ...] = ()  #: of the engine
    changes: tuple[str, ...] = ()  #: of the scene that is captured
    scene: str = "sphere-spot"

    @property
    def names(self) -> tuple[str, ...]:
        """The names that are right."""
        return NO_FAULT if self.injected in NO_FAULT else (self.injected,)


def with_edit(old: str, new: str, chunk: str = FOG) -> tuple[str, ...]:
    """Return the edits of the base and another one."""
    return (*BASE, f"{chunk}~{old}~{new}")


CHANGES = (
    Change("no-light-path", "no way from the light", "light-path", (LAW,)),
    Change("softened-law", "1/(r^2 + 1) for 1/r^2", "distance-law", (LIGHT_PATH,)),
    Change("no-4-pi", "no 1/(4 pi) in the phase function", "factor", with_edit("12.56637", "1.0")),
    Change(
        "no-shadow",
        "no shadow in the fog",
        "no-shadow",
        with_edit("mix(1.0, volSampleShadow(pos, lightVec, spiral), uVolLightSpot.z)", "1.0"),
    ),
    Change(
        "g-sign",
        "the other sign of the cosine in the phase function",
        "g-sign",
        with_edit("2.0 * g * cosTheta", "2.0 * g * -cosTheta"),
        scene="colonnade",
    ),
    Change(
        "no-camera-path",
        "no way to the camera",
        "camera-path",
        (LAW, f"{FOG}~{_EYE_PATH}~exp(-{_LIGHT_DEPTH})"),
    ),
    Change(
        "density-2",
        "the density twice",
        "extinction",
        with_edit("uVolFogParams.x", "(2.0 * uVolFogParams.x)"),
    ),
    Change("range-6", "lamps with a range of 6 m", "light-range", settings=("range=6",)),
    Change(
        "green",
        "the green of the tint 0.7 times",
        "colour",
        with_edit("transmittance * uVolTint", "transmittance * uVolTint * vec3(1.0, 0.7, 1.0)"),
    ),
    Change("camera-moved", "the camera 21 cm off", "camera-position", changes=_PLACE),
    # Beyond the ten: changes of the same kinds, and two that are no fault of physics.
    Change(
        "camera-turned",
        "the camera turned by 4 degrees",
        "camera-direction",
        changes=("camera.target=0.60,-4.32,1.87",),
    ),
    Change(
        "one-over-r",
        "1/r for 1/r^2",
        "distance-law",
        (LIGHT_PATH, f"{FALLOFF}~{_SOFTENED}~inversesqrt(sqrDist)"),
    ),
    Change(
        "albedo-twice",
        "the tint, which is the albedo, twice",
        "albedo",
        with_edit("transmittance * uVolTint", "transmittance * uVolTint * uVolTint"),
    ),
    Change(
        "range-cut",
        "lamps that end at 4 m without a window",
        "light-range",
        with_edit("if (atten > 0.00001)", "if (length(lightVec) < 4.0)"),
    ),
    Change("half-size", "fog at half the resolution", "unexplained", settings=("scale=0.5",)),
    Change("few-steps", "3 steps", "right", settings=("localSteps=3",)),
)


def captured(change: Change, folder: Path) -> tuple[Path, Any]:
    """Return the file of a capture, and what the engine said of it."""
    import airlight

    path = folder / f"{change.name}.exr"
    told = airlight.capture(
        ENGINE,
        change.scene,
        output=path,
        size=SIZE,
        edit=change.edits,
        change=change.changes,
        settings=(*SCENES[change.scene], *change.settings),
    )
    return path, told


def judged(scene: str, folder: Path) -> dict[str, Any]:
    """Return a row on the base in a scene: whether it is right."""
    import airlight

    path, told = captured(Change(f"base-{scene}", "", "right", scene=scene), folder)
    compared = airlight.compare(scene, path, layer="airlight", pixel=told.pixel).compared
    verdict = compared.verdict
    return {
        "scene": scene,
        "settings": list(SCENES[scene]),
        "blocks": verdict.block_error,
        "right": verdict.right,
        "verdict": verdict.words,
        "engine": [told.engine, told.version, told.device],
    }


def diagnosed(change: Change, folder: Path) -> dict[str, Any]:
    """Return a row on a change: what the diagnosis said of it."""
    import airlight

    path, told = captured(change, folder)
    (said,) = airlight.compare(change.scene, path, layer="airlight", diagnose=True).diagnoses
    return {
        "name": change.name,
        "scene": change.scene,
        "words": change.words,
        "edits": [edit for edit in change.edits if edit not in BASE],
        "without": [edit for edit in BASE if edit not in change.edits],
        "settings": list(change.settings),
        "changes": list(change.changes),
        "injected": change.injected,
        "first": said.first,
        "right": said.first in change.names,
        "says": said.ranked[0].words if said.first != "unexplained" else said.lines[1],
        "headline": said.lines[1],
        "together": list(said.ranked[0].together),
        "residual": said.residual,
        "left": said.left,
        "rest": said.rest or said.place,
        "engine": [told.engine, told.version, told.device],
    }


def rows_of(
    changes: Sequence[Change], folder: Path, scenes: Sequence[str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield rows, each with the part of the record that it is in: the base, then changes."""
    for scene in scenes:
        yield "base", judged(scene, folder)
    for change in changes:
        yield "changes", diagnosed(change, folder)


def main() -> None:
    """Capture, judge and diagnose, and write the record."""
    from airlight.reports.machine.environment import activate

    names = [change.name for change in CHANGES]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only",
        nargs="*",
        metavar="NAME",
        choices=names,
        help=f"of {', '.join(names)}; others, and the base, keep their rows",
    )
    parser.add_argument("--out", type=Path, default=RECORD, help="the record")
    parser.add_argument("--images", type=Path, help="a folder that keeps the images")
    chosen = parser.parse_args()
    activate()
    from airlight.reference.storage.files import write_text

    old = json.loads(chosen.out.read_text(encoding="utf-8")) if chosen.out.exists() else {}
    kept: dict[str, dict[str, Any]] = {
        "base": {row["scene"]: row for row in old.get("base", ())},
        "changes": {row["name"]: row for row in old.get("changes", ())},
    }
    changes = [change for change in CHANGES if not chosen.only or change.name in chosen.only]
    made: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = chosen.images or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for part, row in rows_of(changes, folder, () if chosen.only else tuple(SCENES)):
            engine, version, device = row.pop("engine")
            kept[part][row["scene"] if part == "base" else row["name"]] = row
            made.append(row)
            print(json.dumps(row), flush=True)
            record = {
                "schema": SCHEMA,
                "measured": f"{datetime.now(UTC):%Y-%m-%d}",
                "engine": engine,
                "version": version,
                "device": device,
                "size": list(SIZE),
                "base": [kept["base"][each] for each in SCENES if each in kept["base"]],
                "changes": [kept["changes"][each] for each in names if each in kept["changes"]],
            }
            write_text(chosen.out, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    right = sum(row["right"] for row in made)
    print(f"{right} of {len(made)} are called what they are")
    sys.exit(0 if right == len(made) else 1)


if __name__ == "__main__":
    main()
