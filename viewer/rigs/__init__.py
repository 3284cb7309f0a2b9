"""The mathematics of skinned characters: numpy, float64, no files, no OpenGL."""
