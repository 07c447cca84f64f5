#version 330
//#include common.glsl
out vec4 colour;
void main() {
    colour = vec4(display(backdrop(gl_FragCoord.xy), gl_FragCoord.xy), 1.0);
}
