// Every texel whose centre lies in a face.  No attributes: three vertices a face, everything else is fetched.

flat out vec3 position0, position1, position2;
flat out vec3 normal0, normal1, normal2;
flat out vec2 texel0, texel1, texel2;
flat out int face;

void main() {
    face = gl_VertexID / 3;
    Triangle triangle = fetch_triangle(face);
    position0 = triangle.position[0]; position1 = triangle.position[1]; position2 = triangle.position[2];
    normal0 = triangle.normal[0]; normal1 = triangle.normal[1]; normal2 = triangle.normal[2];
    texel0 = triangle.texel[0]; texel1 = triangle.texel[1]; texel2 = triangle.texel[2];
    gl_Position = clip_position(triangle.texel[gl_VertexID % 3]);
    gl_Position.z = -1.0;  // depth 0: the first face wins, and no border texel comes before it
}
