# SPDX-License-Identifier: BSD-3-Clause
"""An entry judged: the error of each image, the number, and the content of score.json.

Two kinds of pixels are not judged. Where the ray through the centre passes within two pixel widths
of a lamp, the airlight grows as one over the distance, and one pixel would outweigh all others.
Where the surface jumps within 1/64 of a pixel about the centre, rays in single precision of two
programs, or of one program on two machines, may see different surfaces.
"""

from pathlib import Path

import numpy as np

from airlight.errors import InputError
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import reference_result
from airlight.reference.scene.camera import film_directions, pixel_centres
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.build import build
from airlight.reference.storage.files import temporary_folder
from airlight.reports.challenge.draw import DrawnScene, draw_scenes, load_drawn, scenes_digest
from airlight.reports.challenge.entry import (
    check_whole,
    images_digest,
    read_airlight,
    read_entry,
)
from airlight.reports.challenge.folder import check_scenes
from airlight.reports.challenge.number import (
    BLACK,
    FLOOR,
    rms,
    rounded,
    rounded_out,
    scene_error,
)
from airlight.reports.challenge.record import (
    SCHEMA,
    Digests,
    SceneScore,
    Score,
    combined_score,
)
from airlight.validation.arrays import Bools, Progress
from airlight.validation.properties.view import distance
from airlight.validation.scenes.loading import LoadedScene

_LAMP = 2.0  # pixel widths about a lamp that are not judged, as in comparisons with samples
_BESIDE = 1 / 64  # of a pixel: the rounding of rays in single precision is a hundredth of it
_JUMP = 1e-2  # of a distance: a surface that bends or leans changes it by less within 1/64 pixel


def score_entry(folder: Path, progress: Progress) -> Score:
    """Judge all images of an entry; needs an active Mitsuba variant.

    A scene that the method cannot have is a row of a black image.

    Raises InputError for an entry that lacks images, and for scenes that were changed.
    """
    found = read_entry(folder)
    scenes = draw_scenes(found.entry.seed)
    if found.challenge is not None:
        check_scenes(found.challenge, folder, scenes)
    names = [scene.name for scene in scenes]
    check_whole(found, names)
    # All files are read before the first reference is computed.
    images = {
        name: read_airlight(folder / f"{name}.exr") for name in names if name not in found.cannot
    }
    rows = []
    with temporary_folder() as place:
        for number, scene in enumerate(scenes):
            progress(number / len(scenes), scene.name)
            reference, judged = scene_reference(place, scene)
            values = reference.airlight[judged]
            stated = reference.airlight_error[judged]
            if not rms(stated) < rms(values):
                raise InputError(
                    f"seed {found.entry.seed}: the view of {scene.name} has no light beyond the error "
                    "of its reference, so that no error is relative to it; expected a seed without "
                    "such a scene: take another"
                )
            error, bias = BLACK, -1.0
            if scene.name in images:
                test = images[scene.name][judged]
                error = scene_error(values, stated, test)
                bias = float((test - values).mean() / values.mean())
            row = SceneScore(
                name=scene.name,
                kind=scene.kind,
                error=rounded(error.error),
                interval=rounded_out((error.low, error.high)),
                bias=rounded(bias),
                pixels=int(judged.sum()),
                seconds=found.times.get(scene.name),
                cannot=found.cannot.get(scene.name, ""),
            )
            rows.append(row)
    digest = scenes_digest(scenes)
    whole, kinds = combined_score(rows, digest)
    return Score(
        schema=SCHEMA,
        entry=found.entry,
        number=whole.number,
        interval=(whole.low, whole.high),
        kinds=kinds,
        floor=FLOOR,
        scenes=tuple(rows),
        digests=Digests(
            scenes=digest,
            images=images_digest(folder, names, found.cannot),
            airlight=build().airlight,
            commit=build().commit,
            program=build().digest,
        ),
    )


def scene_reference(folder: Path, scene: DrawnScene) -> tuple[ReferenceImage, Bools]:
    """Return the reference of a scene, from the cache where it was computed before, and the pixels
    that are judged; the files of the scene are written into a folder.
    """
    loaded = load_drawn(folder, scene)
    reference = reference_result(loaded.scene).value
    return reference, judged_pixels(loaded, reference)


def judged_pixels(loaded: LoadedScene, reference: ReferenceImage) -> Bools:
    """Return which pixels are judged, (height, width): see the module."""
    read = read_reference(loaded.scene)
    size, sensor = (read.width, read.height), loaded.scene.sensors()[0]
    centres = pixel_centres(size)
    # The angle between the rays of two pixels in the middle of the image, where it is largest.
    middle = np.array(size) / 2
    pair = film_directions(sensor, np.array([middle, middle + np.array([1.0, 0.0])]), size)
    width = float(np.linalg.norm(pair[1] - pair[0]))
    judged = reference.light_angle > _LAMP * width
    # Four rays about the centre, and the centre's own, meet one surface.
    shifts = _BESIDE * np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
    ends = np.stack(
        [
            distance(
                read.occluders,
                np.broadcast_to(read.origin, (len(centres), 3)),
                film_directions(sensor, centres + shift, size),
            )
            for shift in shifts
        ]
    )
    nearest, farthest = ends.min(axis=0), ends.max(axis=0)
    smooth = ~np.isfinite(nearest) | (farthest <= (1 + _JUMP) * nearest)
    return judged & smooth.reshape(judged.shape)
