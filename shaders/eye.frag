#version 330
//#include common.glsl
//#include light.glsl
// Eyeball: sclera and iris under a clear cornea, shaded by the lids, with the catchlight of a soft box.
uniform mat4 view;
uniform bool textured;
uniform sampler2D image;
uniform vec3 base;
uniform vec3 centre;
uniform float radius;
uniform mat3 turn;  // from the neutral pose; its third column is the gaze
uniform bool own_picture;  // true if the texture is seen along the gaze axis, its radius proportional to the angle
uniform vec3 catchlight;  // direction from the centre
uniform vec2 corners;  // azimuths of the corners of the eye
uniform vec2 lids[17];  // elevations of the upper and lower lid margins at azimuths between the corners

in vec3 eye_position;
in vec3 eye_normal;
in vec2 texture_uv;
in vec3 world_position;
out vec4 colour;

const float IRIS = radians(24.0);
// Half the width and half the height of the catchlight.
const vec2 LAMP = radians(vec2(2.5, 2.9));
// Share of the texture's width that spans 100 degrees.
const float REACH = 0.49 / radians(100.0);

// Distances in radians from the upper and lower lid margins, and from the nearer corner.
vec3 gaps(vec3 d) {
    float azimuth = atan(d.x, d.z), elevation = asin(clamp(d.y, -1.0, 1.0));
    float at = (azimuth - corners.x) / (corners.y - corners.x);
    float column = clamp(at, 0.0, 1.0) * 16.0;
    int first = min(int(column), 15);
    vec2 margin = mix(lids[first], lids[first + 1], column - float(first));
    return vec3(margin.x - elevation, elevation - margin.y, min(at, 1.0 - at) * (corners.y - corners.x));
}

// Light not blocked by the lids: the upper lid and its lashes cast a wide shadow, the lower lid hardly any.
float open_share(vec3 gap) {
    float upper = mix(0.30, 1.0, smoothstep(-0.02, 0.19, gap.x)) * mix(0.84, 1.0, smoothstep(0.10, 0.45, gap.x));
    float lower = mix(0.62, 1.0, smoothstep(-0.02, 0.09, gap.y));
    float ends = mix(0.60, 1.0, smoothstep(0.0, 0.22, gap.z));
    return upper * lower * ends;
}

// Texture coordinates of the iris for a ray refracted by the cornea at the unit vector d; the iris is a plane through
// its rim.
vec2 behind_cornea(vec3 local, vec3 normal, vec3 to_camera) {
    vec3 ray = refract(-to_camera, normal, 1.0 / 1.336);
    float depth = local.z - cos(IRIS);
    vec2 met = local.xy + ray.xy * (max(depth, 0.0) / max(-ray.z, 0.25));
    float across = min(length(met), sin(IRIS));
    return 0.5 + met / max(length(met), 1e-5) * asin(across) * REACH;
}

void main() {
    vec3 v = normalize(-eye_position), n = normalize(eye_normal);
    vec3 around = (world_position - centre) / radius;
    vec3 d = normalize(around), gaze = turn[2];
    float angle = acos(clamp(dot(d, gaze), -1.0, 1.0));
    // The cornea has a higher curvature than the eyeball.
    float share = angle / IRIS;
    float tilt = angle * mix(1.6, 1.0, smoothstep(0.80, 1.25, share));
    vec3 aside = d - dot(d, gaze) * gaze;
    vec3 bulged = cos(tilt) * gaze + sin(tilt) * aside / max(length(aside), 1e-5);
    vec3 wet = normalize(mat3(view) * bulged);

    vec2 uv = texture_uv;
    float iris = smoothstep(1.04, 0.92, share);
    if (own_picture && share < 1.0) {
        mat3 back = transpose(turn);
        uv = behind_cornea(back * around, back * bulged, back * (transpose(mat3(view)) * v));
    }
    vec3 albedo = textured ? pow(texture(image, uv).rgb, vec3(2.2)) : base;
    vec3 gap = gaps(d);
    float open = open_share(gap);
    // Flesh at the inner corner; subsurface light of lids and skin reddens the shadows.
    float inner = sign(centre.x) * d.x < 0.0 ? gap.z : 1.0;
    albedo = mix(albedo, vec3(0.42, 0.13, 0.11), 0.7 * smoothstep(0.15, 0.04, inner));
    vec3 shade = pow(vec3(open), vec3(0.86, 1.06, 1.08));

    vec3 wrap = vec3(0.35);
    vec3 lit = ambient(n) + wrapped(dot(n, KEY.direction), wrap) * key_colour() * 0.42;
    lit += wrapped(dot(n, FILL.direction), wrap) * FILL.colour * 0.42;
    // The cornea focuses light on the side of the iris opposite to the light.
    vec3 from_light = transpose(mat3(view)) * KEY.direction;
    lit *= 1.0 + iris * (0.10 - 0.55 * dot(aside, from_light) / sin(IRIS) * 0.5);

    float shine = glossy(wet, v, KEY.direction, 0.22, 0.025) * 0.30 * open * open;
    vec3 linear = albedo * lit * shade + key_colour() * shine;
    // Tear film along the lower lid.
    float tears = smoothstep(0.0, 0.025, gap.y) * smoothstep(0.065, 0.030, gap.y) * smoothstep(0.0, 0.15, gap.z);
    linear += tears * 0.08 * vec3(0.95, 0.97, 1.0) * lit * open;

    // The soft box, upright in camera space.
    vec3 off = mat3(view) * (d - catchlight), normal = mat3(view) * catchlight;
    vec3 right = normalize(cross(vec3(0.0, 1.0, 0.0), normal));
    vec2 across = abs(vec2(dot(off, right), dot(off, cross(normal, right)))) / LAMP;
    float box = pow(pow(across.x, 2.3) + pow(across.y, 2.3), 1.0 / 2.3);
    float edge = max(0.5 * fwidth(box), 0.30);
    float lamp = 1.0 - smoothstep(1.0 - edge, 1.0 + edge, box);
    linear += vec3(0.95, 0.97, 1.0) * (1.15 * lamp + 0.10 * smoothstep(2.6, 0.6, box));
    colour = vec4(display(linear, gl_FragCoord.xy), 1.0);
}
