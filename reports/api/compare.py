# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.compare`: how far an image is from another or from a scene, what is wrong
with it, which fog fits.
"""

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    File,
    Files,
    ImageLike,
    Mask,
    ModelLike,
    Progress,
    SceneLike,
    Values,
    Words,
    changes_of,
    chosen_model,
    exclude,
    listed,
    one_error,
    output_files,
    several,
    telling,
)
from airlight.validation.scenes.names import check_scene, is_random, scene_names

if TYPE_CHECKING:
    from airlight.reference.scene.model import Model
    from airlight.reference.storage.exr import Image
    from airlight.reports.api.comparisons import (
        FittedFog,
        FramesComparison,
        ImageComparison,
        ImageDiagnosis,
        SceneComparison,
    )


@one_error
def compare(
    reference: "ImageLike | SceneLike",
    test: ImageLike,
    layer: str | None = None,
    *,
    change: Values = (),
    pixel: Literal["centre", "area"] | None = None,
    mask: Mask | None = None,
    margin: float | None = None,
    margin_total: float | None = None,
    model: ModelLike | None = None,
    all_metrics: bool = False,
    diagnose: bool = False,
    fit: Words | None = None,
    sequence: File | None = None,
    output: Files = (),
    progress: Progress = None,
) -> "ImageComparison | SceneComparison | ImageDiagnosis | FramesComparison | FittedFog":
    """Compare an image with another, or with the reference of a scene.

    The result has the bias and quantiles of the error, and statistics if there are standard errors.
    With a scene it also has the best-fitting factor, what may be wrong with the image as a whole,
    where most of the error lies, and whether the image is right. The exit status is 1 if the image
    has values that are negative or not finite, or if the bias is not shown to be within the margin.

    `--diagnose` predicts the image that each of a hundred faults would make, of medium, lights,
    camera and encoding, and ranks them by evidence. `--fit` finds the parameters of the fog that
    explain the image, each with its 95 % interval. `--sequence` compares all frames of a scene that
    changes with the reference of each: flicker, lag, ghosts. Independent renders of one frame tell
    bias from noise. See docs/your-engine.md.

    Parameters
    ----------
    reference
        The image to compare with: an EXR file, or a scene (built-in or a Mitsuba XML or pbrt file);
        from Python also a result of `reference` or `render`, or an array (height, width, 3)
        [W/(m^2 sr)].
    test
        The image to judge, an EXR file; from Python also a result or an array. With a scene also
        several files, # for each digit of their number, such as frames/####.exr: the frames of
        `--sequence`, or independent renders.
    layer
        Layer to compare: 'airlight' by default, or 'total' (R/G/B) if there is no airlight. With a scene NAME=airlight,
        =surface or =total says what it contains; by default what its name says.
    change
        With a scene: change its camera, a light or a medium, such as medium.sigma_t=0.1; may be given several times.
    pixel
        With a scene: whether pixels are values at their centre or means over their area. By default
        both are tried, which takes several times as long.
    mask
        An EXR file that is 0 in pixels to leave out; from Python also truth
        values, (height, width).
    margin
        Largest relative bias that counts as agreement, such as 0.005; two images need standard
        errors for it, or an error that a file states.
    margin_total
        With a model: the same against the physical equation.
    model
        With a scene: judge by the equation of an engine, such as playcanvas:range=8, see `airlight list models`, or
        by terms such as light-path=off. The error of the equation and that of the algorithm are then told apart.
        With `--diagnose` faults are looked for on top of it, and `--fit` finds the fog that it has. physical leaves
        out the model that a scene file names.
    all_metrics
        Also compute the errors of other tools, colour differences, and HDR-FLIP by flip-evaluator.
    diagnose
        With a scene: say what is wrong with the image instead of how large its error is.
    fit
        With a scene: which parameters to fit, such as sigma_t,albedo (each also with .r, .g or .b), phase.g, intensity,
        exposure, light.x, light.y, light.z; sigma_t:NAME for one medium or light. sigma_t=0.1 starts the fit at
        that value; without a value it starts at the scene's.
    sequence
        With a scene: the file frames.json that says what each frame shows.
    output
        Write the difference: a .png file shows the signed relative error of each pixel in false
        colours, an .exr file has the values.
    progress
        Called with (fraction done, what); True shows a bar.

    Raises
    ------
    InputError
        If a layer is missing, sizes differ, a margin is given without errors, or
        options do not go together.

    Examples
    --------
    >>> import airlight
    >>> exact = airlight.reference("open-fog", size=(32, 24))
    >>> frame = airlight.render("open-fog", "unshadowed", "exact", size=(32, 24))
    >>> compared = airlight.compare(exact, frame)
    >>> compared.metrics.relative_rmse < 1e-5
    True
    >>> compared.passed, compared.error.shape
    (True, (24, 32, 3))
    >>> fitted = airlight.compare("open-fog", exact, fit="sigma_t=1,intensity")
    >>> abs(fitted["sigma_t"].value / 0.173 - 1) < 1e-4
    True
    """
    # NAME=airlight names a layer and says which light it contains.
    layer, _, holds = (layer or "").partition("=") if "=" in (layer or "") else (layer, "", None)
    if holds not in (None, "airlight", "surface", "total"):
        raise InputError(
            f"layer: got {holds!r} as the content of {layer}, expected airlight, surface or total"
        )
    # A name or an XML file is a scene; a file that exists is an image, and so is an array. Two
    # arguments in the wrong order are refused before a file is opened.
    scene = reference if _is_scene(reference) else None
    if scene is None and _is_scene(test) and (_is_xml(test) or not Path(str(test)).is_file()):
        raise InputError(
            f"compare: the scene stands first: airlight compare {test!s} {reference!s}"
        )
    about: dict[str, Any] = {
        "output": several(output),
        "margin": margin,
        "all_metrics": all_metrics,
    }
    # Which options go together is decided here, before any file is read, so that a mistake costs no
    # waiting.
    if scene is None:
        of_scenes = {
            "the content of the layer": holds,
            "change": several(change),
            "pixel": pixel,
            "diagnose": diagnose,
            "fit": fit,
            "model": model,
            "margin_total": margin_total,
        }
        exclude("compare", "two images have no scene", {**of_scenes, "sequence": sequence})
    if diagnose:
        exclude(
            "diagnose",
            "asks about all pixels of one image",
            {"fit": fit, "mask": mask, "sequence": sequence, "margin_total": margin_total, **about},
        )
    if fit is not None:
        beside = {"sequence": sequence, "margin_total": margin_total, **about}
        exclude("fit", "asks for the fog of one image", beside)
    check_scene(scene)
    # Several files: frames of an animation with frames.json, or independent renders of one frame.
    # Both are judged as a whole, so that a choice of pixels or a diagnosis of one image has no
    # place.
    if sequence is not None or (scene is not None and _are_several(test)):
        if diagnose or fit is not None:
            option = "diagnose" if diagnose else "fit"
            raise InputError(
                f"{option}: got {test!s}, which stands for several files; expected one image: name "
                "one of the files"
            )
        exclude(
            "compare",
            "several files are judged together",
            about | {"mask": mask, "margin": None, "model": model, "margin_total": margin_total},
        )
        how: dict[str, Any] = {"layer": layer, "holds": holds, "pixel": pixel, "margin": margin}
        how["changes"] = changes_of(change)
        return _several(str(scene), test, sequence, progress=progress, **how)
    # One image from here on.
    files = output_files(output, ".exr (values)", ".png (a picture)")
    # A fit activates Mitsuba itself, once it has read the image.
    if fit is not None:
        return _fit(
            scene,
            test,
            fit,
            changes=changes_of(change),
            model=chosen_model(model),
            layer=layer,
            holds=holds,
            pixel=pixel,
            mask=mask,
            progress=progress,
        )
    # Two images need no Mitsuba, whose start takes seconds.
    options: dict[str, Any] = {"mask": mask, "margin": margin, "all_metrics": all_metrics}
    if scene is None:
        return _two_images(reference, test, layer, files=files, **options)
    how = {"layer": layer, "holds": holds, "pixel": pixel, "changes": changes_of(change)}
    how["model"] = chosen_model(model)
    # The diagnosis and the comparison with a scene read files; an array is written to one.
    with _as_file(test) as (path, name):
        from airlight.reference.storage.exr import read_exr
        from airlight.reports.machine.environment import activate

        read_exr(path)  # unreadable files are refused before Mitsuba starts
        activate()
        if diagnose:
            return _diagnose(str(scene), path, name, progress=progress, **how)
        options |= {"margin_total": margin_total}
        return _with_scene(str(scene), path, name, files=files, progress=progress, **how, **options)


def _are_several(test: Any) -> bool:
    """Return whether a word stands for several files: # for the digits of their numbers."""
    return isinstance(test, str | os.PathLike) and "#" in str(test) and not Path(test).exists()


