// Functions shared by several shaders; included after the #version line.

uniform vec2 viewport;
// Linear colours of the backdrop at its edge and centre.
uniform vec3 backdrop_rim, backdrop_middle;

// Linear colour of the studio backdrop; pixel in window coordinates.
vec3 backdrop(vec2 pixel) {
    vec2 q = pixel / viewport - vec2(0.5, 0.56);
    q.x *= viewport.x / viewport.y;
    float glow = exp(-2.2 * dot(q, q));
    return mix(backdrop_rim, backdrop_middle, glow);
}

// Tone curve: a soft shoulder over sRGB. The filmic fit of Hejl and Burgess-Dawson has too much contrast for skin.
vec3 display(vec3 linear, vec2 pixel) {
    vec3 x = max(linear, 0.0);
    x = x * (1.0 + x / 6.0) / (1.0 + x * 0.62);
    vec3 srgb = pow(x, vec3(1.0 / 2.2));
    // Noise below one 8-bit step hides banding of the smooth backdrop.
    float noise = fract(sin(dot(floor(pixel), vec2(12.9898, 78.233))) * 43758.5453);
    return srgb + (noise - 0.5) / 255.0;
}
