#!/usr/bin/env python3
"""Cost of a run and of a step against the number of unknowns: scaling.py [BINARY] [--only chain|bus|mesh] [--most N] [--peer ngspice]

  chain  an RC ladder
  bus    RC branches side by side at one node, which a source feeds through a resistor
  mesh   a square grid of resistors, a capacitor at every node

From 10 to 1e6 unknowns (meshes to 3e5). A run is one of 60 µs with rows every µs, by the method that bondspice takes by itself: CPU time of the whole
process (user + system), the least of n runs, and its peak memory. A step is one of the trapezoidal rule with a limit that binds: what a longer run
costs more, for each step it takes more; one whose cost the differences between runs hide is shown as -, and --no-steps leaves it out. Peaks below
this script's own (some 15 to 30 MiB) are hidden by it. The last lines are exponents p of cost ~ unknowns^p, from the largest three sizes. With --peer,
the peer's peak memory on the same decks (to --peer-most unknowns) stands beside.
"""
import argparse
import json
import math
import os
import subprocess
import tempfile

SIZES = [10, 100, 1000, 10_000, 100_000, 300_000, 1_000_000]
MOST = {"chain": 1_000_000, "bus": 1_000_000, "mesh": 300_000}


def chain(n):
    parts = (f"R{k} n{k} n{k + 1} 1\nC{k} n{k + 1} 0 1u" for k in range(n))
    return "n1", "V1 n0 0 PULSE(0 1 1u 1u 1u 1 2)\n" + "\n".join(parts)


def bus(n):
    # The source's resistance falls with the number of branches, so that all sizes show the same course.
    parts = (f"R{k} b n{k} {1 + k % 7}\nC{k} n{k} 0 {1 + k % 3}u" for k in range(n))
    return "b", f"V1 s 0 PULSE(0 1 1u 1u 1u 1 2)\nRs s b {1 / n:.6g}\nCb b 0 {n:g}u\n" + "\n".join(parts)


def mesh(n):
    side = max(2, round(math.sqrt(n)))
    lines = ["V1 s 0 PULSE(0 1 1u 1u 1u 1 2)", "Rs s g0_0 1"]
    for i in range(side):
        for j in range(side):
            if i + 1 < side:
                lines.append(f"Ra{i}_{j} g{i}_{j} g{i + 1}_{j} 1")
            if j + 1 < side:
                lines.append(f"Rb{i}_{j} g{i}_{j} g{i}_{j + 1} 1")
            lines.append(f"C{i}_{j} g{i}_{j} 0 1u")
    return "g0_0", "\n".join(lines)


KINDS = {"chain": chain, "bus": bus, "mesh": mesh}


def write_deck(path, body, node, steps):
    stop = steps * 1e-6
    text = f"* scaling\n{body}\n.options reltol=1e-3 abstol=1e-9 vntol=1e-6\n.save v({node})\n.tran 1u {stop:g} 0 1u\n.end\n"
    with open(path, "w") as deck:
        deck.write(text)


def run(command, n=1):
    """The least CPU seconds and the peak MiB of n runs, and what the last one said."""
    best = (math.inf, 0.0)
    said = b""
    for _ in range(n):
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        said = child.stderr.read()
        _, status, use = os.wait4(child.pid, 0)
        child.returncode = status
        if status:
            raise SystemExit(f"{' '.join(command)} failed: {said.decode()[-500:]}")
        best = (min(best[0], use.ru_utime + use.ru_stime), max(best[1], use.ru_maxrss / 1024))
    return *best, said


FEW = 60


def simulate(binary, scratch, deck, n, *options):
    """CPU seconds, peak MiB and counters of a run."""
    command = [binary, "simulate", deck, "-o", os.path.join(scratch, "out.raw"), "--stats", "json", *options]
    seconds, peak, said = run(command, n)
    return seconds, peak, json.loads(next(line for line in said.splitlines() if line.startswith(b"{")))


def measure(binary, scratch, kind, size, n, steps):
    """Unknowns, seconds and MiB of a run, seconds of a step, and the deck."""
    node, body = KINDS[kind](size)
    deck = os.path.join(scratch, "deck.cir")
    longer = os.path.join(scratch, "longer.cir")
    write_deck(deck, body, node, FEW)
    seconds, peak, stats = simulate(binary, scratch, deck, n)
    step = 0.0
    if steps:
        # As many steps more as take a measurable time, whatever the size.
        write_deck(longer, body, node, FEW + max(100, min(100_000, 20_000_000 // size)))
        short, long = (simulate(binary, scratch, path, n, "--option", "method=trap") for path in (deck, longer))
        step = (long[0] - short[0]) / (long[2]["accepted"] - short[2]["accepted"])
    return stats["equations"], seconds, step, peak, deck


def exponent(points):
    """The slope of log(cost) over log(size) of the last three sizes, by least squares."""
    points = [(math.log(x), math.log(y)) for x, y in points if y > 0][-3:]
    if len(points) < 2:
        return math.nan
    mx, my = (sum(column) / len(points) for column in zip(*points))
    return sum((x - mx) * (y - my) for x, y in points) / sum((x - mx) ** 2 for x, _ in points)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", nargs="?", default="target/release/bondspice")
    parser.add_argument("--only", choices=KINDS)
    parser.add_argument("--most", type=float, default=math.inf)
    parser.add_argument("--no-steps", action="store_true")
    parser.add_argument("--peer")
    parser.add_argument("--peer-most", type=float, default=1e4)
    parser.add_argument("-n", type=int, default=2)
    args = parser.parse_args()
    peer_head = "| peer's MiB " if args.peer else ""
    print(f"| circuit | unknowns | a run, s | MiB | µs a step | ns a step, an unknown {peer_head}|")
    print("|---" * (7 if args.peer else 6) + "|")
    exponents = []
    for kind in KINDS if args.only is None else [args.only]:
        points = []
        for size in SIZES:
            if size > min(MOST[kind], args.most):
                continue
            with tempfile.TemporaryDirectory() as scratch:
                unknowns, seconds, step, peak, deck = measure(args.binary, scratch, kind, size, args.n, not args.no_steps)
                cell = ""
                if args.peer:
                    wanted = size <= args.peer_most
                    peer = f"{run([args.peer, '-b', '-r', os.path.join(scratch, 'peer.raw'), deck])[1]:.0f}" if wanted else "-"
                    cell = f" {peer} |"
            points.append((unknowns, seconds, peak, step))
            costs = f"{step * 1e6:.3g} | {step * 1e9 / unknowns:.3g}" if step > 0 else "- | -"
            print(f"| {kind} | {unknowns} | {seconds:.3g} | {peak:.0f} | {costs} |{cell}", flush=True)
        if len(points) >= 3:
            of = lambda k: exponent([(p[0], p[k]) for p in points])
            exponents.append(f"| {kind} | {of(1):.2f} | {of(2):.2f} | {of(3):.2f} |")
    print("\n| exponents of the largest three | a run | memory | a step |")
    print("|---|---|---|---|")
    print("\n".join(exponents))


if __name__ == "__main__":
    main()
