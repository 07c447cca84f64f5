#version 330
//#include common.glsl
// Materials: 0 clay, 1 skin, 2 eye, 3 teeth, 4 gums, 5 tongue, 6 lashes.
uniform mat4 view;
uniform int material;
uniform bool textured;
uniform sampler2D image;
uniform vec3 base;
uniform vec2 mouth;  // height of the upper teeth's edges, and how far forward the teeth reach
uniform bool over_photo;  // whether what fades shows a photo instead of the backdrop
uniform vec2 neck;  // heights between which the cut of the neck fades into the backdrop

in vec3 eye_position;
in vec3 eye_normal;
in vec3 world_normal;
in vec2 texture_uv;
in vec3 world_position;
out vec4 colour;

struct Light { vec3 direction; vec3 colour; };
// A portrait light that goes with the camera; camera space has y down and z forward.
const Light KEY = Light(vec3(-0.46, -0.60, -0.66), vec3(1.00, 0.95, 0.88) * 2.35);
const Light FILL = Light(vec3(0.78, -0.12, -0.61), vec3(0.80, 0.90, 1.00) * 0.62);
const Light RIM = Light(vec3(0.55, -0.45, 0.70), vec3(0.85, 0.92, 1.00) * 0.95);

vec3 ambient(vec3 n) {
    float up = 0.5 - 0.5 * n.y;
    return mix(vec3(0.150, 0.120, 0.105), vec3(0.300, 0.320, 0.360), up);
}

// Light that has gone through flesh turns the edge of the shadow red: each channel wraps round by another amount.
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

void main() {
    vec3 v = normalize(-eye_position);
    vec3 n = normalize(eye_normal);
    vec4 texel = textured ? texture(image, texture_uv) : vec4(1.0);
    vec3 albedo = textured ? pow(texel.rgb, vec3(2.2)) : base;
    float alpha = material == 6 ? texel.a : 1.0;
    // Where skin is as dark a red as the inside of the mouth.
    float outside = material == 1 ? smoothstep(0.015, 0.060, albedo.g) : 1.0;
    float lining = (1.0 - outside) * smoothstep(4.0, 6.0, albedo.r / max(albedo.g, 0.001));
    if (!gl_FrontFacing) n = -n;

    vec3 wrap = material == 1 ? vec3(0.42, 0.20, 0.14) : vec3(material == 2 ? 0.35 : 0.12);
    vec3 lit = ambient(n);
    lit += wrapped(dot(n, KEY.direction), wrap) * KEY.colour * 0.42;
    lit += wrapped(dot(n, FILL.direction), wrap) * FILL.colour * 0.42;

    float roughness = 0.48, f0 = 0.030, gloss = 1.0, inside = 1.0;
    if (material == 0) { roughness = 0.55; gloss = 0.7; }
    else if (material == 2) { roughness = 0.16; f0 = 0.030; }
    else if (material == 3) { roughness = 0.22; inside = 0.92; }
    else if (material == 4) { roughness = 0.28; inside = 0.84; }
    else if (material == 5) { roughness = 0.36; inside = 0.84; }
    else if (material == 6) { gloss = 0.0; }
    float facing = max(dot(n, v), 0.0);
    // How deep in the mouth a place is: less where the jaw has taken it down to the light.
    float depth = mouth.y - world_position.z + 0.6 * min(world_position.y - mouth.x, 0.0);
    float behind = smoothstep(0.4, 5.5, depth);
    // Lids shade the upper eyeball, lips what is in the mouth.
    if (material == 2) inside = 1.0 - 0.50 * smoothstep(0.10, 0.85, world_normal.y);
    if (material >= 3 && material <= 5) {
        inside *= mix(0.6, 1.0, facing) * mix(1.0, 0.28, behind);
        gloss = 1.0 - 0.9 * behind;
    }

    vec3 shine = vec3(0.0);
    shine += glossy(n, v, KEY.direction, roughness, f0) * KEY.colour;
    shine += glossy(n, v, FILL.direction, roughness, f0) * FILL.colour;
    // A soft box mirrored by the wet eye: what makes it look alive. It lies where lids leave it free.
    if (material == 2) {
        vec3 mirrored = reflect(-v, n);
        float box = smoothstep(0.962, 0.980, dot(mirrored, normalize(vec3(-0.40, -0.34, -0.85))));
        float low = smoothstep(0.90, 0.99, dot(mirrored, normalize(vec3(0.42, 0.36, -0.83))));
        shine = shine * 0.3 + vec3(0.95, 0.97, 1.0) * (1.15 * box + 0.10 * low);
    }
    vec3 edge = RIM.colour * pow(1.0 - facing, 3.0) * max(dot(n, RIM.direction), 0.0) * (material <= 1 ? 0.55 : 0.0);

    // In the mouth and between the lips no light comes from behind, and in the mouth little from before.
    edge *= outside * (material == 1 ? 1.0 - smoothstep(2.2, 2.9, albedo.r / max(albedo.g, 0.001)) : 1.0);
    shine *= mix(0.25, 1.0, outside);
    inside *= mix(1.0, 0.28, behind * lining);
    vec3 linear = (albedo * lit + (shine + edge) * gloss) * inside;
    // The inner side of the skin is seen from below, where the neck is cut; elsewhere it is a fold that turns over.
    if (!gl_FrontFacing && material <= 1) {
        float from_below = smoothstep(0.05, 0.30, -(transpose(mat3(view)) * v).y);
        linear = mix(0.75 * linear, vec3(0.014, 0.013, 0.013), from_below);
    }
    float fade = material <= 1 ? smoothstep(neck.x, neck.y, world_position.y) : 1.0;
    if (over_photo) colour = vec4(display(linear, gl_FragCoord.xy), alpha * fade);
    else colour = vec4(display(mix(backdrop(gl_FragCoord.xy), linear, fade), gl_FragCoord.xy), alpha);
}
