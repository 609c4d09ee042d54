// No face here: −1, which a clear to floats cannot write into integers.

layout(location = 0) out int out_face;

void main() {
    out_face = -1;
}
