#!/usr/bin/env bash
# Prepares everything that `make demo` and `make test` need; safe to run again and again.
#   1. system packages by apt: EGL and Mesa's software GL, LLVM (for the path tracer), the furniture pack
#   2. a virtual environment in .venv with the pinned Python packages and this project
set -euo pipefail
cd "$(dirname "$0")"

say() { printf '\033[1m==> %s\033[0m\n' "$*"; }
die() { printf 'error: %s\n' "$*" >&2; exit 1; }

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }
can_root() { [ "$(id -u)" = 0 ] || { command -v sudo >/dev/null && sudo -n true 2>/dev/null; }; }

# --- 1. system packages ------------------------------------------------------------------------
packages=(libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri libosmesa6 sweethome3d-furniture)
installed() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q 'ok installed'; }

if command -v dpkg-query >/dev/null; then
  missing=()
  for p in "${packages[@]}"; do installed "$p" || missing+=("$p"); done
  llvm=$(dpkg-query -W -f='${Package} ${Status}\n' 'libllvm*' 2>/dev/null | awk '/ok installed/ {print $1}' \
    | grep -E '^libllvm(1[7-9]|2[0-9])(t64)?$' | head -n 1 || true)
  if [ ${#missing[@]} -gt 0 ] || [ -z "$llvm" ]; then
    if can_root; then
      say "installing system packages: ${missing[*]:-} a recent libLLVM"
      as_root apt-get update -qq
      if [ -z "$llvm" ]; then
        # the newest LLVM that the distribution offers and Mitsuba's LLVM back end accepts
        llvm=$(apt-cache pkgnames libllvm | grep -E '^libllvm(1[7-9]|20)(t64)?$' | sort -V | tail -n 1 || true)
        [ -n "$llvm" ] && missing+=("$llvm") || echo "note: no libLLVM >= 17 on offer; light needs one: embodied doctor --fix"
      fi
      as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
    else
      [ ${#missing[@]} -eq 0 ] || die "these system packages are missing, and there is no root and no sudo here to install them:
    ${missing[*]}
  Ask an administrator to run:  apt-get install ${missing[*]} libllvm19
  Without root, install wheels with pip instead: docs/get_started.md."
    fi
  fi
else
  echo "note: this is not Debian or Ubuntu; install EGL, Mesa and the Sweet Home 3D furniture libraries yourself"
fi

# --- 2. virtual environment --------------------------------------------------------------------
python=${PYTHON:-}
if [ -z "$python" ]; then
  for candidate in python3.11 python3.12 python3.13 python3; do
    if command -v "$candidate" >/dev/null && "$candidate" -c 'import sys; raise SystemExit(not (3, 11) <= sys.version_info[:2] <= (3, 13))'; then
      python=$candidate; break
    fi
  done
fi
[ -n "$python" ] || die "Python 3.11, 3.12 or 3.13 is needed and none was found; install one, or name it: make PYTHON=/path/to/python3.12"

if ! [ -x .venv/bin/python ]; then
  say "creating the virtual environment .venv ($python)"
  "$python" -m venv .venv || {
    if can_root && command -v apt-get >/dev/null; then
      as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends python3-venv >/dev/null
      rm -rf .venv; "$python" -m venv .venv
    else die "cannot create a virtual environment; install the package python3-venv"; fi; }
fi

wanted=$(cat pyproject.toml setup.py constraints.txt | sha256sum | cut -c 1-64)
if [ "$(cat .venv/.ready 2>/dev/null)" != "$wanted" ]; then
  say "installing Python packages (a few minutes the first time)"
  index=()
  # without an NVIDIA GPU the CPU build of torch saves gigabytes; PyPI's own wheel is the CUDA one
  if ! command -v nvidia-smi >/dev/null && command -v curl >/dev/null \
     && curl -fsI --max-time 5 https://download.pytorch.org/whl/cpu/torch/ >/dev/null 2>&1; then
    index=(--extra-index-url https://download.pytorch.org/whl/cpu)
  fi
  .venv/bin/python -m pip install -q --disable-pip-version-check ${index[@]+"${index[@]}"} -c constraints.txt -e '.[dev]'
  # on Python 3.13 dm-control comes without labmaze, see pyproject.toml
  .venv/bin/python -c 'import dm_control' 2>/dev/null \
    || .venv/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt --no-deps dm-control
  echo "$wanted" > .venv/.ready
fi
