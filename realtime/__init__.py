# SPDX-License-Identifier: BSD-3-Clause
"""The side under test: real-time single scattering in Dr.Jit, float32 and float64 from one source.

A scene is read once, a method says of each light which radiance the lit media scatter into the
camera rays, and a frame adds that to the surfaces. Mitsuba only reads the scene and casts rays.
Nothing here imports the reference side (`analytic`, `reference`) or what compares both sides.

Rooms:

- `errors.py`: the exceptions for mistakes of the user and for a missing driver;
- `child_process.py`: a process for work that may hang, started, asked and ended;
- `memory.py`: refuses work that needs more memory than the machine, its container or the GPU has;
- `transforms.py`: transforms of Mitsuba's plugins, and which of them lights
  and spheres cannot have;
- `parameters.py`: typed parameters of methods, with defaults, ranges and help;
- `numerics/`: array types, fast functions, Gauss-Legendre nodes;
- `droplets.py`: phase functions of the droplets of fog and clouds;
- `area_lights/`: area lights, and the samples that stand for them;
- `scene/`: camera, lights, phase functions and meshes, read from Mitsuba; the
  features of a scene; what moves;
- `scene/media/`: media; a new one, such as height fog, goes there, and its page
  says what it must write;
- `rays.py`: the geometry of rays and lights, and the cone of a spot;
- `shadow_maps/`: shadow maps and the field of inverse depth over them;
- `image_filters.py`: Gaussian, bilateral and joint bilateral filters of whole
  images, and up-sampling;
- `kernels/`: the airlight integral between two distances along a ray in a homogeneous medium;
- `export/`: kernels as shader code;
- `intervals.py`: the lit intervals of rays and their sum;
- `clouds/`: light scattered more than once;
- `methods/`: the methods, in `methods/interface/` what all of them share with frames, and in
  `methods/published/` what papers do otherwise;
- `frame/`: camera rays, the lit surface, and whole frames, one or the next.

**One frame, from XML to pixel**: the files of this room that `airlight render hall --method
shadow-planes` passes, in this order, as `python docs/tools/frame_path.py hall shadow-planes` lists
them.

1. `scene/read_scene.py` reads what Mitsuba loaded: `scene/camera.py`, `scene/read_media.py` and
   `scene/lights.py` the parts, and `scene/triangle_table.py` what shading needs of triangles.
   Arrays come from `numerics/array_types.py`.
2. `methods/registry.py` finds the class of a name, and `methods/interface/method.py` gives it its
   parameters (`parameters.py`), and later the view of the rays that it renders.
   `methods/interface/media_checks.py` refuses media that it does not render.
3. `frame/renderer.py` records the stages below once for each structure of lights, by
   `numerics/recorded.py`; `frame/light_groups.py` says which lights are rendered together.
4. `methods/shadow_planes/method.py` prepares: `scene/mesh_adjacency.py` reads how triangles hang
   together, `methods/shadow_planes/silhouettes.py` finds the edges that bound shadows, and
   `methods/shadow_planes/plane_table.py` makes planes of them, in wedges of azimuth about the light
   (`numerics/functions.py`).
5. `frame/surface.py` casts the camera rays, and says what the surfaces that they meet send back.
6. `rays.py` says where each ray of the view passes the light, and a spot's cone.
7. `methods/shadow_planes/sweep.py` walks along the planes of each ray and finds its lit intervals
   (`intervals.py`).
8. The medium (`scene/media/medium.py`) is asked for the integral over each interval. A homogeneous
   one calls the kernel, `kernels/exact.py`, which asks the phase function (`scene/phase.py`), and
   that how far a panel may reach (`scene/rule_reach.py`); all others are integrated by
   `scene/media/integrate.py`.
9. The surfaces are lit where the planes say so, the renderer adds up what the lights send, and
   `frame/image.py` brings it to the host; `frame/light_on_ray.py` checks that all of it is finite.

**A frame in Python**, of a built-in scene or of what Mitsuba loads:

    from airlight import METHODS, frame_renderer, load_scene, read_scene, render_frame
    from airlight import KERNELS

    scene = read_scene(load_scene("hall", size=(24, 18)).scene)  # or mi.load_dict(...), "double"
    renderer = frame_renderer(scene, METHODS["shadow-planes"], kernel=KERNELS["exact"])
    airlight = render_frame(renderer).airlight  # dataclasses.replace(renderer, run=1): new noise
    march = frame_renderer(scene, METHODS["ray-march"], steps=400)  # parameters by their names

**A new method** is one file in `methods/` and a line of `_CLASSES` in `methods/registry.py`.
Without that line it is a user's own, `--method FILE.py:Class`:

    from airlight.realtime.methods.interface.marching import marched_steps
    from airlight.realtime.methods.interface.method import Method

    @dataclass(frozen=True)
    class TwoSamples(Method):
        name, summary, source = "two-samples", "two samples a ray", "the author"
        casts_rays, noisy, uses_kernel, by_rays = True, True, False, True

        def airlight(self, view, light, state, kernel):
            rays = view.lit_by(light)
            span = marched_steps(rays, view.distance, 2, "equiangular")
            integral = rays.nothing(dr.width(view.distance))
            for k in range(2):
                x = span.place(span.begin + (k + view.pattern("white", stream=k)) * span.width)
                lit = span.width > 0
                if view.features.shadows:
                    lit &= view.visible(view.at(x), light)
                integral += dr.select(lit, rays.source(x) * span.stretch(x) * span.width, 0)
            return rays.radiance(integral)

- `airlight` returns the radiance that one light scatters into every ray. `rays.airlight(x0, x1)` is
  the integral over lit segments [m] by the `kernel` that `view.lit_by` was given, `rays.source(x)`
  the integrand, and `rays.radiance(value)` makes radiance of either. A parameter is a field of the
  class.
- `marched_steps` has n steps of one `width`, which is 0 where the light cannot reach the ray; a
  sample at x stands for `span.stretch(x) * span.width` metres.
- `view.visible` asks a shadow ray, where anything can cast a shadow. `view.pattern` is a random
  number for each ray, white, blue or interleaved, new in each frame and run; two streams are
  independent.
- The class says what the frame cannot see: whether it asks `visible`, whether it asks for random
  numbers, whether it calls a kernel, whether no ray reads another one's values, and, with a
  `prepare`, what that looks at (`prepared_from`). A method that renders all lights together has a
  `render` and `at_once = True` in place of `airlight`, as `methods/equi_angular.py` does.

**A new medium** is one file in `scene/media/`, whose page lists what it must answer.
`dataclasses.replace(scene, medium=...)` puts it in a scene that was read. Every method of fog then
renders it, except for `light-volumes-2010`, which is of homogeneous fog.

**A new kind of light** is an optional field of `Light` in `scene/lights.py`, whose page says more;
`rays.py` says how its light falls off, and `scene/read_scene.py` makes it of an emitter.
"""
