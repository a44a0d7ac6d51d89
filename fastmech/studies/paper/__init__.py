"""The source paper as the package's first scene: every printed number, table and figure, computed again."""
