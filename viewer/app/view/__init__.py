"""View: how the scene is drawn, from where, and what lies under the pointer."""
