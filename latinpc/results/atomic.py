"""Write files whole or not at all, and refuse early what cannot be written; states of solvers do it in C, alike."""

from __future__ import annotations

import contextlib
import os
import pathlib
import secrets
import stat

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a character device",
    stat.S_IFBLK: "a block device",
}


def _check_regular(path, mode):
    if not stat.S_ISREG(mode):
        kind = KINDS.get(stat.S_IFMT(mode), "something else")
        raise PermissionError(f"{path}: is {kind}, not a regular file; give another name")


def follow(path):
    """Return the file that a name leads to through links, and its permission bits: None where it is yet to be made.

    Raises
    ------
    OSError
        As `check_writable`.
    """
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        mode = None
    else:
        _check_regular(path, mode)
    target = os.fspath(path)
    while os.path.islink(target):  # circles have failed above
        target = os.path.join(os.path.dirname(target), os.readlink(target))
    folder = os.path.dirname(target) or "."
    if not os.path.basename(target):
        raise FileNotFoundError(f"'{path}': there is no such folder, and a file is asked for; give the name of a file")
    if not os.path.isdir(folder):
        raise FileNotFoundError(f"{path}: the folder {folder} does not exist; create it first")
    if not os.access(folder if mode is None else target, os.W_OK) or not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: may not be written; choose another place")
    return target, None if mode is None else mode & 0o777


@contextlib.contextmanager
def atomic(path):
    """Yield a temporary name beside `path` that replaces it once the block has succeeded.

    An interrupted write leaves the former file as it was, and nothing else. A symbolic link stays: what it leads to is
    replaced. The file keeps its permission bits; a new one has those that the user's mask leaves.

    Parameters
    ----------
    path : str or path-like
        The file to write.

    Raises
    ------
    OSError
        That names `path`: when it is no regular file, its folder does not exist, or writing fails.
    """
    target, mode = follow(path)
    name = f".latinpc-{secrets.token_hex(8)}{pathlib.Path(path).suffix}"  # the suffix chooses a picture's format
    temporary = os.path.join(os.path.dirname(target), name)
    try:
        handle = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if mode is None else 0o600 | mode)
        try:
            yield temporary
            os.fsync(handle)  # some disks tell only now that they are full
        finally:
            os.close(handle)
        if mode is not None:
            os.chmod(temporary, mode)
        os.replace(temporary, target)
    except Exception as error:
        cause = error
        while cause is not None and not isinstance(cause, OSError):  # libraries fail once more when they tidy up
            cause = cause.__context__
        if cause is None or cause.filename not in (None, temporary):
            raise
        if cause.errno is None:
            raise OSError(f"{path}: {cause}") from error
        raise OSError(cause.errno, cause.strerror, os.fspath(path)) from error
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)


def check_writable(path, suffixes=None):
    """Refuse a file that could not be written, before any work is done.

    Raises
    ------
    ValueError
        With an unknown suffix.
    OSError
        When it is no regular file, its folder does not exist, or one of them may not be written to.
    """
    suffix = pathlib.Path(path).suffix
    if suffixes and suffix.lower() not in suffixes:
        raise ValueError(f"{path}: cannot write '{suffix}' files here; use {' or '.join(suffixes)}")
    follow(path)


def check_readable(path):
    """Refuse a file that is not there, or that is no regular file: reading a named pipe would wait for ever.

    Raises
    ------
    OSError
    """
    _check_regular(path, os.stat(path).st_mode)
