"""View: camera, display settings, lights, statistics and picking."""
