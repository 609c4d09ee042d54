// Texels near the border of a chart: a rectangle around each border edge, wider than its reach by a texel all round, so
// that the fragments decide.  Four vertices an edge.  The face is turned so that the edge runs from its corner 0 to its
// corner 1.

in ivec2 in_edge;  // face, corner at which the edge starts

uniform float reach;

flat out vec3 position0, position1, position2;
flat out vec3 normal0, normal1, normal2;
flat out vec2 texel0, texel1, texel2;
flat out int face;
flat out int turn;

void main() {
    face = in_edge.x;
    turn = in_edge.y;
    Triangle triangle = fetch_triangle(face);
    int a = turn, b = (turn + 1) % 3, c = (turn + 2) % 3;
    position0 = triangle.position[a]; position1 = triangle.position[b]; position2 = triangle.position[c];
    normal0 = triangle.normal[a]; normal1 = triangle.normal[b]; normal2 = triangle.normal[c];
    texel0 = triangle.texel[a]; texel1 = triangle.texel[b]; texel2 = triangle.texel[c];
    vec2 along = texel1 - texel0;
    along = (reach + 1.0) * (dot(along, along) > 0.0 ? normalize(along) : vec2(1.0, 0.0));
    int corner = gl_VertexID & 3;
    vec2 end = (corner & 1) == 0 ? texel0 - along : texel1 + along;
    gl_Position = clip_position(end + ((corner & 2) == 0 ? -1.0 : 1.0) * vec2(-along.y, along.x));
}
