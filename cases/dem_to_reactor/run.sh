#!/usr/bin/env bash
# From particles to a coating: the DEM's bed velocity drives the reactor. Needs the extras `dem` and `fem`.
#   cases/dem_to_reactor/run.sh [OUTPUT_DIR]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-results/dem_to_reactor}
python=${PYTHON:-python}
mkdir -p "$out"

"$python" -m mpm dem "$here/powder.toml" -o "$out/dem" --overwrite
# The reactor's case names the profile relative to itself, so it runs beside a copy of it.
cp "$out/dem/profile_scaled.csv" "$out/"
sed "s|\.\./\.\./meshes|$here/../../meshes|" "$here/reactor.toml" > "$out/reactor.toml"
"$python" -m mpm run "$out/reactor.toml" -o "$out/reactor" --overwrite
