// The surface at the texel's centre, which lies in the face or on its edge.  Barycentric coordinates come from differences
// to the centre, not from interpolation, which would lose digits far from the image's corner; what snapping leaves outside
// the face is clamped into it.

const float LEAST = 1.0 / 1048576.0;  // by this the inside of a face differs from its edges, where one weight is 0

float cross2(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

bool inside(ivec2 centre) {
    ivec2 a = snapped(texel0), b = snapped(texel1), c = snapped(texel2);
    int turn = cross_sign(b - a, c - a);
    return turn != 0 && turn * cross_sign(b - a, centre - a) >= 0 && turn * cross_sign(c - b, centre - b) >= 0
        && turn * cross_sign(a - c, centre - c) >= 0;
}

void main() {
    ivec2 texel = image_texel();
    if (!inside(256 * texel + 128)) discard;
    vec2 centre = vec2(texel) + 0.5;
    vec2 a = texel0 - centre, b = texel1 - centre, c = texel2 - centre;
    float area = cross2(texel1 - texel0, texel2 - texel0);
    vec3 weight = max(vec3(cross2(b, c), cross2(c, a), cross2(a, b)) * sign(area), 0.0);
    float total = weight.x + weight.y + weight.z;
    weight = total > 0.0 ? max(weight / total, LEAST) : vec3(1.0 / 3.0);
    weight /= weight.x + weight.y + weight.z;
    write_surface(weight, weight.yz);
}
