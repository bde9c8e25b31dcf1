"""Curves that others published, to draw beside one's own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from isomatch._arrays import FloatArray
from isomatch.errors import FormatError


@dataclass(frozen=True, eq=False)
class PublishedCurve:
    """A cumulative curve of errors.

    Parameters
    ----------
    set_name, method : str
        What was matched, and by which method.
    errors : (q,) array of float
        Geodesic error / √area, ascending.
    shares : (q,) array of float
        Share of correspondences within each error, from 0 to 1.
    """

    set_name: str
    method: str
    errors: FloatArray
    shares: FloatArray


def read_published_curves(folder: str | Path) -> list[PublishedCurve]:
    """Read all curves of a folder.

    Parameters
    ----------
    folder : path_like
        Holds ``.npz`` archives with two arrays a curve: ``set|method|x``, errors, and ``set|method|y``, percent.

    Returns
    -------
    list of PublishedCurve
        By file name; of curves of the same set and method, the first.

    Raises
    ------
    FormatError
        If there is none, or a file cannot be read.
    """
    curves: dict[tuple[str, str], PublishedCurve] = {}
    for path in sorted(Path(folder).glob("*.npz")):
        try:
            with np.load(path, allow_pickle=False) as data:
                for key in data.files:
                    if key.count("|") == 2 and key.endswith("|x"):
                        name, method, _ = key.split("|")
                        curve = PublishedCurve(name, method, data[key], data[f"{name}|{method}|y"] / 100)
                        curves.setdefault((name, method), curve)
        except (OSError, ValueError, KeyError, BadZipFile) as error:
            raise FormatError(f"{path}: cannot be read as curves ({error}); mend or remove it") from error
    if not curves:
        raise FormatError(
            f"{folder}: no published curves; expected .npz files with arrays 'set|method|x' (errors) and "
            "'set|method|y' (percent)"
        )
    return list(curves.values())
