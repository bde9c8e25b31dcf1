"""The commands ``isomatch bench`` and ``isomatch paper``."""
