#!/usr/bin/env python3
"""How far bondspice is from ngspice, both at tight tolerance, on decks given: agreement.py FOLDER [BINARY] [--only TEXT]

Decks as a benchmark names them: a_* (an actuator), b_* (a ladder), c_* (a grid), d_* (a converter), e_* (channels on one bus), f_*
(rectifiers). Each is run over a part of its time with the step limit of LIMITS in ngspice and with reltol=1e-7 tol=spice in bondspice. A row for
each saved signal: the largest |difference| as a part of the reference's range. Prints the figures; fails where one is above its bound.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from raw import at, read_raw

# Beginning of the deck's name: end of the run, ngspice's step limit, bound.
LIMITS = [
    ("a_1ms", 1.2, 5e-6, 1e-4),
    ("b_1e3", 1e-3, 2e-8, 1e-4),
    ("c_50", 10e-6, 2e-8, 1e-4),
    ("d_buck", 2e-3, 5e-9, 5e-4),
    ("e_10", 0.1, 5e-6, 1e-4),
    ("f_rc", 6e-3, 1e-7, 1e-4),
    ("f_bridge", 60e-3, 2e-7, 1e-4),
    ("f_multiplier", 30e-6, 1e-9, 1e-4),
]
TIGHT = "reltol=1e-6 abstol=1e-12 vntol=1e-9 chgtol=1e-18"


def deck_for(text, stop, limit, options):
    """The deck over a shorter span, its step limit and tolerances replaced."""
    uic = " uic" if re.search(r"^\.tran.*\buic\b", text, re.M | re.I) else ""
    text = re.sub(r"^\.tran.*$", f".tran {stop / 1000:g} {stop:g} 0 {limit:g}{uic}", text, flags=re.M | re.I)
    method = re.search(r"method=\S+", text, re.I)
    line = f".options {options} {method.group(0) if method else ''}"
    return re.sub(r"^\.options.*$", line, text, flags=re.M | re.I)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("binary", nargs="?", default="target/release/bondspice")
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    failed = False
    for name, stop, limit, bound in LIMITS:
        path = os.path.join(args.folder, name + ".cir")
        if args.only not in name or not os.path.exists(path):
            continue
        text = open(path).read()
        with tempfile.TemporaryDirectory() as scratch:
            place = lambda file: os.path.join(scratch, file)
            open(place("theirs.cir"), "w").write(deck_for(text, stop, limit, TIGHT))
            open(place("ours.cir"), "w").write(deck_for(text, stop, limit, "reltol=1e-7"))
            subprocess.run(["ngspice", "-b", "-r", place("theirs.raw"), place("theirs.cir")], capture_output=True, check=True)
            ours = [args.binary, "simulate", place("ours.cir"), "-q", "-o", place("ours.raw")]
            tight = ["--option", "hmax=auto", "--option", "method=auto", "--option", "tol=spice"]
            subprocess.run(ours + tight, check=True)
            theirs, ours = read_raw(place("theirs.raw")), read_raw(place("ours.raw"))
        for signal, expected in theirs.items():
            if signal == "time":
                continue
            mine = at(ours["time"], ours[signal], theirs["time"])
            span, size = max(expected) - min(expected), max(map(abs, expected))
            still = span <= 1e-10 * size
            span = (size if still else span) or 1.0
            worst, when = max((abs(a - b) / span, t) for a, b, t in zip(mine, expected, theirs["time"]))
            verdict = "" if worst <= bound else "  ABOVE"
            failed |= worst > bound
            note = ", of its size: nothing but rounding moves it" if still else ""
            print(f"{name:14} {signal:12} {worst:9.2e} at {when:.6g} s, bound {bound:g}{note}{verdict}", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
