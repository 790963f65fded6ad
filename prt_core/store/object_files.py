"""The files of a bake in an object store, by obstore, which zarr's own `ObjectStore` calls as well.

It is called here by its functions that wait: one of those that zarr awaits, interrupted by Python's
end, aborts the process, once in a dozen failed commands.

An object is put whole or not at all, and is there to stay once the put returns: nothing is renamed,
no part is left, and there is nothing to wait for. There are no folders: what is in one is listed by
the beginning of its keys. Nor are there links, pipes or junctions to be refused.
"""

import os
from contextlib import contextmanager, suppress
from datetime import timedelta
from functools import cache

from prt_core.errors import PRTError, expect
from prt_core.runtime.address import Address
from prt_core.runtime.threads import on_all_cores
from prt_core.store.files import Files, expect_key

_INSTALL = "pip install 'prt-core[cloud]'"
# Attempts of a request, and how long they take together: an outage of seconds is waited for, and
# what was stopped by a longer one goes on when the command is run again.
_RETRIES, _PATIENCE = 6, timedelta(seconds=60)
# What the stores' own messages hold where something is missing.
_BUCKET = "nosuchbucket", "containernotfound", "bucket does not exist"
_UNKNOWN = (
    "169.254.169.254",
    "metadata.google",
    "credential",
    "unauthenticated",
    " 401 ",
    "missingaccount",
)
_DENIED = "permissiondenied", "accessdenied", "invalidaccesskey", "signaturedoes", " 403 "
_CUT_OFF = "kind: connect", "dns error", "error sending request", "timed out"
# What a person can do where there are no credentials.
_CREDENTIALS = {
    "s3": "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
    "gs": "set GOOGLE_APPLICATION_CREDENTIALS",
    "az": "set AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY",
}


def files_at(path):
    """Who reads and writes the files of a bake.

    Parameters
    ----------
    path : Path or Address

    Returns
    -------
    Files or ObjectFiles
    """
    return ObjectFiles(path) if isinstance(path, Address) else Files(path)


class ObjectFiles:
    """Reads and writes the files of a bake in an object store; the methods of `Files`.

    Parameters
    ----------
    root : Address

    Raises
    ------
    PRTError
        obstore is not installed. By every method: no such bucket, no credentials, no connection.
    """

    def __init__(self, root):
        self.root = root
        self._store, self._obstore = _opened(root.home)

    def exists(self):
        """Whether anything is there."""
        with self._said("", "read"):
            return any(True for _ in self._listed(""))

    def holds(self, key):
        """Whether an object is there, whatever it is."""
        with self._said(key, "read"):
            try:
                self._obstore.head(self._store, self._key(key))
            except FileNotFoundError:
                return False
            return True

    def make(self):
        """Nothing: there are no folders."""

    def read(self, key, most):
        """The bytes of an object, None where there is none; a larger one is refused."""
        with self._said(key, "read"):
            try:
                got = self._obstore.get(self._store, self._key(key))
            except FileNotFoundError:
                return None
            size = got.meta["size"]
            expect(
                size <= most,
                f"{self.root}/{key}: has {size:,} bytes, expected {most:,} at most; it is damaged "
                "or tampered with",
            )
            return bytes(got.bytes())

    def write(self, key, data, lasting=True):
        """Put an object in place of the one that is there; it is there to stay."""
        with self._said(key, "written"):
            self._obstore.put(self._store, self._key(key), bytes(data))

    def remove(self, key):
        """Remove an object, and all whose keys begin as in a folder of that name."""
        self.remove_all([key, *(f"{key}/{name}" for name in self.keys(key))])

    def remove_all(self, keys):
        """Remove several objects at once, where they are there."""

        def remove(key):
            # Some stores say so where there is none, and some do not.
            with suppress(FileNotFoundError):
                self._obstore.delete(self._store, self._key(key))

        with self._said("", "removed"):
            on_all_cores(remove, keys)

    def names(self, folder="", folders=None):
        """Names in a folder, sorted; see `Files.names`."""
        found = {}
        for key in self.keys(folder):
            name, *below = key.split("/", 1)
            found[name] = bool(below) or found.get(name, False)
        return sorted(name for name in found if folders in (None, found[name]))

    def keys(self, folder=""):
        """Keys of all objects in a folder, from the folder on, sorted."""
        with self._said(folder, "read"):
            return sorted(key for key, _ in self._listed(folder))

    def copy_to(self, other, keys):
        """Copy objects to the same keys of other files in the same store."""

        def copy(key):
            self._obstore.copy(self._store, self._key(key), other._key(key))

        with self._said("", "copied"):
            on_all_cores(copy, keys)

    def check(self):
        """Nothing: objects are plain files."""

    def sweep(self):
        """Nothing: no part is left by a kill."""

    def sync(self, folder=""):
        """Nothing: what was put is there to stay."""

    def nbytes(self):
        """Bytes of all objects."""
        with self._said("", "read"):
            return sum(size for _, size in self._listed(""))

    def _key(self, key):
        return f"{self.root.name}/{expect_key(self.root, key)}"

    def _listed(self, folder):
        """(key from the folder on, bytes) of all objects in a folder."""
        prefix = f"{self._key(folder) if folder else self.root.name}/"
        for page in self._obstore.list(self._store, prefix):
            for item in page:
                yield item["path"].removeprefix(prefix), item["size"]

    @contextmanager
    def _said(self, key, done):
        try:
            yield
        except PRTError:
            raise
        except Exception as error:
            place = f"{self.root}/{key}" if key else str(self.root)
            raise object_error(self.root, place, done, error) from error


def object_error(address, place, done, error):
    """The `PRTError` for what an object store said when `place` was to be `done`."""
    text = f"{type(error).__name__} {error}".lower()

    def says(words):
        return any(word in text for word in words)

    if says(_BUCKET):
        line = f"there is no bucket '{address.bucket}'; make it first, or correct the name"
    elif says(_UNKNOWN):
        line = f"no credentials for {address.scheme}://; {_CREDENTIALS[address.scheme]}"
    elif says(_DENIED):
        line = "access denied; these credentials are wrong, or may not do that"
    elif says(_CUT_OFF):
        server = os.environ.get("AWS_ENDPOINT_URL") if address.scheme == "s3" else None
        line = f"no connection to {server or 'the store'}; check the network" + (
            " and AWS_ENDPOINT_URL" if server else ""
        )
    else:
        line = " ".join(str(error).partition("\n")[0].split())[:160] or type(error).__name__
    return PRTError(f"{place}: cannot be {done} ({line})")


@cache
def _opened(url):
    """obstore's store of a url, and obstore; always the same, so that connections are kept."""
    try:
        import obstore
        from obstore.store import from_url
    except ImportError as error:
        raise PRTError(f"{url}: object stores need obstore; {_INSTALL}") from error
    options = {"retry_config": {"max_retries": _RETRIES, "retry_timeout": _PATIENCE}}
    if url.startswith("memory:"):
        url, options = "memory:///", {}
    elif os.environ.get("AWS_ENDPOINT_URL", "").startswith("http://"):
        # Whoever names such a server means it.
        options["client_options"] = {"allow_http": True}
    try:
        return from_url(url, **options), obstore
    except Exception as error:
        raise object_error(Address.of("store", f"{url}/x"), url, "opened", error) from error
