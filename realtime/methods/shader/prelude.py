# SPDX-License-Identifier: BSD-3-Clause
"""The text around a user's shader: what it is given before it, and the `main` of a stage behind it.

Row 0 of OpenGL is the lowest: pixels are counted from the lower left here, and images
turned round at the border.

A phase function is given in 1/sr with the integral 1, as engines count it; kernels here have the
mean 1. The formula 1 + g^2 - 2 g c = (1 - |g|)^2 + 2 |g| (1 - sign(g) c) avoids cancellation in a
sharp lobe.

The intensity of a soft spot is linear in the angle from the axis between beam and cut-off, as in
Mitsuba. One arc tangent computes the distance of this angle to the cut-off: a difference of two
would cancel at the dim edge.
"""

from collections.abc import Mapping
from typing import Any

from airlight.realtime.methods.shader.source import OWN_LINES, Pass, ShaderSource
from airlight.realtime.scene.phase import HenyeyGreenstein, Isotropic, Phase, Rayleigh

_GIVEN = """
#define POINT 0
#define SPOT 1
const float AL_PI = 3.14159265;

struct Ray { vec3 origin; vec3 direction; float distance; bool hit; ivec2 pixel; };
struct Light {
    vec3 position; int kind;
    vec3 axis; float cos_cutoff;
    vec3 intensity; float cos_beam;
    vec3 across; int map;
    vec3 up; float sin_cutoff;
    float transition; float al_room0; float al_room1; float al_room2;
};
struct Medium { vec3 sigma_t; vec3 sigma_s; float g; };

layout(std430, binding = 0) readonly buffer AlLights { Light lights[]; };
layout(std430, binding = 1) readonly buffer AlPhase { float al_phase[]; };
uniform Medium medium;
uniform ivec2 resolution;
uniform int frame;
uniform vec3 al_origin, al_forward, al_right, al_up;
uniform sampler2D al_rays, g_normal, g_albedo;
uniform sampler2DArray shadow_maps;

Ray al_pixel_ray(ivec2 pixel) {
    vec4 seen = texelFetch(al_rays, pixel, 0);
    return Ray(al_origin, seen.xyz, abs(seen.w), seen.w > 0.0, pixel);
}

Ray ray_through(vec2 uv) {
    vec2 at = uv * vec2(resolution);
    Ray ray = al_pixel_ray(clamp(ivec2(floor(at)), ivec2(0), resolution - 1));
    at -= 0.5 * vec2(resolution);
    ray.direction = normalize(al_forward + at.x * al_right + at.y * al_up);
    return ray;
}

vec3 irradiance(Light light, vec3 point) {
    vec3 d = point - light.position;
    vec3 full = light.intensity / dot(d, d);
    if (light.kind == POINT) return full;
    float along = dot(light.axis, d), away = length(cross(light.axis, d)), r = length(d);
    if (along <= light.cos_cutoff * r) return vec3(0.0);
    if (light.transition == 0.0) return full;
    float within = atan(light.sin_cutoff * along - light.cos_cutoff * away,
                        light.cos_cutoff * along + light.sin_cutoff * away);
    return full * clamp(within * light.transition, 0.0, 1.0);
}

float visible(Light light, vec3 point) {
    if (light.map < 0) return 1.0;
    vec3 d = point - light.position, size = abs(d);
    int face = 0;
    vec2 at;
    if (light.kind == SPOT) at = vec2(dot(d, light.across), dot(d, light.up)) / dot(d, light.axis);
    else if (size.x >= size.y && size.x >= size.z) { face = d.x < 0.0 ? 1 : 0; at = d.yz / size.x; }
    else if (size.y >= size.z) { face = d.y < 0.0 ? 3 : 2; at = d.zx / size.y; }
    else { face = d.z < 0.0 ? 5 : 4; at = d.xy / size.z; }
    float last = float(textureSize(shadow_maps, 0).x - 1);
    ivec2 texel = ivec2(clamp(0.5 * last * at + 0.5 * (last + 1.0), vec2(0.0), vec2(last)));
    float first = texelFetch(shadow_maps, ivec3(texel, light.map + face), 0).r;
    return dot(d, d) <= first * first ? 1.0 : 0.0;
}

float al_hg(float c, float g) {
    float a = abs(g), b = (1.0 - a) * (1.0 - a) + 2.0 * a * (1.0 - (g < 0.0 ? -c : c));
    return (1.0 - a) * (1.0 + a) / (b * sqrt(b));
}

float al_table(float c) {
    float at = (0.5 + 0.5 * clamp(c, -1.0, 1.0)) * float(al_phase.length() - 1);
    int cell = min(int(at), al_phase.length() - 2);
    return mix(al_phase[cell], al_phase[cell + 1], at - float(cell));
}
"""

_PICTURE = """
out vec4 al_out;
void main() { al_out = vec4(airlight(al_pixel_ray(ivec2(gl_FragCoord.xy))), 1.0); }
"""

_PASS_2D = """
out vec4 al_out;
uniform ivec3 al_size;
void main() {{
    Ray ray = ray_through(gl_FragCoord.xy / vec2(al_size.xy));
    ray.pixel = ivec2(gl_FragCoord.xy);
    al_out = {name}(ray);
}}
"""

_PASS_3D = """
layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;
layout({format}) writeonly uniform image3D al_target;
uniform ivec3 al_size;
void main() {{
    ivec3 cell = ivec3(gl_GlobalInvocationID);
    if (all(lessThan(cell, al_size))) imageStore(al_target, cell, {name}(cell, al_size));
}}
"""


def stage_text(
    source: ShaderSource, phase: str, settings: Mapping[str, Any], stage: Pass | None
) -> str:
    """Return the whole text of a stage: a pass, or None for the picture.

    `phase` is the text of `phase_text`, `settings` are the values of the shader's
    parameters by their names.
    """
    # A parameter is a literal before the text, where another value compiles again, or a uniform.
    given = [
        f"#define {each.name} {_literal(settings[each.name])}"
        for each in source.parameters
        if not each.uniform
    ]
    kinds = {bool: "bool", int: "int", float: "float"}
    given += [
        f"uniform {kinds[type(each.default)]} {each.name};"
        for each in source.parameters
        if each.uniform
    ]
    # The images of every pass, of this frame and of the last, are there for all stages.
    for each in source.passes:
        given.append(f"uniform sampler{len(each.size)}D {each.name}_image, {each.name}_last;")
    if stage is None:
        end = _PICTURE
    else:
        end = (_PASS_2D if len(stage.size) == 2 else _PASS_3D).format(
            name=stage.name, format=stage.format
        )
    # `#version` and extensions must come first. `#line` gives our text the numbers of block 1: from
    # its first line on before the user's text, from its middle on behind it.
    head = ["#version 430 core", *source.extensions, f"#line {OWN_LINES}", _GIVEN, phase, *given]
    return "\n".join([*head, source.text, f"#line {OWN_LINES + 500_000}", end])


def phase_text(phase: Phase) -> str:
    """Return the scene's phase function in GLSL; a table is read from a buffer."""
    if isinstance(phase, Isotropic):
        value = "1.0"
    elif isinstance(phase, Rayleigh):
        value = "0.75 + 0.75 * c * c"
    elif isinstance(phase, HenyeyGreenstein):
        value = "al_hg(c, medium.g)"
    else:
        value = "al_table(c)"
    return f"float phase(float c) {{ return ({value}) / (4.0 * AL_PI); }}"


def _literal(value: bool | int | float) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, int) else f"({value!r})"
