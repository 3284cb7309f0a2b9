"""Core of the window: scene, selection, camera, time, history and messages. Knows no feature."""
