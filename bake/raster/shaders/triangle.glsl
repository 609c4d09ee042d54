// One surface triangle as the rasterizing shaders see it, fetched by face number from the texture `corners`.
//
// corners: RGBA32F, two texels a corner, three corners a face, faces in reading order:
//          (position.xyz, x) and (normal.xyz, y), where x and y are the corner's place in the image, in texels,
//          y down, so that row 0 of the target is the top of the image.
// A draw fills one window of the image: texels origin to origin + window.

struct Triangle {
    vec3 position[3];
    vec3 normal[3];
    vec2 texel[3];
};

uniform sampler2D corners;
uniform ivec2 origin;
uniform ivec2 window;

vec4 corner_texel(int index) {
    int width = textureSize(corners, 0).x;
    return texelFetch(corners, ivec2(index % width, index / width), 0);
}

Triangle fetch_triangle(int face) {
    Triangle triangle;
    for (int i = 0; i < 3; i++) {
        vec4 first = corner_texel(6 * face + 2 * i);
        vec4 second = corner_texel(6 * face + 2 * i + 1);
        triangle.position[i] = first.xyz;
        triangle.normal[i] = second.xyz;
        triangle.texel[i] = vec2(first.w, second.w);
    }
    return triangle;
}

vec4 clip_position(vec2 texel) {
    return vec4((texel - vec2(origin)) / vec2(window) * 2.0 - 1.0, -1.0, 1.0);
}
