"""Two complete shapes with the same distances: the isometric model."""
