// Expression lines of the skin: a height over the surface that tilts its normal, and what its valleys shade.
uniform bool lines;
uniform sampler2D line_heights;  // centimetres, by layer
in vec2 line_place;     // where it lies in that map
in vec2 line_strength;  // factors on its layers

// Return the normal n at a position in camera space with the lines in it; depth is that of a valley in centimetres.
// Surface gradient from screen-space derivatives (Mikkelsen 2010); the slope is taken from the map itself, because
// differences of heights between pixels would show their blocks.
vec3 with_expression_lines(vec3 n, vec3 position, out float depth) {
    vec3 px = dFdx(position), py = dFdy(position);
    vec2 sx = dFdx(line_place), sy = dFdy(line_place);
    depth = 0.0;
    if (!lines || max(line_strength.x, line_strength.y) <= 0.0) return n;
    vec2 texels = vec2(textureSize(line_heights, 0));
    vec2 fx = sx * texels, fy = sy * texels;
    // A little sharper than the pixels: in small pictures the lines would fade.
    float lod = max(0.25 * log2(max(dot(fx, fx) * dot(fy, fy), 1e-12)) - 0.6, 0.0);
    vec2 reach = exp2(lod) / texels;
    float east = dot(textureLod(line_heights, line_place + vec2(reach.x, 0.0), lod).rg, line_strength);
    float west = dot(textureLod(line_heights, line_place - vec2(reach.x, 0.0), lod).rg, line_strength);
    float north = dot(textureLod(line_heights, line_place + vec2(0.0, reach.y), lod).rg, line_strength);
    float south = dot(textureLod(line_heights, line_place - vec2(0.0, reach.y), lod).rg, line_strength);
    depth = max(-0.25 * (east + west + north + south), 0.0);
    vec2 slope = 0.5 * vec2(east - west, north - south) / reach;
    vec3 rx = cross(py, n), ry = cross(n, px);
    float area = dot(px, rx);
    vec3 gradient = sign(area) * (rx * dot(slope, sx) + ry * dot(slope, sy));
    vec3 tilted = abs(area) * n - gradient;
    return dot(tilted, tilted) > 0.0 ? normalize(tilted) : n;
}
