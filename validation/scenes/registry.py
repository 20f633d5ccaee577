# SPDX-License-Identifier: BSD-3-Clause
"""The built-in scenes: one registry for tests, benchmarks and figures.

A function builds each scene from arbitrary, never round numbers, so that no constant of the code can hide behind a
constant of the scene. Every command and report knows the scenes that have a `SceneRecord` in `SCENES`. Those of
`FOG_SCENES` scatter light once: the standard report, the baselines and the tests of all methods study these.
"""

from validation.scenes.cloud_slab import SCENE as CLOUD_SLAB
from validation.scenes.clutter import SCENE as CLUTTER
from validation.scenes.colonnade import colonnade
from validation.scenes.cumulus import SCENE as CUMULUS
from validation.scenes.cumulus_detail import SCENE as CUMULUS_DETAIL
from validation.scenes.fence import SCENE as FENCE
from validation.scenes.hall import SCENE as HALL
from validation.scenes.omni_box import SCENE as OMNI_BOX
from validation.scenes.open_fog import open_fog
from validation.scenes.overlap import SCENE as OVERLAP
from validation.scenes.penumbra_plane import SCENE as PENUMBRA_PLANE
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.ring import SCENE as RING
from validation.scenes.soft_hall import SCENE as SOFT_HALL
from validation.scenes.sphere_spot import sphere_spot
from validation.scenes.step_cloud import SCENE as STEP_CLOUD
from validation.scenes.stratocumulus import SCENE as STRATOCUMULUS
from validation.scenes.tangle import SCENE as TANGLE
from validation.scenes.three_media import SCENE as THREE_MEDIA
from validation.scenes.two_lobes import SCENE as TWO_LOBES
from validation.scenes.two_pens import two_pens
from validation.scenes.windows import SCENE as WINDOWS

SCENES: dict[str, SceneRecord] = {
    record.name: record
    for record in (
        SceneRecord(
            "open-fog",
            open_fog,
            "Fog and a lamp in view, nothing else: the airlight integral alone, with its peak near the light.",
            "Biri, Arques, Michelin 2006, section 4.1; Sun et al. 2005",
            Animation(about=(0.11, 0.31, 1.57)),
        ),
        SceneRecord(
            "sphere-spot",
            sphere_spot,
            "A sphere below a spot light: one shadow in a cone of light, a silhouette of 32 edges.",
            "Biri, Arques, Michelin 2006, section 6: 120 frames/s at 800 x 600",
            Animation(about=(0.11, -0.07, 1.93)),
        ),
        SceneRecord(
            "colonnade",
            colonnade,
            "A hall of fluted columns in fog, lit through them: many parallel shafts, thin shadows, 66 000 triangles.",
            "Billeter, Sintorn, Assarsson 2010, Fig. 7 (the Sponza atrium)",
            Animation(about=(4.73, 1.57, 4.37)),
        ),
        SceneRecord(
            "two-pens",
            two_pens,
            "Two pens standing on a sheet before a lamp: smooth casters whose shadows cross, 34 549 triangles.",
            "Biri, Arques, Michelin 2006, Fig. 7a and Table 2: 23 frames/s",
            Animation(("objects",), objects=("pens",)),
        ),
        THREE_MEDIA,
        CLUTTER,
        HALL,
        OMNI_BOX,
        TANGLE,
        WINDOWS,
        PENUMBRA_PLANE,
        FENCE,
        SOFT_HALL,
        OVERLAP,
        CLOUD_SLAB,
        STRATOCUMULUS,
        CUMULUS,
        CUMULUS_DETAIL,
        STEP_CLOUD,
        RING,
        TWO_LOBES,
    )
}

#: Those without clouds.
FOG_SCENES: dict[str, SceneRecord] = {name: record for name, record in SCENES.items() if not record.clouds}
