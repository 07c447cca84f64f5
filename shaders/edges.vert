#version 330
uniform mat4 view;
uniform mat4 projection;
in vec3 position;
void main() {
    gl_Position = projection * view * vec4(position, 1.0);
    // A hair nearer than the surface, so that the lines are not buried in it.
    gl_Position.z -= 2e-4 * gl_Position.w;
}
