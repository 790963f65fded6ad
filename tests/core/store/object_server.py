"""Objects over HTTP, as S3 and Google's XML interface have them: put, get, list, copy, delete.

Both speak the same, but for who the copied object's header is named after. Nothing is signed.
"""

import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape, unescape

_DATE = "Sun, 29 Nov 2026 12:00:00 GMT"


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    # An answer in one packet: in two, each waits 40 ms for the other side.
    wbufsize, disable_nagle_algorithm = 1 << 16, True

    def _answer(self, status, body=b"", **headers):
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        if "Content_Length" not in headers:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    @property
    def _objects(self):
        return self.server.objects

    @property
    def _key(self):
        return unquote(urlsplit(self.path).path).lstrip("/")

    def do_PUT(self):
        data = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        self.server.requests.add(self.command)
        for name in ("x-amz-copy-source", "x-goog-copy-source"):
            if self.headers.get(name):
                data = self._objects[unquote(self.headers[name]).lstrip("/")]
                self.server.requests.add(name)
        self._objects[self._key] = data
        etag = f'"{hash(data)}"'
        body = f"<CopyObjectResult><ETag>{etag}</ETag></CopyObjectResult>".encode()
        self._answer(200, body, ETag=etag)

    def do_GET(self):
        query = parse_qs(urlsplit(self.path).query)
        if "list-type" in query:
            self._list(self._key.strip("/"), query.get("prefix", [""])[0])
            return
        data = self._objects.get(self._key)
        if data is None:
            self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")
            return
        self._answer(
            200, data, ETag=f'"{hash(data)}"', Last_Modified=_DATE, Content_Length=str(len(data))
        )

    do_HEAD = do_GET

    def do_DELETE(self):
        self.server.requests.add(self.command)
        self._answer(204 if self._objects.pop(self._key, None) is not None else 404)

    def do_POST(self):
        # Several are deleted at once.
        data = self.rfile.read(int(self.headers.get("Content-Length") or 0)).decode()
        self.server.requests.add("DELETE")
        keys = [part.partition("</Key>")[0] for part in data.split("<Key>")[1:]]
        for key in keys:
            self._objects.pop(f"{self._key.strip('/')}/{unescape(key)}", None)
        gone = "".join(f"<Deleted><Key>{key}</Key></Deleted>" for key in keys)
        self._answer(200, f"<DeleteResult>{gone}</DeleteResult>".encode())

    def _list(self, bucket, prefix):
        begins = f"{bucket}/{prefix}"
        rows = "".join(
            f"<Contents><Key>{escape(key.removeprefix(bucket + '/'))}</Key><Size>{len(data)}</Size>"
            f'<LastModified>2026-11-29T12:00:00.000Z</LastModified><ETag>"{hash(data)}"</ETag>'
            "</Contents>"
            for key, data in sorted(self._objects.items())
            if key.startswith(begins)
        )
        body = f"<ListBucketResult><IsTruncated>false</IsTruncated>{rows}</ListBucketResult>"
        self._answer(200, body.encode())

    def log_message(self, *_):
        pass


@contextmanager
def object_server():
    """A server on this machine; it has its `url`, its `objects` and which `requests` it saw."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Handler)
    server.objects, server.requests = {}, set()
    server.url = f"http://127.0.0.1:{server.server_port}"
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
