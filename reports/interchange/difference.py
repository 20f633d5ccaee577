# SPDX-License-Identifier: BSD-3-Clause
"""The difference of two images as an image: values in an EXR file, false colours in a PNG file."""

from pathlib import Path
from typing import Any

ENDINGS = (".exr", ".png")


def check_difference(option: str, path: Path) -> None:
    """Refuse a file that cannot be written, before any work.

    Raises
    ------
    InputError
        If the name has another ending than `ENDINGS`, or the file cannot be written.
    """
    from analytic.errors import InputError
    from reference.storage.files import ensure_writable

    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{option}: got {str(path)!r}, wanted a name that ends in .exr (values) or .png (a picture)")
    ensure_writable(path)


def write_difference(path: Path, reference: Any, test: Any, *, kept: Any = None) -> str:
    """Write how a test image differs from a reference, whole or not at all; return in words what the file shows.

    Parameters
    ----------
    path
        Ends in .exr: test - reference [W/(m^2 sr)] in R, G, B, and (test - reference) / max(reference, 0.001
        mean(reference)) in the layer `relative`. Ends in .png: the latter in the false colours of a report,
        `reports.plotting.pictures.error_map`.
    reference, test
        Radiance [W/(m^2 sr)], (height, width, 3).
    kept
        Pixels to show, truth values (height, width); all by default. The others, and in EXR files also those that are
        not finite, have no difference.
    """
    import numpy as np

    reference, test = (np.asarray(values, dtype=np.float64) for values in (reference, test))
    if kept is not None:
        test = np.where(np.asarray(kept)[..., None], test, reference)
    if path.suffix.lower() == ".png":
        from reports.plotting.pictures import ERROR_CEILING, ERROR_FLOOR, error_map, write_png

        write_png(path, error_map(reference, test))
        return (
            f"signed relative error, blue too dark, red too bright, from {ERROR_FLOOR:g} (white) to {ERROR_CEILING:g}"
        )
    from reference.storage.exr import Image, write_exr
    from validation.metrics.errors import FLOOR

    finite = np.isfinite(reference) & np.isfinite(test)
    difference = np.subtract(test, reference, out=np.zeros_like(test), where=finite)
    seen = finite if kept is None else finite & np.asarray(kept)[..., None]
    mean = float(reference[seen].mean()) if seen.any() else 0.0
    floor = np.maximum(np.where(finite, reference, 0), FLOOR * mean)
    relative = np.divide(difference, floor, out=np.zeros_like(test), where=floor > 0)
    left_out = int((~finite.all(axis=-1)).sum())
    attributes: dict[str, str | int | float] = {
        "airlight:difference": "test - reference",
        "airlight:not_finite": left_out,
    }
    write_exr(path, Image({"total": difference, "relative": relative}, attributes=attributes))
    return "test - reference in R, G, B, over the reference in the layer relative"
