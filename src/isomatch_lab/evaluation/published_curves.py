"""Published curves of other methods, for comparison."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NoReturn

import numpy as np

from isomatch.errors import FormatError, MissingFileError
from isomatch.storage.array_file import Archive
from isomatch.values.arrays import AnyArray, FloatArray


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
        with Archive.opened(path, partial(_refuse, path)) as stored:
            arrays = stored.read_all(stored.names)
        for key, errors in arrays.items():
            if key.count("|") == 2 and key.endswith("|x"):
                name, method, _ = key.split("|")
                shares = arrays.get(f"{name}|{method}|y")
                if shares is None or not _is_curve(errors, shares):
                    _refuse(path, f"{key} has no array of percent, of the same length, that goes with it")
                curves.setdefault((name, method), PublishedCurve(name, method, errors, shares / 100))
    if not curves:
        raise MissingFileError(
            f"{folder}: no published curves; expected .npz files with arrays 'set|method|x' (errors) and "
            "'set|method|y' (percent)"
        )
    return list(curves.values())


def _is_curve(errors: AnyArray, shares: AnyArray) -> bool:
    return errors.shape == shares.shape and all(
        each.ndim == 1 and each.dtype.kind in "fiu" and np.isfinite(each).all() for each in (errors, shares)
    )


def _refuse(path: Path, problem: str) -> NoReturn:
    raise FormatError(f"{path}: cannot be read as curves ({problem}); repair or remove it")
