"""Long scans as tiles: computed anywhere, kept on disk one by one, assembled when all are there."""
