#!/usr/bin/env bash
# CPU time and error of the actuator: `bondspice simulate` on the model against `ngspice -b` on the emitted netlist.
#
#   benches/actuator.sh [RUNS]        prints the table of the README; needs cargo, ngspice and python3
#
# CPU time is user + system of the whole process, the smallest of RUNS (7) runs taken in turn. The error is the largest over x, theta, I,
# Omega, dPp, Qp, alpha, Pelec of max |difference| / range against the reference trajectory in tests/reference/.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
exec python3 benches/actuator.py "${1:-7}"
