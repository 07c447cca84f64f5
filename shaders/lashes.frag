#version 330
//#include common.glsl
// Lashes: hairs darker than what is behind them from every side.
uniform sampler2D image;
uniform bool textured;
uniform vec3 base;
uniform float seen;  // opacity of all of them

in vec2 texture_uv;
out vec4 colour;

void main() {
    vec4 texel = textured ? texture(image, texture_uv) : vec4(base, 1.0);
    // Hairs finer than a pixel pale in the mean of what they cover; seen together they are as dark as one of them.
    vec2 size = vec2(textureSize(image, 0));
    float pixel = max(length(dFdx(texture_uv) * size), length(dFdy(texture_uv) * size));
    float alpha = textured ? 1.0 - pow(1.0 - texel.a, 1.0 + 0.40 * log2(max(pixel, 1.0))) : 1.0;
    vec3 dark = textured ? 0.5 * pow(texel.rgb, vec3(2.2)) : base;
    colour = vec4(display(dark, gl_FragCoord.xy), alpha * seen);
}