def _several(
    scene: str, test: Any, sequence: Any, *, progress: Any, **how: Any
) -> "FramesComparison":
    """Compare frames that `sequence` tells of, or independent renders."""
    # The number of a frame is read from the name of its file.
    if not isinstance(test, str | os.PathLike):
        raise InputError(
            "test: expected the files of all frames, such as 'frames/####.exr'; save the images "
            "first"
        )
    from airlight.reports.api.comparisons import FramesComparison
    from airlight.reports.machine.environment import activate
    from airlight.validation.motion.judge import compare_frames
    from airlight.validation.motion.noise import compare_runs

    activate()
    with telling(progress, "the files") as tell:
        how["progress"] = tell
        compared = (
            compare_runs(scene, test, **how)
            if sequence is None
            else compare_frames(scene, test, sequence, **how)
        )
    return FramesComparison(compared=compared)


def _is_scene(word: Any) -> bool:
    """Return whether a word is meant as a scene: a built-in or random one, an XML file, or
    a name that no file has.
    """
    if not isinstance(word, str | os.PathLike):
        return False
    # A name without suffix that no file has is meant as a scene: a misspelt scene is then answered
    # with the names of scenes and not with a missing file.
    path, name = Path(word), str(word)
    known = name in scene_names() or is_random(name)
    return known or _is_xml(word) or not (path.suffix or path.exists())


