# SPDX-License-Identifier: BSD-3-Clause
"""How often a diagnosis names a fault of a right image, and misses one of a
faulty image: its two limits.

`python docs/tools/calibrate_diagnosis.py` makes right images with the errors that engines have
(noise, denoised noise, half resolution, froxels, small floats, few steps, history) and images with
a fault of the catalogue under the same errors, lets the diagnosis search in each, and counts false
names and misses for limits of the evidence and of the fraction of the error that an explanation
leaves. From the scenes of `CALIBRATED` it chooses the limits and writes
`validation/engine/calibration.json`, which the diagnosis reads; from those of `MEASURED`, other
scenes and seeds, come the figures that count. Both are in `docs/data/diagnosis-calibration.json`,
and docs/diagnosed-engines.md has its table.
"""

import argparse
import json
import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
LIMITS = ROOT / "validation/engine/calibration.json"
RECORD = ROOT / "docs/data/diagnosis-calibration.json"
CALIBRATED = ("sphere-spot",)
MEASURED = ("open-fog", str(ROOT / "docs/examples/lobe-fog.xml"))
_SIZE = (48, 36)
_EVIDENCES = (10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0, 200.0)
_LEFTS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
# of the right images: a name that is wrong costs a user more than one that is missing
_FALSE = 0.05
# mean relative change of an image by a fault that is injected: what the comparison sees
_LEAST = 0.02


def _noise(size: tuple[int, int], rng: np.random.Generator) -> Array:
    return rng.standard_normal((size[1], size[0], 1))


def _white(fog: Array, surface: Array, size: tuple[int, int], rng: np.random.Generator) -> Array:
    return (fog + surface) * (1 + 0.05 * _noise(size, rng))


def _denoised(fog: Array, surface: Array, size: tuple[int, int], rng: np.random.Generator) -> Array:
    smooth = gaussian_filter(_noise(size, rng), (2, 2, 0))
    return (fog + surface) * (1 + 0.04 * smooth / smooth.std())


def _half(fog: Array, surface: Array, size: tuple[int, int], rng: np.random.Generator) -> Array:
    """Fog of every second pixel and row, enlarged linearly: it lies half a pixel off, as
    where engines do no better.
    """
    return (
        np.maximum(zoom(fog[::2, ::2], (2, 2, 1), order=1, grid_mode=True, mode="nearest"), 0)
        + surface
    )


