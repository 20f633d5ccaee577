# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the paths through clouds, and Mitsuba's `volpath`, give the consensus
of I3RC in the step cloud.
"""

import math

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.monte_carlo.cloud_paths.integrator import SIDE
from airlight.reference.monte_carlo.cloud_paths.tables import walk_scene
from airlight.reference.monte_carlo.cloud_paths.walk import Targets, walk
from airlight.reference.scene.clouds import read_clouds
from airlight.validation.scenes.parts import sun as light
from airlight.validation.scenes.registry import SCENES

COLUMNS = 32
PERIODS, WIDTH, THICKNESS = 9, 500.0, 250.0  #: of the cloud, widths [m]
THIN, THICK = 2.0, 18.0  #: optical thickness of both halves
#: Light at the zenith, and at 60 degrees travelling to +x: mean reflectance, and that
#: of columns 1, 8, 17, 24.
CONSENSUS = {
    0.0: (0.32760, (0.27859, 0.22592, 0.32332, 0.45022)),
    60.0: (0.58044, (0.47539, 0.34333, 0.60301, 0.84800)),
}


def lit_from(sun):
    """Return the scene with the sun at a zenith angle [degrees]."""
    angle = math.radians(sun)
    own = {"sun": light((math.sin(angle), 0.0, -math.cos(angle)), (math.pi,) * 3)}
    return mi.load_dict(SCENES["step-cloud"].build() | own)


def rays_from_above(paths, seed):
    """Return rays into the middle period, as many in each column, that gather a
    flux: by the cosine law.
    """
    random = np.random.default_rng(seed)
    x = (np.arange(paths) % COLUMNS + random.random(paths)) * (500.0 / COLUMNS)
    cosine, azimuth = np.sqrt(random.random(paths)), 2 * np.pi * random.random(paths)
    sine = np.sqrt(1 - cosine**2)
    direction = mi.Vector3f(np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine]))
    return mi.Ray3f(mi.Point3f(np.stack([x, 0 * x, 0 * x + 250.5])), direction)


def reflectance(radiance, sun):
    """Return the reflectance of columns and of all: pi L/(E mu0), and the standard error of all."""
    values = np.array(radiance, dtype=np.float64).reshape(-1, COLUMNS) / math.cos(math.radians(sun))
    return values.mean(0), values.mean(), values.std() / math.sqrt(values.size)


def by_walk(scene, paths, seed):
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, paths)
    targets = Targets(mi.UInt32([0, 0]), 1)
    sums = walk(
        walk_scene(read_clouds(scene), 0),
        targets,
        sampler,
        rays_from_above(paths, seed),
        samples=1,
        side=SIDE,
    )
    return np.array(sums[0]).reshape(-1, paths)[0]


def as_grid(scene):
    """Return the cloud as one box of a `heterogeneous` medium: `volpath` would leap
    over the gaps between boxes.
    """
    grid = (
        np.tile([THIN / THICKNESS, THICK / THICKNESS], PERIODS)
        .astype(np.float32)
        .reshape(1, 1, 2 * PERIODS, 1)
    )
    to_world = mi.ScalarTransform4f().translate([-(PERIODS // 2) * WIDTH, -1200.0, 0.0])
    to_world = to_world @ mi.ScalarTransform4f().scale([PERIODS * WIDTH, 2400.0, THICKNESS])
    return mi.load_dict(
        {
            "type": "scene",
            "sun": scene.emitters()[0],
            "cloud": {
                "type": "cube",
                "to_world": to_world @ mi.ScalarTransform4f().translate([0.5] * 3).scale([0.5] * 3),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "heterogeneous",
                    "albedo": 1.0,
                    "sigma_t": {
                        "type": "gridvolume",
                        "grid": mi.VolumeGrid(grid),
                        "filter_type": "nearest",
                        "to_world": to_world,
                    },
                    "phase": {"type": "hg", "g": 0.85},
                },
            },
        }
    )


def by_volpath(scene, paths, seed):
    scene = as_grid(scene)
    integrator = mi.load_dict({"type": "volpath", "max_depth": -1, "rr_depth": 1 << 20})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, paths)
    radiance, _, _ = integrator.sample(
        scene, sampler, mi.RayDifferential3f(rays_from_above(paths, seed)), None
    )
    return np.array(radiance.x)


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.claim(
    "cloud-paths-step-cloud",
    tolerance="mean 0.0005 and three standard errors, columns 0.003 and theirs",
)
@pytest.mark.parametrize("sun", CONSENSUS)
@pytest.mark.parametrize("estimate", [by_walk, by_volpath])
def test_the_consensus_of_i3rc(variant, sun, estimate):
    scene, parts, paths = lit_from(sun), 8, 1 << 17
    radiance = np.concatenate([estimate(scene, paths, seed) for seed in range(parts)])
    columns, mean, error = reflectance(radiance, sun)
    wanted, chosen = CONSENSUS[sun]
    assert abs(mean - wanted) < 0.0005 + 3 * error
    assert np.abs(columns[[0, 7, 16, 23]] - chosen).max() < 0.003 + 3 * error * math.sqrt(COLUMNS)
