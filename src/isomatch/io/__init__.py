"""Surfaces as others keep them: files of many formats and meshes of other libraries, with all that they carry."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
