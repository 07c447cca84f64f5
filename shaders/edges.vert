#version 330
uniform mat4 view;
uniform mat4 projection;
in vec3 position;
void main() {
    gl_Position = projection * view * vec4(position, 1.0);
    // Slightly nearer than the surface, which would otherwise hide the lines.
    gl_Position.z -= 2e-4 * gl_Position.w;
}
