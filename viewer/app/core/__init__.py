"""Application core: scene, camera, time, history and messages; independent of features."""
