// Few steps a ray at half the resolution, shifted by a pattern of 4 x 4 pixels, then a blur that keeps edges.
#pragma airlight set STEPS 16 "points on a ray"
#pragma airlight pass coarse size=W/2xH/2 format=rgba16f

vec4 coarse(Ray ray) {
    float shift = (float((ray.pixel.x & 3) * 4 + ((ray.pixel.y * 2 + ray.pixel.x) & 3)) + 0.5) / 16.0;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < lights.length(); ++i) {
        Light light = lights[i];
        vec3 to = light.position - ray.origin;
        float foot = dot(to, ray.direction), h = max(length(cross(to, ray.direction)), 1e-5 * length(to));
        float a = atan(-foot, h), width = (atan(ray.distance - foot, h) - a) / float(STEPS);
        for (int k = 0; k < STEPS; ++k) {
            float s = h * tan(a + (float(k) + shift) * width), r = length(vec2(s, h));
            vec3 point = ray.origin + (foot + s) * ray.direction;
            vec3 arriving = irradiance(light, point) * visible(light, point) * exp(-medium.sigma_t * (foot + s + r));
            sum += medium.sigma_s * phase(-s / r) * arriving * (width * r * r / h);
        }
    }
    return vec4(sum, ray.distance);
}

vec3 airlight(Ray ray) {
    vec2 at = (vec2(ray.pixel) + 0.5) * 0.5;
    vec4 total = vec4(0.0);
    for (int y = -2; y < 2; ++y)
        for (int x = -2; x < 2; ++x) {
            ivec2 texel = clamp(ivec2(floor(at + 0.5)) + ivec2(x, y), ivec2(0), (resolution + 1) / 2 - 1);
            vec4 c = texelFetch(coarse_image, texel, 0);
            float weight = exp(-16.0 * abs(c.a - ray.distance) / ray.distance) + 1e-6;
            total += weight * vec4(c.rgb, 1.0);
        }
    return total.rgb / total.a;
}
