"""Version of the program, without importing anything."""

VERSION = "0.10.0"
