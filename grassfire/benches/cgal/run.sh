#!/bin/sh
# Benchmarks the medial stage side by side with CGAL: installs libcgal-dev (Debian) when it is
# missing, builds the peer, runs `cargo bench --bench medial`. Arguments go to the benchmark.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
if [ ! -e /usr/include/CGAL/Delaunay_triangulation_3.h ]; then
    as_root=
    [ "$(id -u)" -eq 0 ] || as_root=sudo
    $as_root apt-get install -y --no-install-recommends g++ libcgal-dev
fi
build=${CARGO_TARGET_DIR:-$here/../../../target}/cgal
mkdir -p "$build"
if [ ! "$build/delaunay" -nt "$here/delaunay.cpp" ]; then
    g++ -O3 -DNDEBUG -march=native -frounding-math -o "$build/delaunay" "$here/delaunay.cpp" -lmpfr -lgmp
fi
cd "$here/../.."
GRASSFIRE_CGAL=$(cd "$build" && pwd)/delaunay exec cargo bench --no-default-features --bench medial -- "$@"
