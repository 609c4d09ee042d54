// The surface at the point of the border edge that is nearest to the texel's centre; the nearest edge wins by depth.

uniform float reach;

flat in int turn;

float square_length(ivec2 place) {
    return float(place.x) * float(place.x) + float(place.y) * float(place.y);
}

// Squared distance of the centre to the edge, in 1/256 texels; below 0 for "far".
float square_distance(ivec2 centre) {
    ivec2 a = snapped(texel0), b = snapped(texel1);
    ivec2 along = b - a;
    if (dot_sign(along, centre - a) <= 0) return square_length(centre - a);
    if (dot_sign(along, centre - b) >= 0) return square_length(centre - b);
    if (abs(rough_cross(along, centre - a)) > SURE) return -1.0;
    float height = float(along.x * (centre.y - a.y) - along.y * (centre.x - a.x));
    return height * height / square_length(along);
}

void main() {
    ivec2 texel = image_texel();
    float square = square_distance(256 * texel + 128);
    if (square < 0.0 || square > 65536.0 * reach * reach) discard;
    gl_FragDepth = (floor(8.0 * square) + 1.0) / 524288.0;  // above 0: a texel whose centre is inside a face keeps it
    vec2 along = texel1 - texel0;
    float len = dot(along, along);
    float t = len > 0.0 ? clamp(dot(vec2(texel) + 0.5 - texel0, along) / len, 0.0, 1.0) : 0.0;
    vec3 weight = vec3(1.0 - t, t, 0.0);
    // weight of corner `turn` is 1 - t and of the next one t: turn back to the face's own order
    write_surface(weight, turn == 0 ? vec2(t, 0.0) : turn == 1 ? vec2(1.0 - t, t) : vec2(0.0, 1.0 - t));
}
