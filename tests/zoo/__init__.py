"""Made shapes that tests loop over: tiny specimens by tag, and larger ones that every command is given."""

from zoo.specimens import Specimen, any_mesh, grid, mobius, specimen, torus, zoo

__all__ = ["Specimen", "any_mesh", "grid", "mobius", "specimen", "torus", "zoo"]
