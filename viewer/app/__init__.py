"""The window and its panels; the only importer of glfw and Dear ImGui."""
