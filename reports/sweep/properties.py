# SPDX-License-Identifier: BSD-3-Clause
"""The properties of scenes in words, for sentences, figures and tables.

`validation.properties.properties.scene_properties` says exactly what each is, and works it out. Distances there are
shares of others, so that none depends on the unit of length.
"""

from collections.abc import Mapping

WORDS: Mapping[str, str] = {
    "lights": "number of lights",
    "points": "number of point lights",
    "spots": "number of spot lights",
    "directionals": "number of directional lights",
    "areas": "number of lights with extent",
    "soft_spots": "presence of soft spots",
    "light_size": "size of the lights",
    "light_nearest": "distance of the nearest light",
    "light_ray": "distance of the rays from a light",
    "lights_seen": "number of lights in the image",
    "extinctions": "extinctions by colour",
    "endless": "presence of an endless medium",
    "bounded": "number of bounded media",
    "facets": "facets of the media's bounds",
    "inside": "presence of the camera in a medium",
    "optical_depth": "optical depth",
    "optical_depth_most": "largest optical depth of a ray",
    "optical_depth_light": "optical depth from the light",
    "mean_cosine": "mean cosine of scattering",
    "forward": "peak of the phase function",
    "surface_share": "share of pixels with surfaces",
    "depth_edges": "edges in depth",
    "lit_share": "share of lit points",
    "shadow_edges": "shadow edges along a ray",
    "shadow_edges_across": "shadow edges across rays",
    "shapes": "number of shapes",
    "plain_shapes": "shapes without triangles",
    "triangles": "number of triangles",
    "components": "components of meshes",
    "closed": "share of closed components",
    "silhouettes": "silhouette edges",
    "silhouettes_most": "silhouette edges of one light",
    "pixels": "pixels",
}


def property_words(name: str) -> str:
    """Return a property in words; of one that has none here its name without underscores."""
    return WORDS.get(name, name.replace("_", " "))
