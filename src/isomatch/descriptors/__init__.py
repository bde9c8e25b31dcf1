"""Descriptors: functions of a vertex by which corresponding vertices of two surfaces are recognised."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
