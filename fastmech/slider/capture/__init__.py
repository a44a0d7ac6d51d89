"""The capture certificate of scenes: barrier tree, proved cells, observers, steps."""