def _froxels(fog: Array, surface: Array, size: tuple[int, int], rng: np.random.Generator) -> Array:
    """Fog in columns of 4 x 4 pixels, enlarged linearly."""
    coarse = fog.reshape(size[1] // 4, 4, size[0] // 4, 4, 3).mean(axis=(1, 3))
    return np.maximum(zoom(coarse, (4, 4, 1), order=1, grid_mode=True, mode="nearest"), 0) + surface


def _small_floats(
    fog: Array, surface: Array, size: tuple[int, int], rng: np.random.Generator
) -> Array:
    """Floats of 11, 11 and 10 bits, rounded down."""
    mantissa, exponent = np.frexp(fog)
    steps = np.array([128.0, 128.0, 64.0])
    return np.ldexp(np.floor(mantissa * steps) / steps, exponent) + surface


def _history(fog: Array, surface: Array, size: tuple[int, int], rng: np.random.Generator) -> Array:
    """Noise of the fog averaged over frames whose pixels move a little: a blur,
    and a tenth of the noise.
    """
    return gaussian_filter(fog, (0.7, 0.7, 0)) * (1 + 0.03 * _noise(size, rng)) + surface


#: By error of an engine, the names that are true of an image with it.
TRUE = {"half resolution": ("shift", "fog-shift")}
#: Errors of engines, in right and in faulty images; the march of few steps is one of
#: the scene, see `_images`.
ERRORS: dict[str, Callable[[Array, Array, tuple[int, int], np.random.Generator], Array]] = {
    "white noise": _white,
    "denoised noise": _denoised,
    "half resolution": _half,
    "froxels": _froxels,
    "small floats": _small_floats,
    "history": _history,
}
MARCH = "march of few steps"


def _marched(scene: str, steps: int) -> Array:
    """Return the airlight of a march of equal steps."""
    import airlight

    frame = airlight.render(scene, "ray-march", size=_SIZE, steps=steps)
    return np.asarray(frame.airlight, dtype=float)


def _apart(image: Array, right: Array) -> float:
    """Return the mean relative difference of two images."""
    return float(
        np.mean(np.abs(image - right) / np.maximum(np.maximum(image, right), 1e-2 * right.mean()))
    )


def _images(scene: str, seed: int) -> list[dict[str, Any]]:
    """Return images of a scene, right ones and one with a fault for each of these:
    rows without a diagnosis.
    """
    from airlight.reference.scene.read import read_reference
    from airlight.reference.storage.exr import Image
    from airlight.validation.engine.faults import FAULTS
    from airlight.validation.engine.observation import JudgedLayer, observation_of
    from airlight.validation.engine.prediction import Guess, Predictor, SceneLight
    from airlight.validation.engine.search import starts_of
    from airlight.validation.engine.traits import traits
    from airlight.validation.scenes.loading import load_scene

    rng = np.random.default_rng(seed)
    loaded = load_scene(scene, _SIZE)
    light = SceneLight(read_reference(loaded.scene))
    shape = (_SIZE[1], _SIZE[0], 3)
    blank = Image({"total": np.ones(shape)})
    observation, _ = observation_of(
        blank, JudgedLayer("total", "total", blank.layers["total"]), loaded.scene
    )

    def shown(guess: Any, values: Array | None = None) -> tuple[Predictor, Array, Array]:
        predictor = Predictor(
            replace(observation, values=observation.values if values is None else values), light
        )
        fog, surface = predictor.layers(guess)
        return predictor, fog.reshape(shape), surface.reshape(shape)

    plain = Guess(Predictor(observation, light).fog)
    predictor, fog, surface = shown(plain)
    right = fog + surface
    predictor, _, _ = shown(plain, right.reshape(-1, 3))
    there = traits(predictor)
    possible = [
        fault
        for fault in FAULTS
        if all(there[need] for need in fault.needs) and fault.kind != "layers"
    ]
    rows = []
    for error, make in (*ERRORS.items(), (MARCH, None)):
        march = _marched(scene, 16) / np.maximum(fog, 1e-30) if make is None else np.ones(shape)
        for _ in range(2):
            values = make(fog, surface, _SIZE, rng) if make else fog * march + surface
            rows.append(
                {
                    "scene": scene,
                    "error": error,
                    "fault": "right",
                    "words": "nothing",
                    "image": values,
                }
            )
            if make in (_half, _froxels, _small_floats) or make is None:
                break  # no random numbers
        own = _apart(rows[-1]["image"], right)
        for _ in range(2):
            while True:
                fault = possible[rng.integers(len(possible))]
                starts = [tuple(start) for start in starts_of(predictor, [fault])]
                start = starts[rng.integers(len(starts))]
                start = tuple(
                    min(max(value * math.exp(rng.uniform(-0.2, 0.2)), number.low), number.high)
                    for value, number in zip(start, fault.parameters, strict=True)
                )
                guess = fault.change(predictor, plain, start)
                _, faulty_fog, faulty_surface = shown(guess)
                whole = faulty_fog + faulty_surface
                changed = guess.undo(whole) if guess.undo else whole
                for change in guess.values:
                    changed = change(changed.reshape(-1, 3)).reshape(shape)
                # A fault that does less than the engine's own errors is not looked for.
                if _apart(changed, right) > max(_LEAST, own):
                    break
            values = (
                make(faulty_fog, faulty_surface, _SIZE, rng)
                if make
                else faulty_fog * march + faulty_surface
            )
            values = guess.undo(values) if guess.undo else values
            for change in guess.values:
                values = change(values.reshape(-1, 3)).reshape(shape)
            words = fault.sentence(start)
            rows.append(
                {
                    "scene": scene,
                    "error": error,
                    "fault": fault.name,
                    "words": words,
                    "image": values,
                }
            )
    return [row | {"light": light, "loaded": loaded} for row in rows]


def _diagnosed(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with what the diagnosis found, whatever the limits are."""
    from airlight.reference.storage.exr import Image
    from airlight.validation.engine.diagnose import diagnose_image

    image = Image(
        {"total": row["image"]},
        attributes={"airlight:pixel": "centre", "airlight:scene": row["scene"]},
    )
    said = diagnose_image(image, row["loaded"], layer="total", pixel="centre", light=row["light"])
    top = said.ranked[0] if said.ranked else None
    return {
        "scene": Path(row["scene"]).stem,
        **{key: row[key] for key in ("error", "fault", "words")},
        "found": top.name if top else said.first,
        "says": top.words if top else "",
        "together": list(top.together) if top else [],
        "evidence": top.evidence if top else 0.0,
        "residual": said.residual,
        "left": said.left,
        "rest": said.rest,
        "place": said.place,
    }


def named(row: dict[str, Any], evidence: float, left: float) -> bool:
    """Return whether a fault is named within limits, as `validation.engine.diagnose` does."""
    if row["found"] in ("right", "black", "unexplained"):
        return False
    return bool(
        row["evidence"] > evidence and (row["rest"] or row["left"] < left * row["residual"])
    )


def counts(rows: list[dict[str, Any]], evidence: float, left: float) -> dict[str, int]:
    """Return how many right images have a name, how many faults are named first, and
    how many there are of both.
    """
    right = [row for row in rows if row["fault"] == "right"]
    faulty = [row for row in rows if row["fault"] != "right"]
    return {
        "false": sum(
            named(row, evidence, left) and row["found"] not in TRUE.get(row["error"], ())
            for row in right
        ),
        "right": len(right),
        "found": sum(named(row, evidence, left) and _is_found(row) for row in faulty),
        "faulty": len(faulty),
    }


def _is_found(row: dict[str, Any]) -> bool:
    """Return whether the fault is named first, or together with a name
    that is true of the errors.
    """
    true = row["found"] in TRUE.get(row["error"], ()) and row["fault"] in row["together"]
    return bool(row["found"] == row["fault"] or true)


def chosen_limits(rows: list[dict[str, Any]]) -> tuple[float, float]:
    """Return the limits that name most faults, of those that name few right images.

    Equals are decided by the least fraction that may be left, and by the middle of the evidences:
    it is farthest from both errors.
    """
    table = [
        (counts(rows, evidence, left), evidence, left) for evidence in _EVIDENCES for left in _LEFTS
    ]
    few = [each for each in table if each[0]["false"] <= _FALSE * each[0]["right"]] or table
    most = max((count["found"], -count["false"]) for count, *_ in few)
    equal = [
        (left, evidence)
        for count, evidence, left in few
        if (count["found"], -count["false"]) == most
    ]
    left = min(equal)[0]
    evidences = sorted(evidence for each, evidence in equal if each == left)
    return evidences[len(evidences) // 2], left


def main() -> None:
    """Make the images, diagnose them, and write the limits and the record."""
    from airlight.reports.machine.environment import activate

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only", choices=("calibrated", "measured"), help="these images; others keep their rows"
    )
    parser.add_argument(
        "--limits",
        action="store_true",
        help="choose the limits again, from the rows that there are",
    )
    chosen = parser.parse_args()
    activate()
    from airlight.reference.storage.files import write_text

    record = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    rows = record.setdefault("rows", {"calibrated": [], "measured": []})
    for name, scenes, seed in (("calibrated", CALIBRATED, 1), ("measured", MEASURED, 1000)):
        if chosen.limits or chosen.only not in (None, name):
            continue
        rows[name] = []
        for number, scene in enumerate(scenes):
            for row in _images(scene, seed + number):
                rows[name].append(_diagnosed(row))
                print(json.dumps(rows[name][-1]), flush=True)
                write_text(RECORD, json.dumps(record, indent=1) + "\n")
    evidence, left = chosen_limits(rows["calibrated"])
    limits = {
        "command": "python docs/tools/calibrate_diagnosis.py",
        "evidence": evidence,
        "left": left,
    }
    by_error, by_limit = {}, {}
    for name, of_set in rows.items():
        by_error[name] = {
            error: counts([row for row in of_set if row["error"] == error], evidence, left)
            for error in (*ERRORS, MARCH)
        } | {"all": counts(of_set, evidence, left)}
        by_limit[name] = {f"{limit:g}": counts(of_set, limit, left) for limit in _EVIDENCES}
        print(f"{name}, evidence {evidence:g}, left {left:g}: {by_error[name]['all']}")
    record |= limits | {"measured": f"{datetime.now(UTC):%Y-%m-%d}", "size": _SIZE}
    record |= {"by_error": by_error, "by_limit": by_limit}
    write_text(RECORD, json.dumps(record, indent=1) + "\n")
    write_text(LIMITS, json.dumps(limits, indent=1) + "\n")


if __name__ == "__main__":
    main()
