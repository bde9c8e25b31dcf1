"""Relations: what is claimed of two shapes, and how a map is found, measured and judged that bears it out."""
