#version 330
// Writes depth only.

void main() {}
