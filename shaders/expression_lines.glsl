// Expression lines of the skin: a height field that tilts the normal, and the shading of its valleys.
uniform sampler2D line_heights;  // centimetres, by layer
in vec2 line_place;     // coordinates in that map
in vec2 line_strength;  // factors of its layers

// Apply the lines to the normal n and the colour of the skin at a position in camera space.
// Surface gradient from screen-space derivatives (Mikkelsen 2010); the slope is sampled from the map, because
// height differences between pixels would be blocky.
void add_expression_lines(vec3 position, inout vec3 n, inout vec3 albedo) {
    vec3 px = dFdx(position), py = dFdy(position);
    vec2 sx = dFdx(line_place), sy = dFdy(line_place);
    vec2 texels = vec2(textureSize(line_heights, 0));
    vec2 fx = sx * texels, fy = sy * texels;
    // Sharper than the pixels require: otherwise the lines would fade in small images.
    float lod = max(0.25 * log2(max(dot(fx, fx) * dot(fy, fy), 1e-12)) - 0.6, 0.0);
    vec2 reach = exp2(lod) / texels;
    float here = dot(textureLod(line_heights, line_place - 0.5 * reach, lod).rg, line_strength);
    float east = dot(textureLod(line_heights, line_place + vec2(0.5, -0.5) * reach, lod).rg, line_strength);
    float north = dot(textureLod(line_heights, line_place + vec2(-0.5, 0.5) * reach, lod).rg, line_strength);
    vec2 slope = vec2(east - here, north - here) / reach;
    vec3 rx = cross(py, n), ry = cross(n, px);
    float area = dot(px, rx);
    vec3 gradient = sign(area) * (rx * dot(slope, sx) + ry * dot(slope, sy));
    vec3 tilted = abs(area) * n - gradient;
    if (gl_FrontFacing && dot(tilted, tilted) > 0.0) n = normalize(tilted);
    // Less light reaches the bottom of a fold, and subsurface scattering colours it.
    float depth = max(-0.5 * (east + north), 0.0);
    albedo *= mix(vec3(1.0), vec3(0.72, 0.57, 0.53), smoothstep(0.0, 0.115, depth));
}
