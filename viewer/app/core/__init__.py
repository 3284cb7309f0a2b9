"""Core of the window: scene, camera, time, history and messages; independent of features."""
