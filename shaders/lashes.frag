#version 330
//#include common.glsl
// Lashes: hairs darker than their background from every side.
uniform sampler2D image;
uniform bool textured;
uniform vec3 base;
uniform float seen;  // opacity of all lashes

in vec2 texture_uv;
out vec4 colour;

void main() {
    vec4 texel = textured ? texture(image, texture_uv) : vec4(base, 1.0);
    // Hairs finer than a pixel would fade in its mean; many together are as dark as one.
    vec2 size = vec2(textureSize(image, 0));
    float pixel = max(length(dFdx(texture_uv) * size), length(dFdy(texture_uv) * size));
    float alpha = textured ? 1.0 - pow(1.0 - texel.a, 1.0 + 0.40 * log2(max(pixel, 1.0))) : 1.0;
    vec3 dark = textured ? 0.5 * pow(texel.rgb, vec3(2.2)) : base;
    colour = vec4(display(dark, gl_FragCoord.xy), alpha * seen);
}
