# SPDX-License-Identifier: BSD-3-Clause
"""What a report is asked for: its scenes and the images from elsewhere, refused before the work if unusable."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from analytic.errors import InputError
from validation.scenes.loading import scene_stem
from validation.scenes.registry import SCENES

if TYPE_CHECKING:
    from validation.engine.images import EngineImage


def scenes_of_images(
    asked: Sequence[str] | None, images: str | os.PathLike[str] | None, usual: Sequence[str]
) -> tuple[list[str], dict[str, tuple["EngineImage", ...]]]:
    """Return the scenes to study and the images by scene, from a folder of images or None.

    Scenes are those `asked` for; for None those of the images, or the `usual` ones without images.
    """
    if asked is not None and not asked:
        raise InputError(f"scenes: got none, wanted some of {', '.join(SCENES)}, or the paths of Mitsuba XML files")
    if images is None:
        return list(usual if asked is None else asked), {}
    from validation.engine.images import find_images

    shown = find_images(images, {scene_stem(name): name for name in [*SCENES, *(asked or ())]})
    names = list(shown if asked is None else asked)
    wanted = {scene_stem(name) for name in names}
    if not wanted & set(shown):
        raise InputError(f"--images: {images} has no image of {', '.join(sorted(wanted))}, only of {', '.join(shown)}")
    return names, {name: several for name, several in shown.items() if name in wanted}
