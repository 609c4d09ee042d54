// The surface at the texel's centre.  Barycentric coordinates come from differences to the centre, not from interpolation,
// which would lose digits far from the image's corner; what rounding leaves outside the face is clamped into it.

float cross2(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

void main() {
    vec2 a = texel0 - gl_FragCoord.xy, b = texel1 - gl_FragCoord.xy, c = texel2 - gl_FragCoord.xy;
    float area = cross2(texel1 - texel0, texel2 - texel0);
    vec3 weight = max(vec3(cross2(b, c), cross2(c, a), cross2(a, b)) * sign(area), 0.0);
    float total = weight.x + weight.y + weight.z;
    weight = total > 0.0 ? weight / total : vec3(1.0 / 3.0);
    write_surface(weight, weight.yz);
}
