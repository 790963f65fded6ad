"""The steps of docs/farm/Containerfile in bare Debians, where nothing builds containers.

    debootstrap --variant=minbase bookworm /tmp/bookworm      # as root, once
    python -m tests.benchmarks.farm_container /tmp/bookworm PLANNED.prt

FROM copies the bare system, RUN is a chroot, COPY and ENV are what they say; what a container adds
(layers, another user, limits) is not tried. Then the worker computes a share of a planned bake
without a network. Floor: it does, without bpy.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "docs" / "farm" / "Containerfile"
# What pip and apt need of this machine to reach their registries.
KEPT = re.compile(r"PIP_(?!FIND)|.*_proxy$|SSL_CERT_FILE$|REQUESTS_CA_BUNDLE$", re.IGNORECASE)
_CERTIFICATES = "etc/ssl/certs/ca-certificates.crt"


def steps(text):
    """(instruction, what follows) of each line of a Containerfile."""
    text = re.sub(r"^#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", " ")
    return [line.split(None, 1) for line in text.splitlines() if line.strip()]


class Stage:
    """A root that the steps of one FROM change."""

    def __init__(self, base, folder, certificates):
        self.root, self.variables = folder, {}
        subprocess.run(["cp", "-ax", base, folder], check=True)
        if certificates.exists():
            (folder / _CERTIFICATES).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(certificates, folder / _CERTIFICATES)
        for name in ("proc", "dev"):
            (folder / name).mkdir(exist_ok=True)

    def run(self, command, *before, **variables):
        """A command inside, in namespaces whose mounts end with it."""
        path = self.variables.get("PATH", "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin")
        given = {"HOME": "/root", "LANG": "C.UTF-8", **variables, **self.variables, "PATH": path}
        root = shlex.quote(str(self.root))
        mounts = f"mount --rbind /dev {root}/dev && mount -t proc proc {root}/proc && exec "
        inside = ["chroot", self.root, "env", "-i", *(f"{k}={v}" for k, v in given.items())]
        line = shlex.join(map(str, [*inside, "sh", "-c", command]))
        subprocess.run(["unshare", "-m", *before, "sh", "-c", mounts + line], check=True)


def main():
    """Build the stages, and let the last one compute a share of a bake."""
    base, planned = map(Path, sys.argv[1:])
    kept = {key: value for key, value in os.environ.items() if KEPT.match(key)}
    stages, begun = {}, time.perf_counter()
    with tempfile.TemporaryDirectory() as text:
        for word, rest in steps(FILE.read_text()):
            if word == "FROM":
                image, _, name = rest.partition(" AS ")
                stage = Stage(base, Path(text) / (name or "last"), Path("/") / _CERTIFICATES)
                stages[name] = stage
            elif word == "RUN":
                stage.run(rest, **kept)
            elif word == "COPY":
                *sources, to = rest.split()
                source = ROOT
                if sources[0].startswith("--from="):
                    source = stages[sources.pop(0).removeprefix("--from=")].root
                target = stage.root / to.lstrip("/")
                for each in sources:
                    origin = source / each.lstrip("/")
                    target.parent.mkdir(parents=True, exist_ok=True)
                    if origin.is_dir():
                        shutil.copytree(origin, target, symlinks=True)
                    else:
                        target.mkdir(exist_ok=True)
                        shutil.copy(origin, target)
            elif word == "ENV":
                name, _, value = rest.partition("=")
                stage.variables[name] = value.replace("$PATH", "/usr/sbin:/usr/bin:/sbin:/bin")
            elif word == "ENTRYPOINT":
                entry = shlex.join(re.findall(r'"([^"]+)"', rest))
            else:
                sys.exit(f"farm_container: what is {word}?")
            print(f"{time.perf_counter() - begun:5.0f} s  {word} {rest}", flush=True)
        size = subprocess.check_output(["du", "-sxm", stage.root / "opt"], text=True).split()[0]
        shutil.copytree(planned, stage.root / "shared" / "scene.prt")
        stage.run("! python3 -c 'import bpy' 2>/dev/null")
        stage.run(f"{entry} bake-blocks /shared/scene.prt --share 0/2 --quiet", "-n")
        stage.run("dask worker --version", "-n")
    print(f"the worker has {size} MB in /opt and computed its share")


if __name__ == "__main__":
    main()
