"""Reads binary RAW files and their values between rows."""
from array import array


def read_raw(path):
    """Columns by name, in lower case."""
    head, body = open(path, "rb").read().split(b"Binary:\n", 1)
    lines = head.decode("latin-1").splitlines()
    count = int(next(line for line in lines if line.startswith("No. Variables")).split(":")[1])
    start = next(k for k, line in enumerate(lines) if line.startswith("Variables:")) + 1
    names = [lines[start + k].split()[1].lower() for k in range(count)]
    values = array("d")
    values.frombytes(body[: len(body) // (8 * count) * 8 * count])
    return {name: values[k::count] for k, name in enumerate(names)}


def at(xs, ys, points):
    """Values at rising points, by straight lines."""
    out, i = [], 0
    for x in points:
        while i + 2 < len(xs) and xs[i + 1] < x:
            i += 1
        width = xs[i + 1] - xs[i]
        out.append(ys[i] if width == 0 else ys[i] + (ys[i + 1] - ys[i]) * (x - xs[i]) / width)
    return out
