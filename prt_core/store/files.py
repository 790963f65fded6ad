"""The files of one folder on this machine: plain files only, each whole or not there at all.

A file is written beside its place, under a name that nobody else has, and then renamed over it. A
kill leaves the old file or the new one, and at most a part file, which nobody reads and the next
writer removes. Links are never followed, and what is not a plain file is never opened.
"""

import errno
import os
import re
import secrets
import shutil
import stat
from contextlib import contextmanager, suppress
from pathlib import Path

from prt_core.errors import PRTError, expect
from prt_core.runtime.threads import on_all_cores

# Windows knows no links of this kind, nor files that block.
_SAFE = (
    getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_NONBLOCK", 0)
    | getattr(os, "O_CLOEXEC", 0)
    | getattr(os, "O_BINARY", 0)
)
_READ = os.O_RDONLY | _SAFE
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _SAFE
# A folder of Windows that leads elsewhere.
_JUNCTION = getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", -1)
# Ours, and those of zarr and of older versions.
_PART = re.compile(r".+\.[0-9a-f]{16}\.part|.+\.[0-9a-f]{32}\.partial|zarr\.json\.part")
_KEY = re.compile(r"\w[\w.-]*(/\w[\w.-]*)*")
# How often a file is written again whose part another writer took for a leftover.
_TURNS = 3


def is_part(name):
    """Whether a file of this name is an unfinished one, which means nothing to a reader."""
    return ".part" in name and _PART.fullmatch(name) is not None


class Files:
    """Reads and writes the files of a folder.

    Parameters
    ----------
    root : str or Path
        The folder. It is not made, but by `make`, so that a folder which was removed meanwhile
        does not come back with a part of its files.

    Raises
    ------
    PRTError
        By every method: what the system refuses, in one line.
    """

    def __init__(self, root):
        self.root = Path(root)

    def exists(self):
        """Whether the folder is there; `PRTError` where something else is in its place."""
        try:
            with self._said(self.root, "read"):
                status = os.lstat(self.root)
        except PRTError as error:
            if isinstance(error.__cause__, FileNotFoundError):
                return False
            raise
        link = stat.S_ISLNK(status.st_mode)
        expect(not link, f"{self.root}: is a symbolic link; give the folder itself")
        expect(
            stat.S_ISDIR(status.st_mode),
            f"{self.root}: is a file, expected a folder NAME.prt made by 'prt bake'",
        )
        return True

    def make(self):
        """Make the folder and those above it."""
        with self._said(self.root, "made"):
            self.root.mkdir(parents=True, exist_ok=True)
            sync_folder(self.root.parent)

    def read(self, key, most):
        """The bytes of a file, None where there is none.

        Parameters
        ----------
        key : str
            Its path inside the folder, with slashes.
        most : int
            A larger file is refused before it is read.
        """
        path = self._path(key)
        with self._said(path, "read"):
            try:
                _expect_plain(path, os.lstat(path))
                handle = os.open(path, _READ)
            except (FileNotFoundError, NotADirectoryError):
                return None
            with os.fdopen(handle, "rb") as file:
                status = os.fstat(file.fileno())
                _expect_plain(path, status)
                expect(
                    status.st_size <= most,
                    f"{path}: has {status.st_size:,} bytes, expected {most:,} at most; "
                    "it is damaged or tampered with",
                )
                return file.read(most)

    def write(self, key, data, lasting=False):
        """Put a file in place of the one that is there.

        Parameters
        ----------
        key : str
        data : bytes
        lasting : bool
            Whether it is on the disk, and will be after a power cut, when this returns. Without,
            `sync` makes it so for all files at once, which is quicker.
        """
        path = self._path(key)
        with self._said(path, "written"):
            self._make_folders(path.parent)
            for turn in range(_TURNS):
                try:
                    _write(path, data, lasting)
                    break
                except FileNotFoundError:
                    if turn == _TURNS - 1 or not path.parent.is_dir():
                        raise
            if lasting:
                sync_folder(path.parent)

    def remove(self, key):
        """Remove a file or a folder with all that is in it, where it is there."""
        path = self._path(key)
        with self._said(path, "removed"):
            remove_tree(path)

    def names(self, folder="", folders=None):
        """Names in a folder but for part files, sorted; none where there is no such folder.

        Parameters
        ----------
        folder : str
        folders : bool, optional
            Only names of folders, or only those of anything else.
        """
        path = os.path.join(self.root, expect_key(self.root, folder)) if folder else self.root
        with self._said(path, "read"):
            try:
                with os.scandir(path) as entries:
                    return sorted(
                        entry.name
                        for entry in entries
                        if not is_part(entry.name)
                        and folders in (None, entry.is_dir(follow_symlinks=False))
                    )
            except (FileNotFoundError, NotADirectoryError):
                return []

    def check(self):
        """Refuse a folder that holds anything but folders and plain files."""
        with self._said(self.root, "read"):
            for path, status in walk(self.root):
                _expect_plain(path, status, folders=True)

    def sweep(self):
        """Remove the part files that a kill left, whatever they are now."""
        with self._said(self.root, "written"):
            for path, entries in list(walk(self.root)):
                if is_part(os.path.basename(path)) and not stat.S_ISDIR(entries.st_mode):
                    Path(path).unlink(missing_ok=True)

    def sync(self, folder=""):
        """Wait until all files, or those of a folder, are on the disk."""
        top = self._path(folder) if folder else self.root

        def one(path):
            handle = os.open(path, (os.O_RDWR if os.name == "nt" else os.O_RDONLY) | _SAFE)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)

        with self._said(top, "written"):
            files, folders = [], [top]
            for path, status in walk(top):
                (folders if stat.S_ISDIR(status.st_mode) else files).append(path)
            on_all_cores(one, files)
            on_all_cores(sync_folder, folders)

    def nbytes(self):
        """Bytes of all files."""
        with self._said(self.root, "read"):
            return sum(
                status.st_size for _, status in walk(self.root) if stat.S_ISREG(status.st_mode)
            )

    def _path(self, key):
        return self.root / expect_key(self.root, key)

    def _make_folders(self, folder):
        missing = []
        while folder != self.root and not folder.is_dir():
            missing.append(folder)
            folder = folder.parent
        for folder in reversed(missing):
            folder.mkdir(exist_ok=True)

    @contextmanager
    def _said(self, path, done):
        try:
            yield
        except FileNotFoundError as error:
            if self.root.is_dir() or done == "made":
                raise file_error(path, done, error) from error
            raise PRTError(
                f"{self.root}: was removed while it was in use; run the same command again to "
                "begin anew"
            ) from error
        except OSError as error:
            raise file_error(path, done, error) from error


