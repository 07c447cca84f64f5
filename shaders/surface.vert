#version 330
uniform mat4 view;
uniform mat4 projection;
in vec3 position;
in vec3 normal;
in vec2 uv;
#ifdef EXPRESSION_LINES
in vec3 line_coordinates;  // coordinates in the map of expression lines, and 1 for skin with lines
uniform sampler2D line_strengths;
out vec2 line_place;
out vec2 line_strength;
#endif
out vec3 eye_position;
out vec3 eye_normal;
out vec3 world_normal;
out vec2 texture_uv;
out vec3 world_position;
// Adjacent triangles with and without expression lines must coincide at their edges.
invariant gl_Position;
void main() {
    vec4 seen = view * vec4(position, 1.0);
    eye_position = seen.xyz;
    eye_normal = mat3(view) * normal;
    world_normal = normal;
    texture_uv = uv;
    world_position = position;
#ifdef EXPRESSION_LINES
    line_place = line_coordinates.xy;
    line_strength = line_coordinates.z * textureLod(line_strengths, line_place, 0.0).rg;
#endif
    gl_Position = projection * seen;
}
