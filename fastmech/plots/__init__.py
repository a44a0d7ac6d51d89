"""Pictures: one look, and the parts that several of them share."""
