#version 330
// The photo has its top row first, and is shown without lighting.
uniform sampler2D image;
uniform float opacity;
in vec2 uv;
out vec4 colour;
void main() {
    colour = vec4(texture(image, uv).rgb, opacity);
}
