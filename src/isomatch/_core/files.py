"""Open files with named errors, claim files to be written, and replace them only when complete."""

from __future__ import annotations

import errno
import logging
import os
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from shutil import rmtree
from stat import S_ISREG
from tempfile import NamedTemporaryFile
from threading import Lock
from typing import BinaryIO

from isomatch._core.errors import (
    FormatError,
    InputError,
    IsomatchError,
    MissingFileError,
    UnwritableFileError,
)

# values of `OSError.errno` for faults of one file, not of its folder or disk; None means no regular file
_ERRORS_OF_ONE_FILE = (None, errno.ENAMETOOLONG, errno.EINVAL, errno.EILSEQ)
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # `OSError.errno` on file systems without locks
UNFINISHED = ".isomatch-{}.unfinished"  # name of a file or folder that is being written; {} is random
_SURROGATE = re.compile("[\ud800-\udfff]")  # stands in Python for a byte of a file name that is not UTF-8
_SURROGATE_OR_PERCENT = re.compile("[%\ud800-\udfff]")  # characters that `legible` replaces by %XX
logger = logging.getLogger(__name__)


def open_file(path: Path) -> BinaryIO:
    """Open a file to read; `MissingFileError` if there is none, `FormatError` if it is not readable."""
    try:
        if not S_ISREG(path.stat().st_mode):  # reading from a pipe could block, and from a device never end
            raise FormatError(
                f"{path}: cannot be opened (not a regular file); write its contents to a file first"
            )
        return path.open("rb")
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; check the name and the folder") from None
    except OSError as error:
        raise FormatError(f"{path}: cannot be opened ({error.strerror}); give a readable file") from None


def read_bytes(path: Path) -> bytes:
    """Read a whole file, see `open_file`."""
    with open_file(path) as file:
        return file.read()


@contextmanager
def replaced(path: Path) -> Iterator[BinaryIO]:
    """Open a new file, which replaces an earlier one when the block ends without an error."""
    # A symbolic link stays, and the file at its end is replaced. A link to no file is replaced itself.
    with writing(path):
        _require_replaceable(path)
        final = path.resolve() if path.exists() else path
        with _removed_at_end(final.with_name(UNFINISHED.format(token_hex(8)))) as unfinished:
            with changing:
                file = unfinished.open("xb")
            with file:
                yield file
                file.flush()
                os.fsync(file.fileno())  # Otherwise a power failure could leave an empty file.
            with changing:
                unfinished.replace(final)


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, see `replaced`."""
    with replaced(path) as file:  # bytes of file names that are not UTF-8 become escapes that JSON allows
        file.write(text.encode("utf-8", "backslashreplace"))


@contextmanager
def staged(folder: Path, last: str, gone: Iterable[str] = ()) -> Iterator[Path]:
    """Yield a new folder, whose files all move to another when the block ends without an error."""
    # If the file ``last`` is in the folder, all other files are complete: its earlier version is removed
    # before any file moves, and its new version moves last. Files in ``gone`` are removed.
    places = [folder / UNFINISHED.format(token_hex(8)) for _ in range(2)]
    with writing(folder), _removed_at_end(places[0]) as new, _removed_at_end(places[1]) as earlier:
        with changing:
            new.mkdir()
        yield new
        names = [file.relative_to(new) for file in new.rglob("*") if not file.is_dir()]
        names.sort(key=lambda name: name == Path(last))
        away = dict.fromkeys([Path(last), *names, *map(Path, gone)])
        with changing:
            moves = [(folder / name, earlier / name) for name in away if os.path.lexists(folder / name)]
            _move([*moves, *((new / name, folder / name) for name in names)])


def _move(moves: Iterable[tuple[Path, Path]]) -> None:
    """Move files to new places; if one cannot be moved, move all back."""
    done: list[tuple[Path, Path]] = []
    try:
        for place, to in moves:
            to.parent.mkdir(parents=True, exist_ok=True)
            place.replace(to)
            done.append((place, to))
    except OSError:
        for place, to in reversed(done):
            with suppress(OSError):
                to.replace(place)
        raise


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Create a folder and its parents; new ones that stay empty are removed at the end of the block."""
    with ExitStack() as made:
        for one in (*reversed(folder.parents), folder):
            if not one.exists():
                made.enter_context(_removed_at_end(one))
                with changing:
                    one.mkdir(exist_ok=True)
        folder.mkdir(exist_ok=True)
        yield


_temporary: list[Path] = []  # files and folders to remove if the process ends, in the order of creation
changing = Lock()  # held while temporary files or processes are made or removed; signal handlers wait for it


@contextmanager
def _removed_at_end(path: Path) -> Iterator[Path]:
    """Remove a file, or an empty or unfinished folder, when the block ends, however it ends."""
    with changing:
        _temporary.append(path)
    try:
        yield path
    finally:
        with changing:
            _remove(path)
            _temporary.remove(path)


