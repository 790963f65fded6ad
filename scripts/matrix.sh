#!/bin/sh
# The tests on every supported Blender, each in a virtual environment of its own (.venv-VERSION).
set -eu
for pair in 3.11:4.2.23 3.11:4.5.15 3.11:5.0.1 3.13:5.2.3; do
  python=${pair%%:*} version=${pair##*:}
  if ! command -v "python$python" >/dev/null; then
    echo "matrix: python$python is missing, so bpy $version was not tested" >&2
    exit 1
  fi
  echo "== bpy $version, Python $python"
  if [ ! -e ".venv-$version/.ready" ]; then
    PYTHON=python$python BPY=bpy==$version sh scripts/setup.sh ".venv-$version"
    touch ".venv-$version/.ready"
  fi
  ".venv-$version/bin/python" -m pytest
done
