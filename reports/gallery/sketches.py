# SPDX-License-Identifier: BSD-3-Clause
"""How methods work, drawn in `sphere-spot` as seen from the side: the camera, some of its rays, what the method makes.

Lit parts of rays are yellow and dark ones blue, by shadow rays of Mitsuba. The drawings are made of the scene, with few
planes, texels, steps and froxels, so that each can be seen; nothing in them is a number.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from realtime.frame.samples import render_samples
from realtime.scene.read_scene import read_scene
from reports.plotting.pictures import preview, tone_curve
from validation.configurations.methods import configuration, prepared
from validation.scenes.loading import load_scene

Array = NDArray[np.float64]

_SCENE = "sphere-spot"
_EYE, _TARGET, _FOV = np.array([8.1, -4.4, 3.3]), np.array([0.0, -1.75, 1.85]), 49.0  # the view from the side
_LIT, _DARK, _LINE, _PLANE = (255, 214, 92, 255), (96, 150, 235, 255), (255, 255, 255, 150), (255, 120, 90, 46)
_FINE = 2  # the drawing is made larger by this, and reduced


@dataclass(frozen=True)
class Sheet:
    """A picture to draw on, with the scene behind it."""

    draw: Any  #: `PIL.ImageDraw.Draw`
    scene: Any  #: the `mi.Scene`, with its own camera
    camera: Array  #: the axes of its camera in rows: left, up, forward; of length 1 at half the height of the image
    eye: Array  #: where its camera is [m]
    light: Array  #: where the light is [m]
    axis: Array  #: of the spot
    cutoff: float  #: of the spot [rad]
    size: tuple[int, int]  #: [pixels] of the sheet

    def place(self, points: Array) -> list[tuple[float, float]]:
        """Return where points are seen from the side."""
        forward = _unit(_TARGET - _EYE)
        right = _unit(np.cross(forward, (0, 0, 1)))
        away = np.atleast_2d(points) - _EYE
        depth = away @ forward
        scale = self.size[0] / 2 / np.tan(np.radians(_FOV) / 2) / depth
        across, down = away @ right, away @ -np.cross(right, forward)
        return list(zip(self.size[0] / 2 + scale * across, self.size[1] / 2 + scale * down))

    def line(self, points: Array, colour: tuple[int, ...], width: int = 1) -> None:
        """Draw a line through points."""
        self.draw.line(self.place(points), fill=colour, width=width * _FINE, joint="curve")

    def dots(self, points: Array, colour: tuple[int, ...], radius: float = 2.2) -> None:
        """Draw points."""
        r = radius * _FINE
        for x, y in self.place(points) if len(points) else []:
            self.draw.ellipse((x - r, y - r, x + r, y + r), fill=colour)

    def hit(self, origin: Array, directions: Array, most: float = 30.0) -> Array:
        """Return how far rays go to the first surface [m]."""
        rays = mi.Ray3f(mi.Point3f(*map(float, origin)), mi.Vector3f(directions.T))
        found = self.scene.ray_intersect_preliminary(rays)
        return np.minimum(np.array(dr.select(found.is_valid(), found.t, most), dtype=np.float64), most)

    def lit(self, points: Array) -> NDArray[np.bool_]:
        """Return which points the light reaches."""
        way = self.light - points
        inside = -(way / np.linalg.norm(way, axis=1)[:, None]) @ self.axis > np.cos(self.cutoff)
        rays = mi.Ray3f(mi.Point3f(points.T), mi.Vector3f(way.T))
        rays.maxt = 0.999
        return inside & ~np.array(self.scene.ray_test(rays), dtype=bool)

    def rays(self, column: float = 0.08, count: int = 7) -> tuple[Array, Array]:
        """Return unit directions of some rays of one column of the image, and how far they go [m]."""
        rows = np.linspace(0.82, -0.78, count)
        directions = np.stack([_unit(self.camera.T @ np.array([column, row, 1.0])) for row in rows])
        return directions, self.hit(self.eye, directions)

    def segments(self, directions: Array, reach: Array, *, dark: bool = True) -> None:
        """Draw the lit parts of rays, and the dark ones."""
        for direction, end in zip(directions, reach):
            x = np.linspace(0.02, end, 600)
            points = self.eye + x[:, None] * direction
            lit = self.lit(points)
            if dark:
                self.line(points[[0, -1]], _DARK, 1)
            for run in np.split(np.arange(len(x)), np.flatnonzero(np.diff(lit.astype(int))) + 1):
                if lit[run[0]] and len(run) > 1:
                    self.line(points[run[[0, -1]]], _LIT, 3)


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _unshadowed(sheet: Sheet) -> None:
    directions, reach = sheet.rays()
    for direction, end in zip(directions, reach):
        sheet.line(np.stack([sheet.eye, sheet.eye + end * direction]), _LIT, 3)


def _ray_march(sheet: Sheet) -> None:
    directions, reach = sheet.rays()
    for direction, end in zip(directions, reach):
        points = sheet.eye + (end * (np.arange(28) + 0.5) / 28)[:, None] * direction
        lit = sheet.lit(points)
        sheet.line(np.stack([sheet.eye, sheet.eye + end * direction]), _LINE)
        sheet.dots(points[~lit], _DARK)
        sheet.dots(points[lit], _LIT, 3.2)


def _shadow_planes(sheet: Sheet) -> None:
    from realtime.methods.shadow_planes.silhouettes import silhouette
    from realtime.scene.mesh_adjacency import read_casters

    casters = read_casters(sheet.scene)
    for edge in silhouette(casters, sheet.light).edges:
        ends = np.asarray(casters.vertices[edge], dtype=np.float64)
        if ends[:, 2].min() < 0.5:  # the border of the floor casts planes below it
            continue
        way = ends - sheet.light
        far = sheet.light - way * (sheet.light[2] / way[:, 2])[:, None]  # down to the floor
        sheet.draw.polygon(sheet.place(np.concatenate([ends, far[::-1]])), fill=_PLANE, outline=(255, 150, 120, 130))
        sheet.line(ends, (255, 90, 60, 255), 2)
    sheet.segments(*sheet.rays())


def _light_volumes(sheet: Sheet) -> None:
    n = 21
    side = _unit(np.cross(sheet.axis, (1.0, 0, 0)))
    across = np.stack([side, np.cross(sheet.axis, side)])
    u = np.linspace(-1, 1, n) * np.tan(sheet.cutoff) * 0.97
    aims = np.stack([sheet.axis + a * across[0] + b * across[1] for b in u for a in u])
    aims /= np.linalg.norm(aims, axis=1)[:, None]
    points = (sheet.light + sheet.hit(sheet.light, aims)[:, None] * aims).reshape(n, n, 3)
    for grid in (points, points.transpose(1, 0, 2)):
        for row in grid:
            sheet.line(row, (255, 150, 120, 170), 1)
    for corner in (points[0, 0], points[0, -1], points[-1, 0], points[-1, -1]):
        sheet.line(np.stack([sheet.light, corner]), (255, 150, 120, 200), 1)
    sheet.segments(*sheet.rays())


def _epipolar(sheet: Sheet) -> None:
    for column in (-0.36, 0.08, 0.5):
        directions, reach = sheet.rays(column, 9)
        ends = sheet.eye + reach[:, None] * directions
        sheet.draw.polygon(sheet.place(np.concatenate([[sheet.eye], ends])), fill=(255, 255, 255, 26))
        sheet.segments(directions, reach, dark=False)
        for end in ends:
            sheet.line(np.stack([sheet.eye, end]), (255, 255, 255, 70))


def _froxels(sheet: Sheet) -> None:
    aspect = 4 / 3
    for z in 8.5 * (np.exp(np.linspace(0.25, 1, 9) * np.log(6)) - 1) / 5:
        for row in np.linspace(-1, 1, 7):
            line = [sheet.eye + z * (sheet.camera.T @ np.array([c * aspect, row, 1.0])) for c in (-1, 1)]
            sheet.line(np.stack(line), (255, 255, 255, 60))
        for c in np.linspace(-1, 1, 9):
            line = [sheet.eye + z * (sheet.camera.T @ np.array([c * aspect, row, 1.0])) for row in (-1, 1)]
            sheet.line(np.stack(line), (255, 255, 255, 60))
        centres = np.stack(
            [
                sheet.eye + z * (sheet.camera.T @ np.array([c * aspect, row, 1.0]))
                for c in np.linspace(-0.875, 0.875, 8)
                for row in np.linspace(-0.83, 0.83, 6)
            ]
        )
        sheet.dots(centres[sheet.lit(centres)], _LIT, 2.6)


#: By method, what draws it.
SKETCHES: Mapping[str, Callable[[Sheet], None]] = {
    "unshadowed": _unshadowed,
    "ray-march": _ray_march,
    "shadow-planes": _shadow_planes,
    "light-volumes": _light_volumes,
    "min-max": _epipolar,
    "froxel-fog": _froxels,
}


def sketch(method: str, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the drawing of a method of `SKETCHES`, (height, width, 3).

    Parameters
    ----------
    method
        Its name.
    size
        Width and height [pixels].
    """
    large = (_FINE * size[0], _FINE * size[1])
    picture = Image.fromarray(_from_the_side(size)).resize(large, Image.Resampling.BICUBIC).convert("RGB")
    sheet = _sheet(ImageDraw.Draw(picture, "RGBA"), large)
    SKETCHES[method](sheet)
    corners = [sheet.camera.T @ np.array([c, r, 1.0]) for c, r in ((1.33, 1), (-1.33, 1), (-1.33, -1), (1.33, -1))]
    frustum = sheet.eye + 0.55 * np.stack([*corners, corners[0]])
    sheet.line(frustum, (255, 255, 255, 255), 2)
    for corner in frustum[:4]:
        sheet.line(np.stack([sheet.eye, corner]), (255, 255, 255, 255), 2)
    sheet.dots(sheet.light[None], (255, 244, 210, 255), 6)
    return np.asarray(picture.resize(size, Image.Resampling.LANCZOS))


