#!/bin/sh
# Makes the virtual environment $1 with the project, Blender as a module, and what the tests need.
# System libraries that Blender wants are installed with apt where that is allowed; otherwise the
# one command to run is printed.
set -eu
venv=$1
python=${PYTHON:-python3}
libraries="libx11-6 libxext6 libxrender1 libxfixes3 libxi6 libxxf86vm1 libxkbcommon0 libsm6 libice6 libgl1 libegl1 libuuid1"

version=$($python -c 'import sys; print("%d.%d" % sys.version_info[:2])')
case $version in
  3.11) bpy=${BPY:-bpy==5.0.1} ;;
  3.13) bpy=${BPY:-bpy==5.2.3} ;;
  *) echo "setup: Blender's module exists for Python 3.11 and 3.13, this is $version; run make PYTHON=python3.11" >&2; exit 1 ;;
esac

if command -v dpkg-query >/dev/null; then
  missing=""
  for library in $libraries; do
    dpkg-query -W -f '${Status}' "$library" 2>/dev/null | grep -q 'ok installed' \
      || dpkg-query -W -f '${Status}' "${library}t64" 2>/dev/null | grep -q 'ok installed' \
      || missing="$missing $library"
  done
  if [ -n "$missing" ]; then
    if [ "$(id -u)" = 0 ]; then
      apt-get update -qq
      DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
    else
      echo "setup: Blender needs system libraries. Run: sudo apt-get install -y$missing" >&2
      exit 1
    fi
  fi
fi

$python -m venv "$venv"
echo "setup: installing $bpy and the packages of the project into $venv (about 1.5 GB)"
# In one call, so that nothing raises numpy above what this Blender was built with.
"$venv/bin/pip" install -q "$bpy" -e ".[embree,report,test,dev]"
