"""Write result files whole or not at all."""

from __future__ import annotations

import contextlib
import os
import pathlib
import shutil
import tempfile


@contextlib.contextmanager
def atomic(path):
    """Yield a temporary name beside `path` that replaces it once the block has succeeded.

    Parameters
    ----------
    path : str or path-like
        The file to write. An interrupted write leaves the former file as it was.
    """
    path = pathlib.Path(path).resolve()  # through a link to the file it names
    device = path.exists() and not path.is_file()  # /dev/stdout and the like are written to, not replaced
    folder = None if device else path.parent
    handle, temporary = tempfile.mkstemp(prefix="." + path.stem + "-", suffix=path.suffix, dir=folder)
    os.close(handle)
    try:
        yield temporary
        if device:
            with open(temporary, "rb") as source, open(path, "wb") as sink:
                shutil.copyfileobj(source, sink)
            return
        mask = os.umask(0)  # mkstemp makes private files; the user's own mask decides
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)


def check_writable(path, suffixes=None):
    """Refuse a result file that could not be written, before any work is done.

    Raises
    ------
    ValueError
        With an unknown suffix.
    OSError
        When the folder does not exist or may not be written to.
    """
    path = pathlib.Path(path)
    if suffixes and path.suffix.lower() not in suffixes:
        raise ValueError(f"{path}: cannot write '{path.suffix}' files here; use {' or '.join(suffixes)}")
    folder = path.parent
    if not folder.is_dir():
        raise FileNotFoundError(f"{path}: the folder {folder} does not exist; create it first")
    if path.is_dir() or not os.access(folder, os.W_OK):
        raise PermissionError(f"{path}: cannot be written; choose another place")
