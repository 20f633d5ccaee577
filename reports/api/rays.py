# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.rays`: the camera rays of a scene as arrays, for methods that are no code of ours."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from airlight.reports.api.inputs import SceneLike, Size, one_error
from airlight.validation.scenes.names import check_scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class CameraRays:
    """The rays of a camera through the centres of its pixels, in float64."""

    origin: "NDArray[np.float64]"  #: the pinhole, where all rays begin, (3,) [m]
    direction: "NDArray[np.float64]"  #: of unit length, (height, width, 3)
    #: along the ray to the visible surface, (height, width) [m]; infinite where there is none
    distance: "NDArray[np.float64]"


@one_error
def rays(scene: SceneLike, size: Size | None = None) -> CameraRays:
    """Return the camera rays of a scene, and where each meets a surface.

    They are the rays of the quadrature with its pixels at their centres: `compare(scene, image)`
    judges the image that a method in NumPy, PyTorch or JAX makes of them.

    Parameters
    ----------
    scene
        A built-in name (`airlight.SCENES`), random:SEED, the path of a Mitsuba XML or pbrt file, a
        Mitsuba dictionary, or a scene that is loaded.
    size
        Width and height of its image [pixels], or 'WxH'; the scene's own by default.

    Raises
    ------
    InputError
        For a scene without a reference by quadrature, with the name of what is in the way.

    Examples
    --------
    >>> import airlight
    >>> rays = airlight.rays("open-fog", size=(32, 24))
    >>> rays.direction.shape, rays.distance.shape
    ((24, 32, 3), (24, 32))
    """
    check_scene(scene)
    from airlight.reference.quadrature.surface import surface_hits
    from airlight.reference.scene.read import read_reference
    from airlight.reference.visibility.distances import exact_distance
    from airlight.reports.api.scenes import opened

    loaded = opened(scene, size)
    # A model may have light where physics has none.
    read = read_reference(loaded.scene, loaded.model)
    hits = surface_hits(read)
    distance = exact_distance(read, hits.interaction, hits.distance)
    shape = read.height, read.width
    return CameraRays(read.origin, read.direction.reshape(*shape, 3), distance.reshape(shape))