def expect_key(root, key):
    """`key`, where it is one of a bake's: what damaged or planted files name leads nowhere else."""
    expect(
        _KEY.fullmatch(key) is not None and ".." not in key,
        f"{root}: names a file {key!r}, which is none of a bake's; it is damaged",
    )
    return key


def file_error(path, done, error):
    """The `PRTError` for what the system said when a file was to be `done`."""
    reason = error.strerror or type(error).__name__
    if error.errno == errno.ENOSPC:
        reason += "; what is done is kept, make room and run the same command again"
    return PRTError(f"{path}: cannot be {done} ({reason})")


def _expect_plain(path, status, folders=False):
    kind = status.st_mode
    junction = getattr(status, "st_reparse_tag", None) == _JUNCTION
    if not junction and (stat.S_ISREG(kind) or (folders and stat.S_ISDIR(kind))):
        return
    names = {
        stat.S_IFLNK: "symbolic link",
        stat.S_IFDIR: "folder",
        stat.S_IFIFO: "pipe",
        stat.S_IFSOCK: "socket",
    }
    name = "junction" if junction else names.get(stat.S_IFMT(kind), "device")
    raise PRTError(
        f"{path}: is a {name}, which no bake holds there; it was tampered with, remove it"
    )


def _write(path, data, lasting):
    part = path.with_name(f"{path.name}.{secrets.token_hex(8)}.part")
    handle = os.open(part, _NEW, 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def walk(top):
    """(str, `os.lstat`) of everything below a folder; links are named and not followed."""
    folders = [os.fspath(top)]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                try:
                    status = entry.stat(follow_symlinks=False)
                except FileNotFoundError:
                    # Another writer has renamed its part file meanwhile.
                    continue
                yield entry.path, status
                if stat.S_ISDIR(status.st_mode):
                    folders.append(entry.path)


def remove_tree(path):
    """Remove a file, a link or a folder with all that is in it; nothing where there is none."""
    path = Path(path)
    try:
        folder = stat.S_ISDIR(os.lstat(path).st_mode)
    except FileNotFoundError:
        return
    if folder:
        shutil.rmtree(path)
    else:
        path.unlink()


def sync_folder(path):
    """Wait until the names in a folder are on the disk, where the system lets us."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
