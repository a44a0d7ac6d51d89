"""The right-hand sides of scenes, their Jacobians and works, compiled for lanes."""
