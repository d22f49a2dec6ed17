#!/usr/bin/env bash
# From particles to a coating: the DEM's bed velocity drives the reactor. Needs the extras `dem` and `fem`.
#   cases/dem_to_reactor/run.sh [OUTPUT_DIR]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-results/dem_to_reactor}
python=${PYTHON:-python}
mkdir -p "$out"

"$python" -m mpm dem "$here/powder.toml" -o "$out/dem" --overwrite
profile=$(cd "$out/dem" && pwd)/profile_scaled.csv
"$python" -m mpm run "$here/reactor.toml" -o "$out/reactor" --overwrite --set "motion.profile=$profile"
