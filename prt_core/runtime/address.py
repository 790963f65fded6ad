"""Where a bake lies: a path of this machine, or an address in an object store, as s3://bucket/a.prt.

An `Address` has of `pathlib.Path` what names need, and is none: what lies there has no folders, no
links and no rights of a file system, and whoever opens a path with it is told so by Python.
"""

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit

from prt_core.errors import expect, expect_path, shown

# Stores that can be listed: Amazon's, Google's, Azure's and their like, and one of this process,
# for scripts and tests.
SCHEMES = ("s3", "gs", "az", "memory")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
_BUCKET = re.compile(r"[\w.-]+")
_PART = re.compile(r"[\w .+,=@()-]+")


@dataclass(frozen=True)
class Address:
    """An address in an object store.

    Parameters
    ----------
    scheme : str
        One of `SCHEMES`.
    bucket : str
        Or container.
    parts : tuple of str
        Names within it.
    """

    scheme: str
    bucket: str
    parts: tuple

    @classmethod
    def of(cls, name, text):
        """The address that a `text` says; `name` is the argument's, for messages."""
        scheme, _, rest = text.partition("://")
        expect(
            scheme in SCHEMES,
            f"{name}: expected a path, or an address that begins with s3://, gs://, az:// "
            f"or file://, got {shown(text)}",
        )
        bucket, *parts = rest.rstrip("/").split("/")
        good = _BUCKET.fullmatch(bucket) and parts
        good = good and all(_PART.fullmatch(p) and p.strip(".") for p in parts)
        expect(
            good,
            f"{name}: expected {scheme}://BUCKET/NAME, with letters, digits and ._-+,=@ in its "
            f"names, got {shown(text)}",
        )
        return cls(scheme, bucket, tuple(parts))

    def __str__(self):
        return f"{self.scheme}://" + "/".join((self.bucket, *self.parts))

    @property
    def name(self):
        """The last of its names."""
        return self.parts[-1]

    @property
    def stem(self):
        """Its name without the suffix."""
        return PurePosixPath(self.name).stem

    @property
    def suffix(self):
        """The end of its name, with the dot."""
        return PurePosixPath(self.name).suffix

    @property
    def parent(self):
        """None: no folder of this machine, for files that would lie beside."""
        return None

    @property
    def home(self):
        """The text of the address that its name is in."""
        return f"{self.scheme}://" + "/".join((self.bucket, *self.parts[:-1]))

    def absolute(self):
        """Itself."""
        return self

    def with_name(self, name):
        """The address of another name beside it."""
        return Address(self.scheme, self.bucket, (*self.parts[:-1], name))


def is_address(value):
    """Whether a value is an address, or text that begins as one does."""
    return isinstance(value, Address) or (
        isinstance(value, str) and _SCHEME.match(value) is not None
    )


def expect_store_path(name, value):
    """Where a bake or a light field lies.

    Parameters
    ----------
    name : str
        Of the argument.
    value : str, Path or Address
        A path, file://PATH, or SCHEME://BUCKET/NAME.

    Returns
    -------
    Path or Address

    Raises
    ------
    PRTError
        It is neither, or of a scheme that no store is opened by.
    """
    if isinstance(value, Address):
        return value
    if not is_address(value):
        return expect_path(name, value)
    if value.startswith("file://"):
        # Takes as long to import as all else here.
        from urllib.request import url2pathname

        parts = urlsplit(value)
        expect(
            parts.netloc in ("", "localhost") and unquote(parts.path).strip("/"),
            f"{name}: expected file:///PATH, got {shown(value)}",
        )
        return expect_path(name, Path(url2pathname(parts.path)))
    return Address.of(name, value)
