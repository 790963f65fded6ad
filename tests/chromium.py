"""A headless Chromium that tests drive over a pipe: Chrome's DevTools protocol, nothing else."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from time import monotonic

import pytest

_NAMES = "chromium", "chromium-browser", "google-chrome", "chrome"
_FLAGS = (
    "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe", "--no-first-run", "--hide-scrollbars", "--disable-extensions",
    "--disable-background-networking", "--disable-component-update", "--mute-audio",
)  # fmt: skip


def chromium_or_skip():
    """The path of a Chromium; without one the test is skipped, and says how to get it."""
    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _NAMES)), None)
    if path is None:
        pytest.skip("no Chromium: 'apt-get install chromium', or set CHROMIUM to its path")
    return path


class Browser:
    """One page in a headless Chromium.

    Attributes
    ----------
    requests : list of str
        URLs that the page asked for.
    errors : list of str
        What it wrote to its console as an error.
    """

    def __init__(self, width=960, height=540, flags=(), mobile=False):
        self._folder = tempfile.TemporaryDirectory(prefix="chromium-", ignore_cleanup_errors=True)
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()
        # The protocol's ends are descriptors 3 and 4.
        spare = [os.dup(to_browser), os.dup(from_browser)]
        while min(spare) < 5:
            spare = [os.dup(fd) for fd in spare]

        def ends():
            os.dup2(spare[0], 3)
            os.dup2(spare[1], 4)

        command = [chromium_or_skip(), *_FLAGS, *flags, f"--user-data-dir={self._folder.name}"]
        command += [f"--window-size={width},{height}", "about:blank"]
        log = subprocess.DEVNULL
        self._process = subprocess.Popen(
            command, stdout=log, stderr=log, preexec_fn=ends, close_fds=False
        )
        for fd in (to_browser, from_browser, *spare):
            os.close(fd)
        self._number, self._rest, self._session = 0, b"", None
        self.requests, self.errors = [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        answer = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = answer["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log", "Performance"):
            self.call(f"{domain}.enable")
        self.resize(width, height, mobile)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            os.write(self._out, b'{"id": 0, "method": "Browser.close"}\0')
            self._process.wait(10)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        os.close(self._out)
        self._folder.cleanup()

    def call(self, method, seconds=120, **parameters):
        """The result of a call of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        end = monotonic() + seconds
        while monotonic() < end:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]
            self._note(answer)
        raise TimeoutError(method)

    def _read(self):
        while b"\0" not in self._rest:
            part = os.read(self._in, 1 << 20)
            assert part, "Chromium ended"
            self._rest += part
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)

    def _note(self, event):
        method, values = event.get("method"), event.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(values["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.errors.append(str(values["exceptionDetails"])[:2000])
        elif method == "Runtime.consoleAPICalled" and values["type"] == "error":
            self.errors.append(str(values["args"])[:2000])
        elif method == "Log.entryAdded" and values["entry"]["level"] == "error":
            self.errors.append(values["entry"]["text"])

    def resize(self, width, height, mobile=False):
        """Give the page another size, in pixels; as a phone's where `mobile`."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=mobile,
        )  # fmt: skip

    def open(self, path):
        """Open a file and wait until the page says that it is ready."""
        self.call("Page.navigate", url=Path(path).resolve().as_uri())
        end = monotonic() + 60
        while monotonic() < end:
            if self.run("document.readyState === 'complete' && typeof PRT !== 'undefined'"):
                self.run("PRT.ready.then(() => true)")
                return
        raise TimeoutError(str(path))

    def run(self, script, seconds=120):
        """The value of a script's last expression, awaited; as JSON knows it."""
        answer = self.call(
            "Runtime.evaluate", seconds, expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def drop(self, name, data):
        """Let a file fall on the page, and wait until it was read."""
        code = base64.b64encode(data).decode()
        self.run(
            "(async () => { const text = atob(" + json.dumps(code) + "), bytes = new Uint8Array("
            "text.length); for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);"
            f"await PRT.page.read(new File([bytes], {json.dumps(name)})); }})()"
        )

    def picture(self, path):
        """Write what the page looks like to a PNG file."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        Path(path).write_bytes(base64.b64decode(data))
