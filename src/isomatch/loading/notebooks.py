"""Objects that notebooks show: the room `view` draws them, which the rooms that define them come before."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def view_room() -> Any:
    """Return the room `view`, for methods that show their own object and for nothing else."""
    return import_module("isomatch.view")


class Shown:
    """An object that notebooks show as `isomatch.view.html_of` represents it."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        html: str = view_room().html_of(self)
        return html
