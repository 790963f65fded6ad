"""Blender with a window: make test-window BLENDER="command" (several, separated by ':').

A command runs Blender with the arguments it is given, in a folder of its own: the current folder
may have another name for that Blender, so everything is named relative to it.
"""

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLATFORM = {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}[sys.platform]
_PROBE = """
import json, os, sys, bpy
probe = [os.getcwd(), bpy.app.version_string, "%d.%d" % sys.version_info[:2]]
open("probe.json", "w").write(json.dumps(probe))
"""


class RealBlender:
    """One of the commands, in a folder that holds the extension's zip as it is given away."""

    def __init__(self, command, folder):
        self.command, self.folder = shlex.split(command), folder
        (folder / "probe.py").write_text(_PROBE)
        self.run("-b", "--factory-startup", "-P", "probe.py")
        probe = folder / "probe.json"
        assert probe.is_file(), f"{command}: it does not run a Blender in the current folder"
        self.inside, self.version, python = json.loads(probe.read_text())
        build = [sys.executable, ROOT / "scripts" / "build_extension.py", "--platforms", PLATFORM]
        build += ["--pythons", python, "--output", folder / "zip"]
        done = subprocess.run([str(part) for part in build], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        (built,) = (folder / "zip").glob("*.zip")
        shutil.move(built, folder / "extension.zip")

    def run(self, *arguments, user=None, seconds=900):
        """Run it, with the folder `user` for what it keeps of its user."""
        environment = dict(os.environ)
        if user:
            environment["BLENDER_USER_RESOURCES"] = f"{self.inside}/{user}"
        command = [*self.command, *map(str, arguments)]
        with subprocess.Popen(
            command, cwd=self.folder, env=environment, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, start_new_session=True,
        ) as process:  # fmt: skip
            try:
                out, err = process.communicate(timeout=seconds)
            except subprocess.TimeoutExpired:
                # The command may be a script: what it has started ends with it.
                if hasattr(os, "killpg"):
                    os.killpg(process.pid, signal.SIGKILL)
                process.kill()
                raise
        return subprocess.CompletedProcess(command, process.returncode, out, err)

    def bring_scripts(self):
        for file in (ROOT / "tests" / "window" / "inside").glob("*.py"):
            shutil.copy(file, self.folder)

    def play(self, story, size=(1280, 900)):
        """Play a story in a window of a size; its report, with what Blender printed (`said_all`)
        and its exit `code`."""
        self.bring_scripts()
        report = self.folder / "report.json"
        # Where Blender crashes there is none, nor that of another story.
        report.unlink(missing_ok=True)
        done = self.run(
            "--factory-startup", "--enable-event-simulate", "--window-geometry", 0, 0, *size,
            "-P", "play.py", "--", story, user="user",
        )  # fmt: skip
        said = done.stdout + done.stderr
        assert report.is_file(), said
        return json.loads(report.read_text()) | {"said_all": said, "code": done.returncode}


def pytest_generate_tests(metafunc):
    if "blender" in metafunc.fixturenames:
        commands = [part.strip() for part in os.environ.get("BLENDER", "").split(":")]
        commands = [command for command in commands if command]
        metafunc.parametrize("blender", commands or [None], indirect=True, scope="session")


@pytest.fixture(scope="session")
def blender(request, tmp_path_factory):
    if request.param is None:
        pytest.fail('name a Blender: make test-window BLENDER="/path/to/blender"')
    return RealBlender(request.param, tmp_path_factory.mktemp("window"))
