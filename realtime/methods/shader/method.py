# SPDX-License-Identifier: BSD-3-Clause
"""A user's shader as a method, named by its file: 'fog.glsl' (`realtime.methods.shader`).

It is the same to frames, reports and the view as a method in Python. Its time is measured on the
device that OpenGL draws on, which has a name; Dr.Jit has no part in it.
"""

from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import Any, ClassVar

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.methods.shader.client import ShaderHost
from airlight.realtime.methods.shader.prelude import phase_text, stage_text
from airlight.realtime.methods.shader.scene_arrays import (
    check_ends,
    check_scene,
    light_array,
    map_array,
    phase_table,
    ray_arrays,
    uniforms,
)
from airlight.realtime.methods.shader.source import ShaderSource, read_shader
from airlight.realtime.methods.user_method import check_names, checked_radiance
from airlight.realtime.parameters import parameter, values
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map, check_maps, map_size


@dataclass(frozen=True)
class Shader(Method):
    """A user's shader."""

    shader: ClassVar[ShaderSource]
    map: int = map_size(512, "texels on a side of a face of a shadow map")

    summary = "a user's shader"
    casts_rays = True
    frozen = False
    at_once = True
    prepared_from = frozenset({"geometry", "light"})

    @property
    def carries(self):
        """Whether it reads images of the last frame, or counts frames."""
        history = {"frame", *(f"{each.name}_last" for each in self.shader.passes)}
        return self.shader.frames > 1 or bool(history & self.shader.words)

    @property
    def _maps(self) -> bool:
        return self.shadows and bool({"visible", "shadow_maps"} & self.shader.words)

    def check(self, scene):
        """Refuse what no shader is given."""
        check_scene(scene, self.shader.path.name)
        if self._maps and scene.features.shadows:
            check_maps(scene.lights, self.map)

    def preparation(self, scene):
        """Start the driver and compile the shader; return what casts shadow maps before a frame."""
        self.check(scene)
        # Every pass is a stage, and the picture, None, is the last.
        host, size = ShaderHost(self.name), (scene.camera.width, scene.camera.height)
        phase = phase_text(scene.medium.phase)
        stages = [
            {
                "name": "airlight" if each is None else each.name,
                "text": stage_text(self.shader, phase, values(self), each),
                "kind": "picture" if each is None else f"{len(each.size)}d",
                "size": size if each is None else each.pixels(*size),
                "format": "rgba32f" if each is None else each.format,
            }
            for each in (*self.shader.passes, None)
        ]
        # The driver's log of a mistake becomes a message with the line of the user's file.
        said, _ = host.ask("open", stages=stages)
        if "log" in said:
            raise InputError(f"method {self.name}: {self.shader.mistake(said['log'])}")
        host.device = said["device"]

        def run(now):
            # Maps are cast for a shader that reads them, in scenes where something casts shadows.
            maps = []
            if self._maps and now.features.shadows:
                maps = [cast_shadow_map(now.geometry, light, self.map) for light in now.lights]
            return host, tuple(maps)

        return run

    def render(self, view, state, kernel):
        """Return the image of the shader; uniforms that nothing sets and values that
        are not finite are refused.
        """
        host, maps = state
        check_ends(view.medium, f"{self.shader.path.name} renders a homogeneous medium")
        arrays: dict[str, Any] = ray_arrays(
            view, surfaces=bool({"g_normal", "g_albedo"} & self.shader.words)
        )
        # All that a shader is given goes to the host by the names of the prelude: textures, layers,
        # buffers by their bindings, and uniforms.
        arrays["layers shadow_maps"] = map_array(maps)
        arrays |= {
            "buffer 0": light_array(view.lights, maps),
            "buffer 1": phase_table(view.medium.phase),
        }
        settings = {
            each.name: getattr(self, each.name) for each in self.shader.parameters if each.uniform
        }
        # A shader without memory, or at its first frame, begins again and draws as many frames as
        # its history needs.
        first = not self.carries or view.carried is None
        request = {
            "reset": first,
            "frames": self.shader.frames if first else 1,
            "uniforms": uniforms(view) | settings,
        }
        said, image = host.ask("frame", arrays, **request)
        self.shader.check_unset(said["unset"])
        # Rows are turned round: row 0 of OpenGL is the lowest.
        wrong = ~np.isfinite(image[::-1]).all(axis=2)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            ray = arrays["texture al_rays"][::-1][row, column]
            raise InputError(
                f"method {self.name}: {int(wrong.sum())} of {wrong.size} pixels are not finite, "
                "the first in column "
                f"{column} of row {row}, ray.direction = ({ray[0]:.6g}, {ray[1]:.6g}, "
                f"{ray[2]:.6g}), ray.distance = "
                f"{abs(ray[3]):.6g}"
            )
        # The whole image comes back; the view takes its own pixels. `carried` only says that a
        # frame was drawn: images of the last one stay with the host.
        lanes = image[::-1].reshape(-1, 3)[np.array(view.pixel)]
        return Layers(
            checked_radiance(lanes, view, self.name), carried=mi.UInt32(1) if self.carries else None
        )


def shader_method(name: str) -> type[Method]:
    """Return a shader as a method; `name` is the path of its file.

    Raises
    ------
    InputError
        As `realtime.methods.shader.source.read_shader`.
    """
    source = read_shader(Path(name))
    fields: list[Any] = [
        (each.name, type(each.default), parameter(each.default, each.help))
        for each in source.parameters
    ]
    check_names(name, (each.name for each in source.parameters), Shader)
    what = {"name": name, "source": str(source.path), "shader": source, "shadows": source.shadows}
    return make_dataclass("UserShader", fields, bases=(Shader,), frozen=True, namespace=what)


def drawn_again(state: Any, seconds: float) -> tuple[str, list[float]]:
    """Return the name of the device that draws, and times of the same frame there again [ms].

    `state`: the state of a shader that has drawn a frame; `seconds`: how long to draw.
    """
    host, _ = state
    said, _ = host.ask("again", seconds=seconds)
    return host.device, said["ms"]
