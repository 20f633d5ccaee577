// Froxels in three passes: what each cell scatters, its sum from the camera on, a look-up.
#pragma airlight set FAR 40.0 "depth of the last cell [m]"
#pragma airlight pass scattered size=W/4xH/4x64 format=rgba16f
#pragma airlight pass summed size=W/4xH/4x64 format=rgba32f

float depth(float slice) { return FAR * slice * slice; }  // slices from 0 to 1, finer at the camera

vec4 scattered(ivec3 cell, ivec3 cells) {
    Ray ray = ray_through((vec2(cell.xy) + 0.5) / vec2(cells.xy));
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 4; ++k) {  // points in a cell
        float x = depth((float(cell.z) + (float(k) + 0.5) / 4.0) / float(cells.z));
        vec3 point = ray.origin + x * ray.direction;
        for (int i = 0; i < lights.length(); ++i) {
            vec3 to = lights[i].position - point;
            float r = length(to);
            vec3 arriving = irradiance(lights[i], point) * visible(lights[i], point) * exp(-medium.sigma_t * r);
            sum += medium.sigma_s * phase(dot(to, ray.direction) / r) * arriving / 4.0;
        }
    }
    return vec4(sum, 1.0);
}

vec4 summed(ivec3 cell, ivec3 cells) {
    vec3 sum = vec3(0.0);
    for (int z = 0; z <= cell.z; ++z) {
        float x0 = depth(float(z) / float(cells.z)), x1 = depth(float(z + 1) / float(cells.z));
        vec3 kept = (exp(-medium.sigma_t * x0) - exp(-medium.sigma_t * x1)) / medium.sigma_t;
        sum += texelFetch(scattered_image, ivec3(cell.xy, z), 0).rgb * kept;
    }
    return vec4(sum, 1.0);
}

vec3 airlight(Ray ray) {
    float slice = sqrt(min(ray.distance, FAR) / FAR);
    float z = slice * float(textureSize(summed_image, 0).z);
    vec3 at = vec3((vec2(ray.pixel) + 0.5) / vec2(resolution), (z - 0.5) / float(textureSize(summed_image, 0).z));
    return texture(summed_image, at).rgb * min(z, 1.0);  // in the first cell the sum grows from 0
}
