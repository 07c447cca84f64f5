#version 330
//#include common.glsl
//#include light.glsl
//#include neck.glsl
#ifdef EXPRESSION_LINES
//#include expression_lines.glsl
#endif
// Materials: 0 clay, 1 skin, 3 teeth, 4 gums, 5 tongue; eyes and lashes have their own shaders.
uniform mat4 view;
uniform int material;
uniform bool textured;
uniform sampler2D image;
uniform vec3 base;
uniform vec2 mouth;  // height of the upper teeth's edges, and front of the teeth
uniform bool blended;  // true if faded parts show a photo or transparency instead of the backdrop

in vec3 eye_position;
in vec3 eye_normal;
in vec3 world_normal;
in vec2 texture_uv;
in vec3 world_position;
out vec4 colour;

void main() {
    vec3 v = normalize(-eye_position);
    vec3 n = normalize(eye_normal);
    vec4 texel = textured ? texture(image, texture_uv) : vec4(1.0);
    vec3 albedo = textured ? pow(texel.rgb, vec3(2.2)) : base;
    // Skin with the dark red of the inside of the mouth.
    float outside = material == 1 ? smoothstep(0.015, 0.060, albedo.g) : 1.0;
    float redness = albedo.r / max(albedo.g, 0.001);
    float lining = (1.0 - outside) * smoothstep(4.0, 6.0, redness);
#ifdef EXPRESSION_LINES
    add_expression_lines(eye_position, n, albedo);
#endif
    if (!gl_FrontFacing) n = -n;

    vec3 wrap = material == 1 ? vec3(0.42, 0.20, 0.14) : vec3(0.12);
    vec3 lit = ambient(n);
    lit += wrapped(dot(n, KEY.direction), wrap) * key_colour() * 0.42;
    lit += wrapped(dot(n, FILL.direction), wrap) * FILL.colour * 0.42;

    float roughness = 0.56, f0 = 0.028, gloss = 1.0, inside = 1.0;
    if (material == 0) { roughness = 0.55; gloss = 0.7; }
    else if (material == 3) { roughness = 0.22; inside = 0.92; }
    else if (material == 4) { roughness = 0.28; inside = 0.84; }
    else if (material == 5) { roughness = 0.36; inside = 0.84; }
    float facing = max(dot(n, v), 0.0);
    // Depth inside the mouth, less where the open jaw exposes it to light; the lips shade it.
    float depth = mouth.y - world_position.z + 0.6 * min(world_position.y - mouth.x, 0.0);
    float behind = smoothstep(0.4, 5.5, depth);
    if (material >= 3 && material <= 5) {
        inside *= mix(0.6, 1.0, facing) * mix(1.0, 0.28, behind);
        gloss = 1.0 - 0.9 * behind;
    }

    vec3 shine = vec3(0.0);
    shine += glossy(n, v, KEY.direction, roughness, f0) * key_colour();
    shine += glossy(n, v, FILL.direction, roughness, f0) * FILL.colour;
    vec3 edge = material <= 1 ? rim_light(n, v) : vec3(0.0);

    // Inside the mouth and between the lips there is no light from behind, and inside the mouth little from the front.
    edge *= outside * (material == 1 ? 1.0 - smoothstep(2.2, 2.9, redness) : 1.0);
    shine *= mix(0.25, 1.0, outside);
    inside *= mix(1.0, 0.28, behind * lining);
    vec3 linear = (albedo * lit + (shine + edge) * gloss) * inside;
    // The inner side of the skin is visible from below at the cut of the neck; elsewhere it belongs to a fold.
    mat3 to_world = transpose(mat3(view));
    float from_below = smoothstep(0.05, 0.30, -(to_world * v).y);
    if (neck.w != 1.0 && !through_the_cut(world_position, -(to_world * view[3].xyz))) from_below = 0.0;
    bool inner = !gl_FrontFacing && material <= 1;
    if (inner) linear = mix(0.75 * linear, vec3(0.014, 0.013, 0.013), from_below);
    float fade = material <= 1 ? neck_opacity(world_position, inner, from_below) : 1.0;
    if (blended) colour = vec4(display(linear, gl_FragCoord.xy), fade);
    else colour = vec4(display(mix(backdrop(gl_FragCoord.xy), linear, fade), gl_FragCoord.xy), 1.0);
}
