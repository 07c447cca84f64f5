#version 330
uniform vec4 line;
out vec4 colour;
void main() {
    colour = line;
}