def _from_the_side(size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the scene as seen from the side, dimmed."""
    loaded = load_scene(_SCENE, size)
    sensor = mi.traverse(loaded.scene.sensors()[0])
    origin, target = (list(map(float, place)) for place in (_EYE, _TARGET))
    sensor["to_world"] = mi.ScalarTransform4f().look_at(origin=origin, target=target, up=[0, 0, 1])
    sensor["x_fov"] = _FOV
    sensor.update()
    frame = render_samples(prepared(read_scene(loaded.scene), configuration("shadow-planes")), 8)
    total = np.asarray(frame.airlight + frame.surface, dtype=np.float64)
    return np.round(0.62 * preview(total, tone_curve(total))).astype(np.uint8)


def _sheet(draw: Any, size: tuple[int, int]) -> Sheet:
    scene = load_scene(_SCENE, (8, 6)).scene
    sensor = scene.sensors()[0]
    matrix = np.array(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)
    half = np.tan(np.radians(float(mi.traverse(sensor)["x_fov"][0])) / 2) * 3 / 4
    axes = np.stack([half * matrix[:3, 0], half * matrix[:3, 1], matrix[:3, 2]])
    lamp = np.array(scene.emitters()[0].world_transform().matrix, dtype=np.float64).reshape(4, 4)
    cutoff = np.radians(float(mi.traverse(scene.emitters()[0])["cutoff_angle"][0]))
    return Sheet(draw, scene, axes, matrix[:3, 3], lamp[:3, 3], _unit(lamp[:3, 2]), float(cutoff), size)
