#!/usr/bin/env python3
"""A sweep against as many runs of ngspice, wall clock, both on all cores: sweep.py DECK [BINARY] [--runs 64]

DECK is an actuator's (a_1ms of the benchmarks, say) whose command is `PULSE(0 0.05 ...)`: its height goes from 0.02 to 0.05 m.
bondspice runs it once as written and once with steps of its own (`hmax=auto`, the loosest reltol whose final values are no farther
off than ngspice's). Prints seconds, ratios, and of each the largest error of the final value of every saved signal, as a part of the
signal's range in the reference (bondspice with reltol=1e-8 and hmax=auto, one run for every eighth height).
"""
import argparse
import concurrent.futures
import csv
import os
import re
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from raw import read_raw

LOW, HIGH = 0.02, 0.05
EVERY = 8


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("deck")
    parser.add_argument("binary", nargs="?", default="target/release/bondspice")
    parser.add_argument("--runs", type=int, default=64)
    args = parser.parse_args()
    text, found = re.subn(r"PULSE\(0 0\.05 ", "PULSE(0 {height} ", open(args.deck).read())
    if found != 1:
        sys.exit("the deck has no command PULSE(0 0.05 ...)")
    signals = re.search(r"^\.save\s+(.*)$", text, re.M | re.I).group(1).split()
    heights = [LOW + (HIGH - LOW) * k / (args.runs - 1) for k in range(args.runs)]
    with tempfile.TemporaryDirectory() as scratch:
        place = lambda name: os.path.join(scratch, name)
        head, body = text.split("\n", 1)
        open(place("ours.cir"), "w").write(f"{head}\n.param height=0.05\n{body}")
        for k, height in enumerate(heights):
            open(place(f"{k}.cir"), "w").write(text.replace("{height}", f"{height:.17g}"))

        def theirs(k):
            command = ["ngspice", "-b", "-r", place(f"{k}.raw"), place(f"{k}.cir")]
            subprocess.run(command, capture_output=True, check=True)

        def ours(name, options):
            command = [args.binary, "sweep", place("ours.cir"), "-q", "-o", place(name)]
            command += ["--vary", f"height={LOW}..{HIGH}:{args.runs}"]
            for k, signal in enumerate(signals):
                command += ["--measure", f"m{k}=final({signal})"]
            for option in options:
                command += ["--option", option]
            begin = time.perf_counter()
            subprocess.run(command, check=True)
            seconds = time.perf_counter() - begin
            rows = list(csv.reader(open(place(name))))[1:]
            return seconds, [[float(v) for v in row[-len(signals):]] for row in rows]

        begin = time.perf_counter()
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(theirs, range(args.runs)))
        peer = time.perf_counter() - begin
        spice = [read_raw(place(f"{k}.raw")) for k in range(args.runs)]
        finals = [[trace[s.lower()][-1] for s in signals] for trace in spice]

        reference, ranges = {}, {}
        for k in range(0, args.runs, EVERY):
            tight = ["--option", "reltol=1e-8", "--option", "hmax=auto"]
            subprocess.run([args.binary, "simulate", place(f"{k}.cir"), "-q", "-o", place("r.raw")] + tight, check=True)
            trace = read_raw(place("r.raw"))
            reference[k] = [trace[s.lower()][-1] for s in signals]
            ranges[k] = [max(trace[s.lower()]) - min(trace[s.lower()]) for s in signals]

        def error(values):
            return max(
                abs(values[k][s] - reference[k][s]) / (ranges[k][s] or 1.0) for k in reference for s in range(len(signals))
            )

        limit = error(finals)
        print(f"{'':24} {'s':>8} {'ratio':>8} {'error':>9}")
        print(f"{'ngspice':24} {peer:8.2f} {'':8} {limit:9.1e}")
        seconds, values = ours("written.csv", [])
        print(f"{'bondspice, as written':24} {seconds:8.2f} {peer / seconds:7.1f}x {error(values):9.1e}")
        for reltol in ("1e-2", "3e-3", "1e-3", "3e-4", "1e-4", "1e-5", "1e-6"):
            seconds, values = ours("free.csv", ["hmax=auto", f"reltol={reltol}"])
            if error(values) <= 1.05 * limit:
                name = f"bondspice, free {reltol}"
                print(f"{name:24} {seconds:8.2f} {peer / seconds:7.1f}x {error(values):9.1e}")
                break


if __name__ == "__main__":
    main()
