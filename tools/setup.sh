#!/bin/bash
# Installs what grassfire needs to build and is missing: a C++ compiler, OpenCASCADE's headers, Rust.
# With the word "test" also what the outside checks need: Python with venv, the libraries that gmsh's wheel links to, CalculiX.
# Does nothing, and needs neither root nor network, when all is there.
set -euo pipefail
cd "$(dirname "$0")/.."
. tools/env.sh

fail() { echo "setup: $*" >&2; exit 2; }

# What is missing, as Debian packages.
packages=()
command -v c++ >/dev/null 2>&1 || packages+=(g++)
command -v cc >/dev/null 2>&1 || packages+=(gcc)
headers=/usr/include/opencascade
if [ -n "${OCCT_ROOT:-}" ]; then
  headers=$OCCT_ROOT/include/opencascade
  [ -d "$headers" ] || headers=$OCCT_ROOT/include
fi
# The headers alone do not show that every module is there: one header for each -dev package.
has() { [ -f "$headers/$1" ]; }
has Standard_Version.hxx        || packages+=(libocct-foundation-dev)
has BRep_Builder.hxx            || packages+=(libocct-modeling-data-dev)
has BRepAlgoAPI_Fuse.hxx        || packages+=(libocct-modeling-algorithms-dev)
has STEPControl_Writer.hxx      || packages+=(libocct-data-exchange-dev)
has XCAFDoc_ShapeTool.hxx       || packages+=(libocct-ocaf-dev)
if [ "${1:-}" = test ]; then
  python3 -c 'import venv, ensurepip' >/dev/null 2>&1 || packages+=(python3 python3-venv)
  libraries=$(PATH=$PATH:/usr/sbin:/sbin ldconfig -p 2>/dev/null || true)
  loadable() { grep -q "$1" <<<"$libraries"; }
  loadable libGL.so.1          || packages+=(libgl1)
  loadable libGLU.so.1         || packages+=(libglu1-mesa)
  loadable libXcursor.so.1     || packages+=(libxcursor1)
  loadable libXfixes.so.3      || packages+=(libxfixes3)
  loadable libXft.so.2         || packages+=(libxft2)
  loadable libXinerama.so.1    || packages+=(libxinerama1)
  loadable libXrender.so.1     || packages+=(libxrender1)
  loadable libfontconfig.so.1  || packages+=(libfontconfig1)
  # Solves our tetrahedra once more.
  command -v ccx >/dev/null 2>&1 || packages+=(calculix-ccx)
fi
need_rust=
command -v cargo >/dev/null 2>&1 || need_rust=yes
if [ -n "$need_rust" ] && ! command -v curl >/dev/null 2>&1; then packages+=(curl ca-certificates); fi

if [ ${#packages[@]} -gt 0 ]; then
  list="${packages[*]}"
  command -v apt-get >/dev/null 2>&1 \
    || fail "missing: $list (Debian names). There is no apt-get here: install OpenCASCADE 7.6 or newer with headers and a C++ compiler, then set OCCT_ROOT to its folder."
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null 2>&1 || fail "missing: $list. Run as root: apt-get install $list"
    as_root=(sudo)
  fi
  echo "setup: installing $list"
  export DEBIAN_FRONTEND=noninteractive
  if ! "${as_root[@]}" apt-get install -y --no-install-recommends "${packages[@]}" >/dev/null 2>&1; then
    "${as_root[@]}" apt-get update -qq || fail "apt-get update failed; is there a network?"
    "${as_root[@]}" apt-get install -y --no-install-recommends "${packages[@]}" >/dev/null \
      || fail "could not install: $list"
  fi
fi

if [ -n "$need_rust" ]; then
  echo "setup: installing Rust with rustup into ${CARGO_HOME:-$HOME/.cargo}"
  curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh -s -- -y -q --profile minimal -c rustfmt -c clippy \
    || fail "could not install Rust; see https://rustup.rs"
  . tools/env.sh
fi

wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
have=$(rustc --version | cut -d' ' -f2)
if [ "$(printf '%s\n%s\n' "$wanted" "$have" | sort -V | head -n 1)" != "$wanted" ]; then
  fail "Rust $have is too old, $wanted is needed: rustup update stable"
fi
