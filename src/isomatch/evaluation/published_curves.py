"""Published curves of other methods, for comparison."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from isomatch._arrays import FloatArray
from isomatch.errors import FormatError, MissingFileError


@dataclass(frozen=True, eq=False)
class PublishedCurve:
    """A published cumulative curve of errors.

    Parameters
    ----------
    set_name, method : str
        The set that was matched, and the method.
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
        Holds ``.npz`` archives with two arrays for each curve: ``set|method|x``, errors, and ``set|method|y``, percent.

    Returns
    -------
    list of PublishedCurve
        In the order of the file names; of several curves of one set and method, the first.

    Raises
    ------
    MissingFileError
        If there is no curve in the folder.
    FormatError
        If a file cannot be read.
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
            raise FormatError(f"{path}: cannot be read as curves ({error}); repair or remove it") from error
    if not curves:
        raise MissingFileError(
            f"{folder}: no published curves; expected .npz files with arrays 'set|method|x' (errors) and "
            "'set|method|y' (percent)"
        )
    return list(curves.values())
