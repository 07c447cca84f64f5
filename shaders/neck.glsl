// Fading of the neck above its cut.

uniform vec4 neck;  // plane with value 0 at the cut and 1 at the end of the fade

// Opacity of the skin at a position, 0 at the cut; the inner side is invisible from below.
float neck_opacity(vec3 position, bool inner, float from_below) {
    float t = clamp(dot(neck.xyz, position) + neck.w, 0.0, 1.0);
    float outer = t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    return inner && neck.w != 1.0 ? outer * (1.0 - from_below) : outer;
}
