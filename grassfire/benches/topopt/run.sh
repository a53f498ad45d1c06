#!/bin/sh
# The optimizer beside pyMOTO (from PyPI, into a virtual environment of its own): the same cantilever, one thread, one run.
# Arguments: SCALE ITERATIONS (default 1 40 and 2 5).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
build=${CARGO_TARGET_DIR:-$root/target}
if [ ! -x "$build/pymoto/bin/python" ]; then
    python3 -m venv "$build/pymoto"
    "$build/pymoto/bin/pip" install --quiet --disable-pip-version-check 'pymoto==2.0.1'
fi
cd "$root"
cargo build --release --locked -p grassfire-cli
compare() {
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 "$build/pymoto/bin/python" "$here/compare.py" \
        "$build/release/grassfire" examples/cantilever/case.toml "$@"
}
if [ $# -gt 0 ]; then compare "$@"; else compare 1 40; compare 2 5; fi