def _is_xml(word: Any) -> bool:
    return Path(str(word)).suffix.lower() in (".xml", ".pbrt")


@contextmanager
def _as_file(image: Any) -> Iterator[tuple[Path, str]]:
    """Give the path of an image, which is written to a file for this if it is
    none, and what to call it.
    """
    if isinstance(image, str | os.PathLike):
        yield Path(image), str(image)
        return
    from airlight.reference.storage.exr import write_exr
    from airlight.reference.storage.files import temporary_folder

    # Values that are not finite are written as they are: the comparison has to find them.
    layers, name = as_image(image, "airlight", "the test image")
    with temporary_folder() as folder:
        path = folder / "image.exr"
        write_exr(path, layers, finite=False)
        try:
            yield path, name
        except InputError as error:  # nobody knows this file
            raise InputError(str(error).replace(str(path), name)) from error


def as_image(image: Any, layer: str | None, name: str) -> "tuple[Image, str]":
    """Return layers of an `ImageLike`, and what to call it: `name` where it has none of its own.

    An array, (height, width[, 3]), becomes the layer.
    """
    import numpy as np

    from airlight.reference.storage.exr import Image, read_exr
    from airlight.reports.api.results import LayeredImage

    # A result of `render` or `reference` keeps its layers, and its total becomes one of them, so
    # that it can be compared with an image that has the total alone.
    if isinstance(image, LayeredImage):
        return image.with_total(), image.title
    if isinstance(image, str | os.PathLike):
        return read_exr(image), Path(image).name
    if isinstance(image, Image):
        return image, name
    # Anything else must be an array of numbers; booleans and objects are mistakes.
    values = np.asarray(image)
    if values.dtype.kind not in "fiu":
        raise InputError(
            f"{name}: got {type(image).__name__}, expected what render or reference return, a "
            "path, or numbers "
            "(height, width, 3)"
        )
    return Image({layer or "airlight": values}), name


def _mask(mask: Any) -> Any:
    """Return truth values, (height, width), or None."""
    import numpy as np

    from airlight.validation.comparison.images import read_mask

    if mask is None or not isinstance(mask, str | os.PathLike):
        return None if mask is None else np.asarray(mask)
    return read_mask(mask)


