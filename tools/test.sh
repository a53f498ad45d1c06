#!/bin/bash
# Everything that must hold before a change is merged.
set -euo pipefail
cd "$(dirname "$0")/.."
. tools/env.sh

target=${CARGO_TARGET_DIR:-target}
step() { echo; echo "== $* ($(date +%H:%M:%S))"; }

missing=()
cargo fmt --version >/dev/null 2>&1 || missing+=(rustfmt)
cargo clippy --version >/dev/null 2>&1 || missing+=(clippy)
if [ ${#missing[@]} -gt 0 ]; then rustup component add "${missing[@]}"; fi

step format
cargo fmt --all --check

# One profile, one target folder and the same set of crates for all steps: cargo then compiles dependencies once for
# checking and once for running.
step lints
cargo clippy --release --locked --workspace --all-targets -- -D warnings
step lints without the CAD kernel
cargo clippy --release --locked -p grassfire -p grassfire-cli --all-targets --no-default-features -- -D warnings

step documentation
RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --no-deps -p grassfire -p grassfire-cli --quiet

# The unit tests run once, below: without the kernel the program itself must work.
step the program without the CAD kernel
demo=$(mktemp -d)
trap 'rm -rf "$demo"' EXIT
cargo build --release --locked -p grassfire-cli --no-default-features
cp "$target/release/grassfire" "$demo/grassfire"
without_kernel() {
  "$demo/grassfire" reconstruct examples/wishbone-free/proposal.stl --voxel 2 -o "$demo/no-kernel" -q || [ $? -eq 1 ]
  for file in body.obj body.stl skeleton.ply report.html; do
    test -s "$demo/no-kernel/$file"
  done
  if [ -e "$demo/no-kernel/part.step" ]; then echo "a STEP file without a kernel" >&2; exit 1; fi
}
# It runs while the compiler works on one core.
without_kernel &
without=$!

# Builds the program too.
step build
cargo test --release --locked --workspace --no-run
wait "$without"

# One core's work, and a download: beside the tests.
step demo and outside checks start
demo_checked() {
  "$target/release/grassfire" demo wishbone -o "$demo/wishbone" -q || [ $? -eq 1 ]
  tools/outside-check.sh "$demo/wishbone"
}
demo_checked >"$demo/outside.log" 2>&1 &
outside=$!

# Tests on real and on bad parts look for the corpus beside the repository or in GRASSFIRE_CORPUS, and say so when it
# is not there.
step tests
failed=0
if cargo nextest --version >/dev/null 2>&1; then
  cargo nextest run --release --locked --workspace --no-fail-fast || failed=$?
else
  cargo test --release --locked --workspace --no-fail-fast || failed=$?
fi
step outside checks
wait "$outside" || failed=$?
cat "$demo/outside.log"
if [ "$failed" -ne 0 ]; then exit "$failed"; fi
step done
