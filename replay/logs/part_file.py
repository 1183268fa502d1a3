"""A file that appears under its name only when it is whole."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

from replay.errors import NoSpaceError, RecordingExistsError, WriteError
from replay.logs.file_lock import is_at, lock

_NO_SPACE = {getattr(errno, name) for name in ("ENOSPC", "EDQUOT") if hasattr(errno, name)}  # the second: a quota's

UNFINISHED = ".part"
"""What the name of a file ends in while it is written."""
_numbers = itertools.count(1)
_TRIES = 100


class PartFile:
    """A binary file written as NAME.part, made durable and renamed to NAME when it is complete.

    The file is locked while it is written: where another process, or thread, writes NAME too, each has a file of its
    own, and the last to be complete is the one that stays.

    Attributes:
        path: the final name.
        part: the name while it is written; what a killed process leaves behind.
    """

    def __init__(self, path: Path, *, overwrite: bool) -> None:
        """Create the folder and the `.part` file; one left over from a killed run is replaced.

        Raises:
            RecordingExistsError: `path` exists and `overwrite` is false.
            WriteError: the file cannot be created.
        """
        self.path = path
        self._overwrite = overwrite
        self._finished = False
        try:
            if path.exists() and not overwrite:
                raise RecordingExistsError(str(path))
            path.parent.mkdir(parents=True, exist_ok=True)
            self.part, self._stream, self._ours = _open_part(path)
        except (OSError, UnicodeEncodeError) as error:
            raise write_error(path, error) from None

    def write(self, data: bytes | memoryview) -> None:
        """Append bytes; WriteError when the disk is full or fails."""
        try:
            self._stream.write(data)
        except OSError as error:
            raise write_error(self.path, error) from None

    def flush(self) -> None:
        """Hand everything written so far to the operating system, so that it survives the end of this process."""
        try:
            self._stream.flush()
        except OSError as error:
            raise write_error(self.path, error) from None

    def finish(self) -> None:
        """Make the file durable, under the name that it has while it is written; nothing may be appended any more.

        Raises:
            WriteError: it cannot be written; NoSpaceError when the disk is full.
        """
        try:
            if not self._finished:
                self._stream.flush()
                os.fsync(self._stream.fileno())
                self._finished = True
        except OSError as error:
            raise write_error(self.path, error) from None

    def commit(self, *, lasting: bool = True) -> None:
        """Make the file durable and give it its name.

        Args:
            lasting: it is to outlast a power cut; what need not waits for no disk.

        Raises:
            RecordingExistsError: meanwhile another process has written one, and `overwrite` is false.
            WriteError: as of `finish`, or what stands under the unfinished name is not this file any more.
        """
        if lasting:
            self.finish()
        else:
            self.flush()
        try:
            if not self._overwrite and self.path.exists():
                raise RecordingExistsError(str(self.path))
            if self._ours and not is_at(self._stream.fileno(), self.part):
                raise WriteError(str(self.path), f"{self.part.name} was removed or replaced while it was written")
            if os.name == "nt":  # which renames no open file
                self._stream.close()
            self.part.replace(self.path)
            self._stream.close()
            if lasting:
                _sync_folder(self.path.parent)
        except OSError as error:
            raise write_error(self.path, error) from None

    def discard(self) -> None:
        """Close and remove the unfinished file; never raises, because it runs while another error is on its way."""
        with contextlib.suppress(OSError, ValueError):  # the second: it is closed
            if os.name != "nt" and (not self._ours or is_at(self._stream.fileno(), self.part)):
                self.part.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # the buffered rest may not fit on a full disk; the file goes away anyway
            self._stream.close()
        if os.name == "nt":  # which removes no open file
            with contextlib.suppress(OSError):
                self.part.unlink(missing_ok=True)


def _open_part(path: Path) -> tuple[Path, BinaryIO, bool]:
    """Create and lock the file that becomes `path`; return its name, itself, and whether it is one of ours.

    It is NAME.part; or NAME with a number of ours where a living process writes that one.
    """
    part = path.with_name(path.name + UNFINISHED)
    if part.is_char_device():
        return part, part.open("wb"), False
    for _ in range(_TRIES):
        try:
            stream = part.open("xb")
        except FileExistsError:
            if not _remove_left_over(part):
                part = path.with_name(f"{path.stem}.{os.getpid()}-{next(_numbers)}{path.suffix}{UNFINISHED}")
            continue
        if lock(stream.fileno()) and is_at(stream.fileno(), part):
            return part, stream, True
        stream.close()  # another process took it for left over before it was locked
    raise OSError(errno.EBUSY, f"others write and remove {part.name} all the time")


def _remove_left_over(part: Path) -> bool:
    """Remove an unfinished file that nobody writes; return false when somebody does."""
    if os.name == "nt":
        try:
            part.unlink(missing_ok=True)
        except PermissionError:
            return False
        return True
    try:
        handle = os.open(part, os.O_RDWR | os.O_NOFOLLOW)
    except FileNotFoundError:  # it has just got its name
        return True
    except OSError:  # a link, which is not what a killed run left, or another user's
        part.unlink(missing_ok=True)
        return True
    try:
        if not lock(handle):
            return False
        if is_at(handle, part):
            part.unlink()
        return True
    finally:
        os.close(handle)


def write_file(
    path: Path, data: bytes | str, *, overwrite: bool = True, named: bool = False, lasting: bool = True
) -> Path:
    """Write a whole file and the folders that it needs, or leave what was there; return its path.

    Args:
        path: of the file; a link of that name is replaced by the file, and what it leads to stays as it is.
        data: content.
        overwrite: replace what is there.
        named: the user named this very file. Then devices, pipes and links, such as /dev/stdout, are written in place:
            a new file would take their name from them.
        lasting: see `PartFile.commit`.

    Raises:
        RecordingExistsError: the file exists and `overwrite` is false.
        WriteError: it cannot be written.
    """
    data = data.encode() if isinstance(data, str) else data
    try:
        if overwrite and named and (path.is_symlink() or (path.exists() and not path.is_file() and not path.is_dir())):
            path.write_bytes(data)
            return path
    except OSError as error:
        raise write_error(path, error) from None
    file = PartFile(path, overwrite=overwrite)
    try:
        file.write(data)
        file.commit(lasting=lasting)
    except BaseException:
        file.discard()
        raise
    return path


def append_lines(path: Path, lines: Iterable[str], *, named: bool = False) -> None:
    """Append lines to a text file and make the folders that it needs; all of them or, with a WriteError, none.

    A file that has other names (hard links) loses them first. A link, a pipe or a device is refused, unless the user
    `named` it.
    """
    if not named:
        refuse_link(path)
    data = memoryview("".join(f"{line}\n" for line in lines).encode())
    try:
        if not named and path.is_file() and path.stat().st_nlink > 1:
            write_file(path, path.read_bytes())
        elif not named and path.exists() and not path.is_file() and not path.is_dir():
            raise WriteError(str(path), "it is a pipe or a device, and results are kept in files; remove it")
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab", buffering=0) as stream:
            lock(stream.fileno(), wait=True)  # several machines may append to one history
            before = stream.seek(0, os.SEEK_END)
            try:
                while data:
                    data = data[stream.write(data) :]
            except OSError:
                stream.truncate(before)
                raise
    except OSError as error:
        raise write_error(path, error) from None


def refuse_link(path: Path) -> None:
    """Refuse a place in a folder of results that is a link: what would be written or deleted there is elsewhere.

    The folder itself may be reached through links: the user has named it.

    Raises:
        WriteError: it is one, or may not be looked at.
    """
    try:
        linked = path.is_symlink()
    except OSError as error:
        raise write_error(path, error) from None
    if linked:
        raise WriteError(str(path), "it is a link, and nothing is written through links here; remove it")


def remove_folder(folder: Path) -> None:
    """Remove a folder with all that is in it, as far as that goes; what is no folder, such as a pipe, stays."""
    with contextlib.suppress(OSError):
        if folder.is_dir() and not folder.is_symlink():
            shutil.rmtree(folder, ignore_errors=True)


def json_line(value: Any) -> str:
    """Return JSON on one line, in which only characters that show nothing are escaped."""
    text = json.dumps(value, ensure_ascii=False)
    return text if text.isprintable() else "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in text)


def write_error(path: Path, error: OSError | UnicodeEncodeError) -> WriteError:
    """Return the WriteError that says why the system refused `path`: a NoSpaceError when the disk is full."""
    if isinstance(error, UnicodeEncodeError):
        return WriteError(str(path), f"names of files are {error.encoding} here; LC_ALL=C.UTF-8 allows any")
    with contextlib.suppress(OSError):
        in_the_way = next((folder for folder in path.parents if folder.exists() and not folder.is_dir()), None)
        if in_the_way is not None:
            return WriteError(str(path), f"{in_the_way} is a file where a folder is needed")
    kind = NoSpaceError if error.errno in _NO_SPACE else WriteError
    return kind(str(path), error.strerror or str(error))


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