def _remove(path: Path) -> None:
    if not path.is_dir():
        path.unlink(missing_ok=True)
    elif path.suffix == ".unfinished":
        rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):  # A folder that is not empty stays.
            path.rmdir()


def remove_unfinished(paths: Iterable[Path], age: float) -> None:
    """Remove unfinished files of killed processes that are at least ``age`` seconds old."""
    for path in paths:
        with suppress(FileNotFoundError):
            if time.time() - path.stat().st_mtime >= age:
                _remove(path)


def abandon_files() -> None:
    """Remove everything unfinished before the process ends; no thread creates or completes more."""
    changing.acquire()
    for path in reversed(_temporary):
        with suppress(OSError):
            _remove(path)


@contextmanager
def claimed(path: Path, new: Iterable[Path] = ()) -> Iterator[None]:
    """Claim a file against other processes while the block runs; no file of ``new`` may exist."""
    from filelock import FileLock, Timeout  # imported here, as it takes 0.1 s, and few commands need it

    lock = path.with_name(f".{path.name}.lock")
    claim = FileLock(lock, timeout=0, thread_local=False)  # the system releases it if the process is killed
    with writing(path):
        _require_replaceable(path)
        path.parent.stat()  # Otherwise some versions of filelock would make the folder.
        with changing:
            try:
                claim.acquire()
            except Timeout:
                raise UnwritableFileError(
                    f"{path}: is being written by another run; wait until that ends, or choose another name with -o"
                ) from None
            except OSError as error:
                if error.errno not in _NO_LOCKS:
                    raise
                logger.warning("%s: not locked (%s); let no other run write there", path, error.strerror)
            _temporary.append(lock)
    try:
        for one in new:
            if os.path.lexists(one):
                raise UnwritableFileError(
                    f"{one}: already exists and would be replaced; choose another name with -o, or pass --force"
                )
        yield
    finally:
        with changing:
            with suppress(PermissionError):  # Windows removes the file of the lock when the lock is released
                lock.unlink(missing_ok=True)  # before the release: later it could be another process's
            claim.release()
            _temporary.remove(lock)


def _require_replaceable(path: Path) -> None:
    if path.exists() and not path.is_file():
        raise UnwritableFileError(f"{path}: is not a file and is left as it is; choose another name")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn errors of the system into `UnwritableFileError` with the name of the file and ``errno``."""
    try:
        yield
    except OSError as error:
        if isinstance(error, IsomatchError):
            raise
        reason = error.strerror or str(error) or type(error).__name__
        remedy = "give a file in an existing, writable folder with free space"
        unwritable = UnwritableFileError(f"{path}: cannot be written ({reason}); {remedy}")
        unwritable.errno = error.errno
        raise unwritable from None


def is_of_one_file(error: UnwritableFileError) -> bool:
    """Whether only this file cannot be written, unlike with a full disk."""
    return error.errno in _ERRORS_OF_ONE_FILE


def legible(name: str) -> str:
    """Write bytes of a file name that are not UTF-8, and % beside them, as %XX (`unquote_to_bytes`)."""
    if not _SURROGATE.search(name):
        return name
    return _SURROGATE_OR_PERCENT.sub(lambda match: f"%{ord(match[0]) & 0xFF:02X}", name)


# names that Windows reserves for devices
_DEVICE_NAMES = re.compile(r"(con|prn|aux|nul|(com|lpt)[0-9¹²³])(\s*\..*)?", re.IGNORECASE)
_NOT_IN_NAMES = re.compile(r'[/\\:*?"<>|\x00-\x1f]')  # characters that Windows or Linux do not allow in names
_MAX_NAME_BYTES = 200  # most bytes of a name without suffixes; chosen: most systems allow 255 with suffixes


def require_names(names: Iterable[str], what: str, where: object, remedy: str) -> None:
    """Raise `InputError` for names of ``what`` that are no valid file names or lead out of their folder."""
    for name in names:
        if not name or _NOT_IN_NAMES.search(name) or name.startswith(".") or name != name.strip().rstrip("."):
            why = 'files are named by it, so give no / \\ : * ? " < > |, nor dots or blanks at its ends'
        elif _DEVICE_NAMES.fullmatch(name):
            why = "files of this name are devices on Windows"
        elif len(name.encode("utf-8", "surrogateescape")) > _MAX_NAME_BYTES:
            why = f"it has more than {_MAX_NAME_BYTES} bytes"
        else:
            continue
        raise InputError(f"{where}: {name[:80]!r} cannot be the name of a {what}: {why}; {remedy}")


def ignores_case(folder: Path) -> bool:
    """Whether names that differ only in case are the same file in a folder, which need not exist yet."""
    place = next(one for one in (folder, *folder.parents) if os.path.isdir(one))
    with writing(place), NamedTemporaryFile(prefix="isomatch-case-", dir=place) as probe:
        return os.path.exists(place / Path(probe.name).name.upper())
