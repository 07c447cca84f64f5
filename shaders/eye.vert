#version 330
// Eyes and lashes.
uniform mat4 view;
uniform mat4 projection;
in vec3 position;
in vec3 normal;
in vec2 uv;
out vec3 eye_position;
out vec3 eye_normal;
out vec2 texture_uv;
out vec3 world_position;
void main() {
    vec4 seen = view * vec4(position, 1.0);
    eye_position = seen.xyz;
    eye_normal = mat3(view) * normal;
    texture_uv = uv;
    world_position = position;
    gl_Position = projection * seen;
}
