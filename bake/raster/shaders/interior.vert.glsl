// Every texel whose centre lies in a face: the face grown a little on all sides, so that the fragments decide.
// A needle (in_face < 0, number ~in_face), which would grow too long, becomes the rectangle of texels around it, cut to the
// window, in four vertices; else the fourth is not used.

in int in_face;

uniform float growth;  // texels

flat out vec3 position0, position1, position2;
flat out vec3 normal0, normal1, normal2;
flat out vec2 texel0, texel1, texel2;
flat out int face;

vec2 rectangle_corner(int corner) {
    ivec2 a = snapped(texel0), b = snapped(texel1), c = snapped(texel2);
    ivec2 low = (min(min(a, b), c) + 127) >> 8;         // first texel whose centre is not before the face
    ivec2 high = ((max(max(a, b), c) - 128) >> 8) + 1;  // one after the last whose centre is not behind it
    low = clamp(low, origin, origin + window);
    high = clamp(high, low, origin + window);
    return vec2((corner & 1) == 0 ? low.x : high.x, (corner & 2) == 0 ? low.y : high.y);
}

// Grown from the centre of the inscribed circle: all edges move outwards by `growth`.
vec2 grown_corner(int corner) {
    vec2 ab = texel1 - texel0, ac = texel2 - texel0;
    vec3 side = vec3(distance(texel1, texel2), length(ac), length(ab));
    float perimeter = side.x + side.y + side.z;
    vec2 centre = texel0 + (side.y * ab + side.z * ac) / perimeter;
    float radius = abs(ab.x * ac.y - ab.y * ac.x) / perimeter;
    vec2 place = corner == 0 ? texel0 : corner == 1 ? texel1 : texel2;
    return centre + (1.0 + growth / radius) * (place - centre);
}

void main() {
    face = in_face < 0 ? ~in_face : in_face;
    Triangle triangle = fetch_triangle(face);
    position0 = triangle.position[0]; position1 = triangle.position[1]; position2 = triangle.position[2];
    normal0 = triangle.normal[0]; normal1 = triangle.normal[1]; normal2 = triangle.normal[2];
    texel0 = triangle.texel[0]; texel1 = triangle.texel[1]; texel2 = triangle.texel[2];
    int corner = gl_VertexID & 3;
    gl_Position = clip_position(in_face < 0 ? rectangle_corner(corner) : grown_corner(corner));
}
