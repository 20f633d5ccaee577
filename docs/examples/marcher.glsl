// Steps in the angle at each light, with a shadow map.
#pragma airlight set STEPS 64 "points on a ray"

vec3 airlight(Ray ray) {
    vec3 sum = vec3(0.0);
    for (int i = 0; i < lights.length(); ++i) {
        Light light = lights[i];
        vec3 to = light.position - ray.origin;
        float foot = dot(to, ray.direction), h = max(length(cross(to, ray.direction)), 1e-5 * length(to));
        float a = atan(-foot, h), width = (atan(ray.distance - foot, h) - a) / float(STEPS);
        for (int k = 0; k < STEPS; ++k) {
            float s = h * tan(a + (float(k) + 0.5) * width), r = length(vec2(s, h));
            vec3 point = ray.origin + (foot + s) * ray.direction;
            vec3 arriving = irradiance(light, point) * visible(light, point) * exp(-medium.sigma_t * (foot + s + r));
            sum += medium.sigma_s * phase(-s / r) * arriving * (width * r * r / h);
        }
    }
    return sum;
}
