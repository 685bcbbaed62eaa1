"""Prints the table of actuator.sh: CPU seconds and error of bondspice and of ngspice on the shipped actuator."""
import csv
import math
import os
import re
import subprocess
import sys
import tempfile

MODEL = "models/eha_one_line.bg"
BINARY = "target/release/bondspice"
# Column of the reference: what to observe in the model.
OBSERVED = {
    "x": "x", "theta": "theta", "I": "f(armature)", "Omega": "f(shaft)", "dPp": "e(pump_port)", "Qp": "f(line)", "alpha": "alpha",
    "Pelec": "power(bus)",
}
RUNS = {
    "nominal": [],
    "step": ["--drive", "x_ref = step(0.1 s, 0 mm, 20 mm)", "--drive", "M_FC = pwl(0 s, 0 N*m; 0.5 s, 0 N*m; 0.6 s, -6 kN*m; 1 s, -6 kN*m)",
             "--until", "1 s"],
}
OBSERVE = ["--observe", ", ".join(f'{expression} as "{name}"' for name, expression in OBSERVED.items())]


def cpu(command):
    """CPU seconds, user + system, of one run of the whole process."""
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, use = os.wait4(child.pid, 0)
    child.returncode = status
    if status:
        sys.exit(f"failed: {' '.join(command)}")
    return use.ru_utime + use.ru_stime


def read(path):
    with open(path, newline="") as handle:
        rows = list(csv.reader(handle))
    return {name: [float(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}


def error(reference, trace, jump):
    """Largest |difference| / range over the observed columns, rows within one emitted rise (1 us) of the jump left out."""
    worst = 0.0
    for name in OBSERVED:
        times, values, k = trace["time"], trace[name], 0
        span = max(reference[name]) - min(reference[name])
        for t, y in zip(reference["time"], reference[name]):
            if jump is not None and abs(t - jump) <= 1.001e-6:
                continue
            while k + 2 < len(times) and times[k + 1] < t:
                k += 1
            width = times[k + 1] - times[k]
            mine = values[k] if width == 0 else values[k] + (values[k + 1] - values[k]) * (t - times[k]) / width
            difference = abs(mine - y) / span
            worst = max(worst, difference if math.isfinite(difference) else math.inf)
    return worst


def main():
    runs = int(sys.argv[1])
    print("| run | simulator | steps at most | CPU s | error |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        path = lambda name: os.path.join(scratch, name)
        for run, options in RUNS.items():
            reference = read(f"tests/reference/eha/one_line_{run}.csv")
            jump = 0.1 if run == "step" else None
            arguments = [MODEL, "-q", *options, *OBSERVE]
            subprocess.run([BINARY, "convert", *arguments, "-o", path("as_emitted.cir"), "--map", path("map.json")], check=True)
            text = open(path("as_emitted.cir")).read()
            coarse, count = re.subn(r"(?m)^(\.tran\s+\S+\s+\S+\s+\S+\s+)\S+", r"\g<1>1e-3", text)
            assert count == 1, "one .tran card"
            open(path("coarse.cir"), "w").write(coarse)
            simulators = {
                ("bondspice", "free"): [BINARY, "simulate", *arguments, "-o", path("ours.csv")],
                ("ngspice", "1 ms"): ["ngspice", "-b", "-r", path("coarse.raw"), path("coarse.cir")],
                ("ngspice", "0.1 ms, as emitted"): ["ngspice", "-b", "-r", path("as_emitted.raw"), path("as_emitted.cir")],
            }
            times = {name: [] for name in simulators}
            for _ in range(runs):
                for name, command in simulators.items():
                    times[name].append(cpu(command))
            for (simulator, limit), raw in zip(simulators, ("", "coarse", "as_emitted")):
                trace = path("ours.csv")
                if raw:
                    trace = path(raw + ".csv")
                    subprocess.run([BINARY, "trace", path(raw + ".raw"), "--map", path("map.json"), "-o", trace], check=True)
                print(f"| {run} | {simulator} | {limit} | {min(times[simulator, limit]):.3f} | {error(reference, read(trace), jump):.1e} |", flush=True)


if __name__ == "__main__":
    main()
