# SPDX-License-Identifier: BSD-3-Clause
"""The truth of an image: the values of the rays through pixel centres, or means over the areas of pixels."""

from analytic.errors import InputError
from reference.quadrature.area_airlight import Keep
from reference.quadrature.light_points import PointPlan
from reference.quadrature.pixel_area import area_image
from reference.quadrature.ray_values import Progress, TruthImage, image_of, ray_values
from reference.scene.read import TruthScene


def quadrature_image(
    truth: TruthScene,
    *,
    samples: int = 256,
    shadow_scale: float = 1.0,
    pixel: str = "centre",
    edges: str = "auto",
    progress: Progress | None = None,
    plan: PointPlan | None = None,
    keep: Keep | None = None,
) -> TruthImage:
    """Compute the truth of an image.

    Parameters
    ----------
    truth
        The scene.
    samples
        Visibility samples of each ray and light; an eighth as many random ones check the lit intervals.
    shadow_scale
        Attenuate the leg from the light over this share [1] of its length: 1 is the truth, 1 - epsilon what a renderer
        with a shadow-ray epsilon converges to (DESIGN section 6.1). Such a renderer also starts its shadow rays off the
        surface, and so do those for `surface` then (`reference.visibility.surface_shadows`).
    pixel
        "centre": the radiance along the ray through the centre. "area": the mean over the pixel.
    edges
        How lit intervals are found: "geometry", "rays" or "auto", see
        `reference.visibility.lit_intervals.lit_intervals`.
    progress
        Called with (done, total, what) as the work goes on.
    plan
        How many points and scan lines stand for lights with extent.
    keep
        Called with the name of each part of that work and a function that does it: it may keep what it returns, and
        give it back when the same image is computed again. Not for means over pixels.

    Returns
    -------
    TruthImage
        Radiances, (height, width, 3) [W/(m^2 sr)], and what is known of their errors.

    Raises
    ------
    InputError
        For another word in `pixel` or `edges`.

    Notes
    -----
    Valid for homogeneous media, point and spot lights, lights with extent, opaque surfaces; for directional lights
    where all media have bounds. Their legs have no end, so `shadow_scale` leaves them as they are. A pixel whose centre
    ray meets a point light has an infinite airlight; the mean over its area is finite.
    """
    if pixel == "area":
        return area_image(truth, samples=samples, shadow_scale=shadow_scale, edges=edges, progress=progress, plan=plan)
    if pixel != "centre":
        raise InputError(f"pixel is '{pixel}'; wanted 'centre' or 'area'")
    values = ray_values(
        truth, samples=samples, shadow_scale=shadow_scale, edges=edges, progress=progress, plan=plan, keep=keep
    )
    layers = values.airlight, values.bound, values.surface
    return image_of(truth, values, layers, (values.emitted, values.replicates))
