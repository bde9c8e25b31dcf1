"""Relations: what is assumed of two shapes, and how a map under this assumption is found, measured and verified."""
