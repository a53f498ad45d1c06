#!/bin/bash
# Re-reads the STEP of the wishbone demo with gmsh and with OCP (another OpenCASCADE), compares with report.json, meshes it at two
# sizes, edits it, and has CalculiX compute its stiffness.
# Skipped with a notice when Python or PyPI are not there.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$1
venv=.venv

skip() { echo "NOTICE: outside checks skipped: $*"; exit 0; }

if [ ! -f "$folder/part.step" ]; then echo "outside checks: $folder/part.step is missing" >&2; exit 1; fi
command -v python3 >/dev/null 2>&1 || skip "there is no python3"
if ! "$venv/bin/python" -c 'import gmsh, numpy; from OCP.STEPControl import STEPControl_Reader' >/dev/null 2>&1; then
  rm -rf "$venv"
  python3 -m venv "$venv" >/dev/null 2>&1 || skip "python3 has no venv module (Debian: apt-get install python3-venv)"
  "$venv/bin/pip" install --quiet --disable-pip-version-check 'gmsh>=4.11,<5' 'cadquery-ocp>=7.7,<8' numpy >"$venv/pip.log" 2>&1 \
    || skip "pip could not install gmsh, cadquery-ocp and numpy ($(tail -n 1 "$venv/pip.log"))"
fi
problem=$("$venv/bin/python" -c 'import gmsh, numpy; from OCP.STEPControl import STEPControl_Reader' 2>&1) || skip "$(tail -n 1 <<<"$problem")"
"$venv/bin/python" tools/verify_step.py --mesh auto --edit "$folder"

# The stiffness on tetrahedra, by grassfire and by CalculiX on the same mesh.
grassfire=${CARGO_TARGET_DIR:-target}/release/grassfire
command -v ccx >/dev/null 2>&1 || skip "there is no ccx (Debian: calculix-ccx)"
[ -x "$grassfire" ] || skip "there is no $grassfire"
PATH="$PWD/$venv/bin:$PATH" "$grassfire" verify "$folder/part.step" --case examples/wishbone-thick/case.toml --solver ccx \
  --set verify.h=3 --set verify.tetrahedra.size=6 -o "$folder/tetrahedra" -q || [ $? -eq 1 ]
"$venv/bin/python" - "$folder/tetrahedra/report.json" <<'PYTHON'
import json, sys
tets = json.load(open(sys.argv[1]))["verify"]["tetrahedra"]
ours, theirs = tets["strain_energy"], tets["calculix_strain_energy"]
print(f"{tets['elements']} tetrahedra: {ours:.7g} mJ, CalculiX {theirs:.7g} mJ; voxels {tets['voxel_ratio']:.4f} times ours")
if abs(ours / theirs - 1) > 1e-6:
    sys.exit("CalculiX finds another energy")
PYTHON
