#!/bin/sh
# Our quads beside those of Instant Meshes and QuadriFlow (from PyPI, into a virtual environment of its own), in one run.
# Arguments: PARTS (default: the real parts of the corpus, $GRASSFIRE_CORPUS or ../shared/data).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
build=${CARGO_TARGET_DIR:-$root/target}
corpus=${GRASSFIRE_CORPUS:-$root/../shared/data}
if [ ! -x "$build/peers/bin/python" ]; then
    python3 -m venv "$build/peers"
    "$build/peers/bin/pip" install --quiet --disable-pip-version-check \
        'numpy==2.4.6' 'scipy==1.17.1' 'pynanoinstantmeshes==0.0.3' 'pyQuadriFlow==0.0.4'
fi
if [ $# -eq 0 ]; then
    if [ ! -d "$corpus/dev" ]; then
        echo "peers: no corpus in $corpus, skipped"
        exit 0
    fi
    set -- "$corpus"/dev/simjeb_*.obj "$corpus"/dev/abc_*.obj "$corpus"/dev/featuretype.stl
fi
cd "$root"
cargo build --release --locked -p grassfire-cli
cargo build --release --locked -p grassfire --example faces
"$build/peers/bin/python" "$here/compare.py" "$build/release/grassfire" "$build/release/examples/faces" "$@"
