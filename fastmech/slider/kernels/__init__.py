"""The right-hand sides of scenes and their works, compiled for lanes."""
