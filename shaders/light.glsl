// Lighting of all materials; included after common.glsl in fragment shaders.

struct Light { vec3 direction; vec3 colour; };
// Portrait light fixed to the camera; camera space has y down and z forward.
const Light KEY = Light(vec3(-0.46, -0.60, -0.66), vec3(1.00, 0.95, 0.88) * 2.35);
const Light FILL = Light(vec3(0.78, -0.12, -0.61), vec3(0.80, 0.90, 1.00) * 0.62);
const Light RIM = Light(vec3(0.55, -0.45, 0.70), vec3(0.85, 0.92, 1.00) * 0.95);

// Factors of the key light and the ambient light.
uniform vec2 strength;

vec3 key_colour() {
    return KEY.colour * strength.x;
}

vec3 ambient(vec3 n) {
    float up = 0.5 - 0.5 * n.y;
    return mix(vec3(0.150, 0.120, 0.105), vec3(0.300, 0.320, 0.360), up) * strength.y;
}

// Subsurface scattering reddens the edge of the shadow: each channel wraps around by a different amount.
vec3 wrapped(float cosine, vec3 wrap) {
    vec3 lit = clamp((vec3(cosine) + wrap) / (1.0 + wrap), 0.0, 1.0);
    return lit * lit * (vec3(3.0) - 2.0 * lit) * 0.35 + lit * 0.65;
}

float glossy(vec3 n, vec3 v, vec3 l, float roughness, float f0) {
    vec3 h = normalize(l + v);
    float nh = max(dot(n, h), 0.0), nl = max(dot(n, l), 0.0), nv = max(dot(n, v), 0.05);
    float a = roughness * roughness, a2 = a * a;
    float d = nh * nh * (a2 - 1.0) + 1.0;
    float distribution = a2 / (3.14159 * d * d);
    float k = 0.5 * a;
    float shadowing = 1.0 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k) * 4.0);
    float fresnel = f0 + (1.0 - f0) * pow(1.0 - max(dot(v, h), 0.0), 5.0);
    return distribution * shadowing * fresnel * nl;
}

// Thin rim light along the outline; none where a smooth normal faces away from the camera.
vec3 rim_light(vec3 n, vec3 v) {
    float facing = dot(n, v);
    float outline = pow(1.0 - clamp(facing, 0.0, 1.0), 3.5) * smoothstep(-0.25, 0.10, facing);
    return RIM.colour * outline * max(dot(n, RIM.direction), 0.0) * 0.30;
}
