"""Files that are written whole or not at all, and what is known of them before the work."""

import errno
import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

from prt_core.errors import expect, expect_path, system_errors


@contextmanager
def written(path):
    """A path to write to, beside `path`; it becomes `path` when the block ends well.

        with written("a.npz") as part:
            part.write_bytes(data)

    Where anything fails, what was there before stays, and nothing else. Folders on the way are
    made.

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Path
        A name of the same suffix in the same folder.

    Raises
    ------
    PRTError
        What the system refuses (see `system_errors`).
    """
    path = expect_path("file", path)
    part = _part_of(path)
    with system_errors(path), new_folder(path.parent):
        _expect_no_folder(path)
        try:
            # A link that lies there is not written through.
            part.unlink(missing_ok=True)
            yield part
            os.replace(part, path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


@contextmanager
def new_folder(path):
    """A folder, made with those above it where they are missing; gone again if the block fails."""
    path = Path(path)
    with system_errors(path):
        missing = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
    try:
        yield path
    except BaseException:
        if missing:
            shutil.rmtree(missing[-1], ignore_errors=True)
        raise


def expect_output(name, path, suffix, folder=False, create=False):
    """Refuse, before the work, a path that cannot be written to afterwards.

    Parameters
    ----------
    name : str
        What the output is, for messages.
    path : str or Path
    suffix : str, tuple of str or None
        Such as ".npz", or those that there are; None: any.
    folder : bool
        Whether a folder is to be made there instead of a file.
    create : bool
        Whether folders on the way are made where they are missing; else they must be there.

    Returns
    -------
    Path

    Raises
    ------
    PRTError
        Another suffix, no folder to write in, something of another kind in the way, a name that
        is too long, or no right to write.
    """
    path = expect_path(name, path)
    endings = (suffix,) if isinstance(suffix, str) else suffix
    expect(
        endings is None or path.suffix.lower() in endings,
        f"{path}: expected a name that ends in {' or '.join(endings or ())}",
    )
    with system_errors(path):
        home = path.parent
        expect(create or home.exists(), f"{path}: there is no folder '{home}'; make it first")
        while not home.exists():
            home = home.parent
        if folder:
            expect(
                not path.exists() or path.is_dir(),
                f"{path}: expected a folder, this is a file; choose another name",
            )
        else:
            _expect_no_folder(path)
        inside = path if folder and path.is_dir() else home
        # What only the attempt tells: rights, file systems that take no files, long names.
        part = inside / _part_of(path).name
        part.open("ab").close()
        part.unlink()
    return path


def _part_of(path):
    return path.with_name(f"{path.stem}.part{path.suffix}")


def _expect_no_folder(path):
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))


def file_without_name(folder):
    """A file for what does not fit into memory, open to read and write; it goes when it is closed.

    It goes as well where the process is killed, but on Windows.

    Parameters
    ----------
    folder : Path
        Where it is made, for there is most likely room; where that may not be written to it is
        made where the system has such files.
    """
    try:
        return tempfile.TemporaryFile(dir=folder)
    except OSError:
        return tempfile.TemporaryFile()
