"""Two complete shapes whose limbs stretch."""
