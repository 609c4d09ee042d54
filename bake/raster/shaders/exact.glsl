// Which texels a triangle or an edge takes, in integers: the same answer on every device, in every window, and in numpy.
//
// Places are snapped to 1/256 texel.  A product of differences may leave 32 bits; then its float estimate, whose error
// is below 2^26, tells the sign.  Else the wrapped integer is the exact value.

const float SURE = 1e9;  // well above 2^26, well below 2^31

ivec2 snapped(vec2 texel) {
    return ivec2(floor(texel * 256.0 + 0.5));
}

float rough_cross(ivec2 a, ivec2 b) {
    return float(a.x) * float(b.y) - float(a.y) * float(b.x);
}

int cross_sign(ivec2 a, ivec2 b) {
    float rough = rough_cross(a, b);
    return abs(rough) > SURE ? int(sign(rough)) : sign(a.x * b.y - a.y * b.x);
}

int dot_sign(ivec2 a, ivec2 b) {
    return cross_sign(a, ivec2(-b.y, b.x));
}
