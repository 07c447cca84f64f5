#version 330
uniform int first;
out int id;
void main() {
    id = first + gl_PrimitiveID + 1;
}
