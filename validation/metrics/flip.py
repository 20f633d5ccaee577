# SPDX-License-Identifier: BSD-3-Clause
r"""HDR-FLIP: how much two images differ to somebody who flips between them (Andersson et al. 2021).

FLIP is NVIDIA's own code, the package `flip-evaluator`. It can end the process that calls it and it
accepts what it has no answer for, so it runs in a child process with a time limit, and what it
would get wrong is stopped before:

    NaN, infinities, negative values   no FLIP, a note: it takes them in silence
    a black reference                  no FLIP, a note: it ends the process that asks
    one channel                        three equal ones: it takes one against three and returns some number

A missing package, a crash, a time-out or nonsense for an answer is a note too. FLIP is a number
beside others, never a reason to call a comparison failed.

**Exposures.** HDR-FLIP tone-maps both images at several exposures and takes the worst of each
pixel. The range comes from the reference alone, so that all tests against it are judged alike, and
is passed on explicitly: from where its brightest luminance is shown as 0.85, up to where its median
is, with the ACES curve (the rule of section 3.2 of the paper; the median is of the positive values,
for half of an image may lie in the dark). The curve is

    tone(x) = (0.9036 x^2 + 0.018 x) / (0.8748 x^2 + 0.354 x + 0.14),    tone(x) = 0.85 is a quadratic equation in x.

The number depends a little on the operating system (the project's note on precision):
compare it to 1e-5, no closer.
"""

import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.errors import InputError
from airlight.reference.storage.files import temporary_folder
from airlight.validation.arrays import Array
from airlight.validation.columns import column
from airlight.validation.metrics.errors import colours, compared

PIXELS_PER_DEGREE = 67.0  #: of visual angle: a screen of 3840 pixels, 0.7 m wide, seen from 0.7 m
TIMEOUT = 300.0  #: seconds that the child may take; a megapixel takes a few
#: tone-mapped value of the brightest and of the median luminance at the ends of the range
SHOWN = 0.85

# of the numerator x^2, x; of the denominator x^2, x, 1
_ACES = ((0.9036, 0.018), (0.8748, 0.354, 0.14))
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

# The last line tells apart a child that finished from one that something in it ended with status 0.
_CHILD = """
import sys, numpy
try:
    import flip_evaluator
except ImportError as error:
    sys.exit(f"missing: {error}")
inputs = numpy.load(sys.argv[1])
parameters = {"ppd": float(inputs["ppd"]), "tonemapper": "aces", "numExposures": int(inputs["count"]),
              "startExposure": float(inputs["start"]), "stopExposure": float(inputs["stop"])}
error_map, _, _ = flip_evaluator.evaluate(inputs["reference"], inputs["test"], "HDR", applyMagma=False,
                                          computeMeanError=False, parameters=parameters)
numpy.save(sys.argv[2], error_map)
print("finished")
"""


@dataclass(frozen=True)
class Flip:
    """HDR-FLIP of two images, or why there is none."""

    value: float | None = column(
        "HDR-FLIP", "1", "mean over the pixels compared: 0 for equal images, at most 1"
    )
    note: str = column("note", "", "why there is no answer; empty with one", default="")
    start_exposure: float | None = column("first exposure", "stops", "of the range", default=None)
    stop_exposure: float | None = column("last exposure", "stops", "of the range", default=None)
    exposures: int | None = column("exposures", "1", "how many", default=None)
    pixels_per_degree: float | None = column(
        "pixels per degree", "1/degree", "of visual angle", default=None
    )


