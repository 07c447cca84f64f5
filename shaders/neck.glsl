// Fading of the neck above its cut.

uniform vec4 neck;  // plane with value 0 at the cut and 1 at the end of the fade
uniform vec4 neck_cut;  // middle of the cut, and the greatest distance of its edge from there

// True if the camera sees a position through the cut of the neck.
bool through_the_cut(vec3 position, vec3 camera) {
    float above = dot(neck.xyz, position) + neck.w, below = -dot(neck.xyz, camera) - neck.w;
    return below > 0.0 && distance(mix(position, camera, above / (above + below)), neck_cut.xyz) < neck_cut.w;
}

// Opacity of the skin at a position, 0 at the cut; the inner side is invisible from below.
float neck_opacity(vec3 position, bool inner, float from_below) {
    float t = clamp(dot(neck.xyz, position) + neck.w, 0.0, 1.0);
    float outer = t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    return inner && neck.w != 1.0 ? outer * (1.0 - from_below) : outer;
}
