# SPDX-License-Identifier: BSD-3-Clause
"""The process in which OpenGL draws: it imports nothing of ours that loads Mitsuba or Dr.Jit.

A message is its kind, names with values, and names with arrays; an answer is names with
values, and an image or None:

    open    stages, each with name, text, kind ('picture', '2d', '3d'), size, format, and the words that it uses
    frame   arrays, and how many frames to draw, after forgetting the last ones if `reset`; the answer has the names of
            the shader that nothing sets
    again   draws the same for some seconds, and answers with the time of each frame

Where the processor draws, a time is the wall clock's from the first call to the end of `finish()`,
as the timer queries of llvmpipe are wrong. On a GPU a timer query measures it.
"""

import signal
import sys
import time
from typing import Any

import numpy as np

from airlight.realtime.child_process import connection_to_caller, method_limit

_SOFTWARE = ("llvmpipe", "softpipe", "SwiftShader")
_TARGETS = {"rgba16f": (4, "f2"), "rgba32f": (4, "f4"), "r32f": (1, "f4")}
# beside the uniforms and arrays of a message
_GIVEN = ("frame", "al_size", "al_target", "AlLights", "AlPhase")
_VERTICES = """#version 430 core
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
"""


class Host:
    """A context, the programs of a shader, and what they read and write."""

    def __init__(self) -> None:
        import moderngl

        self.error = moderngl.Error
        options = (
            {"libegl": "libEGL.so.1", "libgl": "libGL.so.1"} if sys.platform == "linux" else {}
        )
        backend = {"backend": "egl"} if sys.platform == "linux" else {}
        self.context = moderngl.create_context(standalone=True, require=430, **backend, **options)
        name = self.context.info["GL_RENDERER"]
        self.device = {"device": name, "version": self.context.info["GL_VERSION"]}
        self.query = (
            None if any(word in name for word in _SOFTWARE) else self.context.query(time=True)
        )
        self.stages: list[Any] = []
        self.programs: list[Any] = []
        # by stage an image and its framebuffer; of a pass, those of the last frame too
        self.targets: list[Any] = []
        self.textures: dict[str, Any] = {}
        self.uniforms: dict[str, Any] = {}
        self.frame = 0

    def open(self, message, arrays):
        """Compile all stages and make their images."""
        # A stage that does not compile ends the work: its log is the answer.
        self.stages = message["stages"]
        for stage in self.stages:
            try:
                if stage["kind"] == "3d":
                    self.programs.append((self.context.compute_shader(stage["text"]), None))
                else:
                    program = self.context.program(
                        vertex_shader=_VERTICES, fragment_shader=stage["text"]
                    )
                    self.programs.append((program, self.context.vertex_array(program, [])))
            except self.error as error:
                return {"log": str(error)}, None
            # The picture has one image; a pass has two that take turns, so that one holds the last
            # frame.
            self.targets.append(
                [self._image(stage) for _ in range(1 if stage["kind"] == "picture" else 2)]
            )
        return self.device, None

    def _image(self, stage):
        """Return a black image, and the framebuffer that draws into it."""
        channels, kind = _TARGETS[stage["format"]]
        size = tuple(stage["size"])
        zeros = np.zeros((*size[::-1], channels), dtype=kind).tobytes()
        if stage["kind"] == "3d":
            image, buffer = self.context.texture3d(size, channels, zeros, dtype=kind), None
        else:
            image = self.context.texture(size, channels, zeros, dtype=kind)
            buffer = self.context.framebuffer([image])
        # Images end at their border, and do not begin again on the other side.
        for axis in "xyz"[: len(size)]:
            setattr(image, f"repeat_{axis}", False)
        return image, buffer

    def take(self, arrays):
        """Bring arrays to the device: textures, buffers, and the rest as uniforms."""
        for name, array in arrays.items():
            if name.startswith("buffer"):
                # The binding may not be empty: a light or a table that is
                # not there has one of zeros.
                self.context.buffer(array.tobytes() or bytes(128)).bind_to_storage_buffer(
                    int(name[-1])
                )
            else:
                kind, sampler = name.split()
                # The texture of the last call may have another size: it is released.
                if sampler in self.textures:
                    self.textures.pop(sampler).release()
                if kind == "layers":
                    texture = self.context.texture_array(
                        array.shape[::-1], 1, array.tobytes(), dtype="f4"
                    )
                else:
                    texture = self.context.texture(
                        array.shape[1::-1], 4, array.tobytes(), dtype="f4"
                    )
                # nearest: what lies between two surfaces is nothing
                texture.filter = (0x2600, 0x2600)
                self.textures[sampler] = texture

    def draw(self, uniforms):
        """Draw one frame, and return the time that it took [ms]."""
        self.context.finish()
        begin = time.perf_counter()
        if self.query is None:
            self._stages(uniforms)
        else:
            with self.query:
                self._stages(uniforms)
        self.context.finish()
        took = (
            1e3 * (time.perf_counter() - begin) if self.query is None else 1e-6 * self.query.elapsed
        )
        self.frame += 1
        return took

    def _unset(self):
        """Return the uniforms, samplers and buffers that the programs
        read and nothing here sets.
        """
        images = {
            f"{stage['name']}_{end}" for stage in self.stages[:-1] for end in ("image", "last")
        }
        given = {*self.uniforms, *self.textures, *images, *_GIVEN}
        names = (
            name for program, _ in self.programs for name in program if not name.startswith("gl_")
        )
        return sorted({*names} - given)

    def _stages(self, uniforms):
        now, last = self.frame & 1, 1 - (self.frame & 1)
        for number, (stage, (program, triangle)) in enumerate(
            zip(self.stages, self.programs, strict=True)
        ):
            textures = dict(self.textures)
            for other, producer in enumerate(self.stages[:-1]):
                # A stage that is not drawn yet in this frame shows the last frame.
                textures[f"{producer['name']}_image"] = self.targets[other][
                    now if other < number else last
                ][0]
                textures[f"{producer['name']}_last"] = self.targets[other][last][0]
            # Textures that the program reads take one unit each, in turn.
            unit = 0
            for name, texture in textures.items():
                if name in program:
                    texture.use(unit)
                    program[name].value = unit
                    unit += 1
            size = (*stage["size"], 1)[:3]
            for name, value in {**uniforms, "frame": self.frame, "al_size": size}.items():
                if name in program:
                    program[name].value = tuple(value) if isinstance(value, list) else value
            # A pass draws into the image of its two that is not the last frame's.
            image, buffer = self.targets[number][0 if stage["kind"] == "picture" else now]
            # A pass in 3D is a compute shader in groups of 4 x 4 x 4, as the prelude says; the
            # barrier lets later stages read what it wrote.
            if buffer is None:
                image.bind_to_image(0, read=False, write=True)
                program.run(*(-(-side // 4) for side in size))
                self.context.memory_barrier()
            else:
                buffer.use()
                triangle.render(vertices=3)

    def draw_frames(self, message, arrays):
        """Draw frames and return the last."""
        self.take(arrays)
        self.uniforms = message["uniforms"]
        # A history begins with black images and frame 0.
        if message["reset"]:
            self.frame = 0
            for stage, targets in zip(self.stages[:-1], self.targets[:-1], strict=True):
                for image, _ in targets:
                    channels, kind = _TARGETS[stage["format"]]
                    image.write(np.zeros((*stage["size"][::-1], channels), dtype=kind).tobytes())
        times = [self.draw(self.uniforms) for _ in range(message["frames"])]
        image, _ = self.targets[-1][0]
        width, height = self.stages[-1]["size"]
        # Rows from the lowest on, as OpenGL has them; alpha is left out.
        pixels = np.frombuffer(image.read(), dtype=np.float32).reshape(height, width, 4)
        return {"ms": times, "unset": self._unset()}, pixels[..., :3]

    def again(self, message, arrays):
        """Draw the same for some seconds, at least three times."""
        end, times = time.perf_counter() + message["seconds"], list[float]()
        while len(times) < 3 or time.perf_counter() < end:
            times.append(self.draw(self.uniforms))
        return {"ms": times}, None


def main():
    """Answer until nobody asks."""
    caller, host = connection_to_caller(), None
    limit = int(method_limit()) + 2
    try:
        host = Host()
    except Exception as error:  # whatever a driver, or its absence, raises
        missing = " ".join(str(error).split()) or type(error).__name__
    while True:
        try:
            kind, message, arrays = caller.recv()
        except EOFError:
            return
        # Without a driver each message has the same answer, so that the caller can name the reason.
        if host is None:
            caller.send(({"missing": missing}, None))
            continue
        # A driver that never returns may hold Python's lock: no thread
        # could end it with its caller.
        signal.alarm(limit)
        work = {"open": host.open, "frame": host.draw_frames, "again": host.again}[kind]
        answer = work(message, arrays)
        signal.alarm(0)
        caller.send(answer)


if __name__ == "__main__":
    main()