def _two_images(
    reference: Any, test: Any, layer: str | None, *, mask: Any, files: list[Path], **options: Any
) -> "ImageComparison":
    from airlight.reference.storage.exr import layer as image_layer
    from airlight.reports.api.comparisons import ImageComparison, write_difference
    from airlight.validation.comparison.images import compare_images

    # The sides may be of different kinds: a file with a result, an array with a file.
    exact, exact_name = as_image(reference, layer, "the reference")
    tested, test_name = as_image(test, layer, "the test image")
    chosen, names = _mask(mask), (exact_name, test_name)
    # Messages name a file by its whole path, a result by its title.
    paths = [
        str(each) if isinstance(each, str | os.PathLike) else name
        for each, name in zip((reference, test), names)
    ]
    comparison = compare_images(
        exact, tested, layer=layer, mask=chosen, names=(paths[0], paths[1]), **options
    )
    # The result also holds the compared layer of both images, for pictures and for the error of
    # each pixel.
    fields: dict[str, Any] = {
        field.name: getattr(comparison, field.name) for field in dataclasses.fields(comparison)
    }
    fields |= {
        each: image_layer(image, comparison.layer)
        for each, image in (("reference", exact), ("test", tested))
    }
    said = tuple(
        (str(path), write_difference(path, fields["reference"], fields["test"], kept=chosen))
        for path in files
    )
    return ImageComparison(**fields, names=names, files=said)


def _with_scene(
    scene: str,
    path: Path,
    name: str,
    *,
    mask: Any,
    files: list[Path],
    progress: Any,
    **options: Any,
) -> "SceneComparison":
    from airlight.reports.api.comparisons import SceneComparison, write_difference
    from airlight.validation.engine.judge import compare_scene

    # The command that the result prints names the mask as a file.
    if mask is not None and not isinstance(mask, str | os.PathLike):
        raise InputError(
            "mask: an image is compared with a scene under a mask that is an EXR file; save it "
            "first"
        )
    with telling(progress, "the reference") as tell:
        comparison = compare_scene(scene, path, mask=mask, progress=tell, **options)
    # The image may lie in a temporary file, which no user knows: the result has its title instead.
    compared = dataclasses.replace(comparison, path=name)
    images = compared.reference, compared.image
    said = tuple((str(file), write_difference(file, *images, kept=_mask(mask))) for file in files)
    return SceneComparison(compared=compared, files=said)


def _diagnose(scene: str, path: Path, name: str, *, progress: Any, **how: Any) -> "ImageDiagnosis":
    from airlight.reports.api.comparisons import ImageDiagnosis
    from airlight.validation.engine.diagnose import diagnose_file

    with telling(progress, "diagnosis") as tell:
        found = diagnose_file(path, scene, progress=tell, **how)
    return ImageDiagnosis(diagnoses=tuple(dataclasses.replace(each, path=name) for each in found))


def _fit(
    scene: Any,
    image: Any,
    parameters: Any,
    *,
    changes: Mapping[str, Sequence[float]],
    model: "Model | None",
    layer: str | None,
    mask: Any,
    progress: Any,
    **how: Any,
) -> "FittedFog":
    from airlight.validation.readers import named_values

    # sigma_t=0.1 is a parameter and where its search starts; a name alone starts at the scene.
    words = listed("fit", parameters)
    names = [word.partition("=")[0].strip() for word in words]
    starts = named_values(
        "fit",
        [word for word in words if "=" in word],
        float,
        "NAME or NAME=VALUE, such as sigma_t=0.1",
    )
    layers, name = as_image(image, layer, "the image")  # before Mitsuba starts
    from airlight.reports.machine.environment import activate

    activate()
    from airlight.reports.api.comparisons import FittedFog
    from airlight.validation.engine.observation import judged_layer, scene_of_size
    from airlight.validation.fit.fit import fit_image

    # The scene is loaded at the size of the image, whose pixels the fit explains.
    size = judged_layer(layers, name, name=layer, holds=how["holds"]).size
    loaded = scene_of_size(str(scene), size, name, changes, model)
    with telling(progress, "fit") as tell:
        result = fit_image(
            layers,
            loaded,
            names,
            path=name,
            layer=layer,
            mask=_mask(mask),
            starts=starts,
            progress=tell,
            **how,
        )
    return FittedFog(fit=result)
