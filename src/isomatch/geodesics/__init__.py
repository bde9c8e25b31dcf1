"""Geodesic distances: the engines that compute them, and farthest point sampling."""

from isomatch._core.first_use import names_at_first_use

__all__ = names_at_first_use(__name__)
