# SPDX-License-Identifier: BSD-3-Clause
"""The Python API for images: load a scene, render it, compare.

Every function chooses the Mitsuba variant that works here when it is first needed, and raises `airlight.InputError`
with one line for what cannot be used. Results are frozen, see `reports.api.results`.
"""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

from reports.api.inputs import ImageLike, OpenScene, SceneLike, Size, as_image, kernel_name, one_error, opened

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from reports.api.comparison import ImageComparison
    from reports.api.results import Rendering


@one_error
def load_scene(scene: SceneLike, size: Size | None = None) -> OpenScene:
    """Load a scene.

    Parameters
    ----------
    scene
        A built-in name (`airlight.SCENES`), the path of a Mitsuba XML file, a Mitsuba dictionary, or a Mitsuba scene.
    size
        Width and height of its image [pixels], or 'WxH'; the scene's own by default.

    Raises
    ------
    InputError
        For what is no scene, or cannot be read.

    Examples
    --------
    >>> import airlight
    >>> scene = airlight.load_scene("open-fog", size=(32, 24))
    >>> scene
    OpenScene(open-fog, 32 x 24)
    >>> scene.plan()["lights"]
    '1 point'
    """
    return opened(scene, size)


@one_error
def render(
    scene: SceneLike,
    method: str | Callable[..., Any] = "ray-march",
    kernel: str | Callable[..., Any] | None = None,
    *,
    size: Size | None = None,
    precision: Literal["single", "double"] = "single",
    timed: bool = False,
    **parameters: Any,
) -> "Rendering":
    """Render a frame by a real-time method.

    Parameters
    ----------
    scene
        See `load_scene`.
    method
        A name (`airlight.METHODS`), one's own as 'module:function' or 'path/to/file.py:function', or such a function
        itself, ``method(view, *, kernel=None, **parameters)``, from the top of a module or a notebook.
    kernel
        A name (`airlight.KERNELS`), such a name with '-N', 'module:function', or such a function itself; 'exact' by
        default, for a method that calls a kernel.
    size
        Width and height [pixels], or 'WxH'; the scene's own by default.
    precision
        Of all that the method computes: 'single' (float32) or 'double'.
    timed
        Also measure what a frame costs, which takes a few seconds.
    parameters
        Parameters of the method, such as ``steps=64``.

    Raises
    ------
    InputError
        For what is not known, and for what the method refuses.

    Examples
    --------
    >>> import airlight
    >>> frame = airlight.render("open-fog", "ray-march", size=(32, 24), steps=64)
    >>> frame
    Rendering(open-fog by ray-march (steps=64), 32 x 24)
    >>> frame.airlight.shape, frame.airlight.dtype.name
    ((24, 32, 3), 'float32')
    """
    from realtime.frame.renderer import render_frame
    from realtime.methods.registry import find_method
    from realtime.scene.features import describe
    from realtime.scene.read_scene import read_scene
    from reports.api.results import Rendering, sealed
    from reports.machine.environment import activate
    from validation.study.configuration import configuration, prepared
    from validation.study.frame_times import time_frame
    from validation.study.run import layered_frame

    activate()  # a user's module may need a variant when it is imported
    # A method that is not known is refused before the scene is loaded.
    chosen = configuration(method, kernel_name(kernel), parameters)
    loaded = opened(scene, size)
    read = read_scene(loaded.scene, precision)
    layered = bool(find_method(chosen.method).layers)
    renderer = prepared(read, chosen, extra_layers=layered)
    image = layered_frame(loaded.name, chosen, render_frame(renderer))
    return Rendering(
        scene=loaded.name,
        image=sealed(image),
        method=chosen.method,
        kernel=chosen.kernel,
        parameters=dict(chosen.parameters),
        label=chosen.label,
        precision=precision,
        plan=describe(read.features),
        notes=read.features.notes,
        times=time_frame(prepared(read, chosen)) if timed else None,
    )


@one_error
def compare(
    reference: ImageLike,
    test: ImageLike,
    layer: str = "airlight",
    *,
    margin: float | None = None,
    mask: "ArrayLike | None" = None,
    all_metrics: bool = False,
    flip: bool = False,
    exposure: float | None = None,
) -> "ImageComparison":
    """Compare a layer of an image with that of a reference.

    Parameters
    ----------
    reference, test
        What `reference` or `render` returned, the paths of EXR files, or arrays (height, width, 3) [W/(m^2 sr)].
    layer
        'airlight', 'surface' or 'total'.
    margin
        Largest relative bias that counts as agreement, such as 0.005; wants standard errors in either image.
    mask
        Pixels to compare, (height, width) of truth values; all by default.
    all_metrics
        Also the errors by the formulas of other tools and the colour differences.
    flip
        Also HDR-FLIP.
    exposure
        Of the colour differences and of HDR-FLIP [stops]; each chooses its own from the reference by default.

    Raises
    ------
    InputError
        If a layer is missing, sizes differ, or a margin is given without standard errors.

    Examples
    --------
    >>> import airlight
    >>> truth = airlight.reference("open-fog", size=(32, 24))
    >>> frame = airlight.render("open-fog", "unshadowed", "exact", size=(32, 24))
    >>> compared = airlight.compare(truth, frame)
    >>> compared.metrics.relative_rmse < 1e-5
    True
    >>> compared.passed, compared.error.shape
    (True, (24, 32, 3))
    """
    import numpy as np

    from reference.storage.exr import layer as image_layer
    from reports.api.comparison import ImageComparison
    from validation.comparison.images import compare_images

    truth, truth_name = as_image(reference, layer, "the reference")
    tested, test_name = as_image(test, layer, "the test image")
    chosen = None if mask is None else np.asarray(mask)
    comparison = compare_images(
        truth,
        tested,
        layer=layer,
        mask=chosen,
        margin=margin,
        all_metrics=all_metrics,
        flip=flip,
        exposure=exposure,
    )
    kept: dict[str, Any] = {field.name: getattr(comparison, field.name) for field in dataclasses.fields(comparison)}
    kept |= {"reference": image_layer(truth, layer), "test": image_layer(tested, layer)}
    return ImageComparison(**kept, names=(truth_name, test_name))