def flip_hdr(
    reference: ArrayLike, test: ArrayLike, *, mask: ArrayLike | None = None
) -> tuple[Flip, NDArray[np.float32] | None]:
    """Return HDR-FLIP of two images, through `flip-evaluator` in a child process (see
    the module), and its map.

    The map has the error of every pixel, (height, width); None where there is no answer.

    Radiances [W/(m^2 sr)] are (height, width) or (height, width, 1) for grey, or (height, width, 3)
    in linear sRGB. Pixels that the mask leaves out, (height, width), show the reference in both
    images, black where that cannot be shown, so that they add nothing to their neighbours either.
    """
    ref, tst, chosen = compared(reference, test, mask)
    ref, tst = colours(ref), colours(tst)
    note = _unanswerable(ref[chosen], tst[chosen])
    if note:
        return Flip(None, note), None
    drawable = np.where(np.isfinite(ref) & (ref >= 0), ref, 0)
    ref, tst = (np.where(chosen[..., None], image, drawable) for image in (ref, tst))
    # A power of two brings any unit into the range of float32; exposures are
    # then counted from there.
    shift = int(np.frexp(float(ref[chosen].max()))[1])
    with np.errstate(over="ignore"):
        scaled_reference, scaled_test = (
            np.ldexp(image, -shift).astype(np.float32) for image in (ref, tst)
        )
    if not np.isfinite(scaled_test).all():
        return Flip(
            None, "the test image is brighter than the reference by more than float32 holds"
        ), None
    start, stop = exposure_range(scaled_reference[chosen])
    # For a single exposure it returns 0.
    count = max(2, int(np.ceil(stop - start)))
    answer = _in_child(
        start=start,
        stop=stop,
        count=count,
        ppd=PIXELS_PER_DEGREE,
        reference=scaled_reference,
        test=scaled_test,
    )
    if isinstance(answer, str):
        return Flip(None, answer), None
    if answer.shape[:2] != chosen.shape or not ((answer >= 0) & (answer <= 1)).all():
        return Flip(None, "flip-evaluator returned no map of errors between 0 and 1"), None
    error_map = answer.reshape(chosen.shape)
    mean = float(error_map[chosen].mean(dtype=np.float64))
    return Flip(mean, "", start - shift, stop - shift, count, PIXELS_PER_DEGREE), error_map


def exposure_range(reference: ArrayLike) -> tuple[float, float]:
    """Return the first and the last exposure [stops] of HDR-FLIP for a reference
    (..., 3) that is not black.
    """
    luminance = np.asarray(reference, dtype=np.float64) @ _LUMINANCE
    luminance = luminance[luminance > 0]
    if not luminance.size:
        raise InputError(
            "a black reference has no range of exposures; give an image with some light in it"
        )
    (a2, a1), (b2, b1, b0) = _ACES
    # (a2 - s b2) x^2 + (a1 - s b1) x - s b0 = 0, whose other root is negative.
    shown = float(np.roots([a2 - SHOWN * b2, a1 - SHOWN * b1, -SHOWN * b0]).max())
    start, stop = (
        float(np.log2(shown / level)) for level in (luminance.max(), np.median(luminance))
    )
    return start, stop


def _unanswerable(ref: Array, tst: Array) -> str:
    """Say why FLIP has no answer for these pixels; empty if it has one."""
    for name, pixels in (("reference", ref), ("test image", tst)):
        for what, wrong in (("NaN or infinite", ~np.isfinite(pixels)), ("negative", pixels < 0)):
            count = int(wrong.any(axis=-1).sum())
            if count:
                return f"{count} pixels of the {name} are {what}: FLIP is not defined for them; mask them"
    return "" if ref.max() > 0 else "the reference is black: HDR-FLIP has no exposure for it"


def _in_child(**inputs: Any) -> NDArray[np.float32] | str:
    """Run FLIP in a separate process; return its map, or the reason why there is none.

    `inputs`: numbers and images, (height, width, 3), by the names that the process reads.
    """
    with temporary_folder() as folder:
        input_file, map_file = folder / "inputs.npz", folder / "map.npy"
        np.savez(input_file, **inputs)
        try:
            # -P: a file of that name in the current folder is not the package.
            ran = subprocess.run(
                [sys.executable, "-P", "-c", _CHILD, str(input_file), str(map_file)],
                capture_output=True,
                text=True,
                errors="replace",
                stdin=subprocess.DEVNULL,
                timeout=TIMEOUT,
            )
        except subprocess.TimeoutExpired:
            return f"flip-evaluator did not answer within {TIMEOUT:g} s and was ended"
        except OSError as error:
            return f"no process for flip-evaluator could be started: {error}"
        # The last line says why it ended; the map is in a file.
        said = (ran.stderr.strip() or ran.stdout.strip()).splitlines()
        last = said[-1] if said else "it said nothing"
        if ran.returncode == 1 and last.startswith("missing: "):
            return f"flip-evaluator is not installed ({last.removeprefix('missing: ')}); pip install flip-evaluator"
        if ran.returncode or not ran.stdout.strip().endswith("finished"):
            return f"flip-evaluator died with exit status {ran.returncode}: {last}"
        try:
            return np.load(map_file, allow_pickle=False)
        except (OSError, ValueError) as error:
            return f"flip-evaluator left no map that can be read: {error}"
