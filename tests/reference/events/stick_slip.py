"""Writes stick_slip.csv: the mass of models/stick_slip.bg, phase by phase, each ended by its event.

Stick: v = v_belt, F = k*x, until k*x = Fs. Slip: DOP853 at 1e-13 until v comes back to v_belt from below; then it sticks,
because |k*x| < Fs there.
"""
import csv
import numpy as np
from scipy.integrate import solve_ivp

m, k, vb, Fs, Fc, vs, until, step = 1.0, 100.0, 0.1, 2.0, 1.0, 0.05, 3.0, 5e-3


def force(u):
    return Fc + (Fs - Fc) / (1 + abs(u) / vs)


def slip(t, y):
    return [y[1], (force(vb - y[1]) - k * y[0]) / m]


rows = np.arange(round(until / step) + 1) * step
x, t, out, events = 0.0, 0.0, {}, []
while t < until:
    end = t + (Fs / k - x) / vb
    for i, r in enumerate(rows):
        if t <= r < end:
            out[i] = (x + vb * (r - t), vb, k * (x + vb * (r - t)))
    events.append(end)
    t, x = end, Fs / k
    if t >= until:
        break
    back = lambda t_, y: y[1] - vb
    back.terminal, back.direction = True, 1
    # At the break-away itself the speed is v_belt, and its slope 0: a first short step by the series of the solution.
    # u = vb - v: m u' = k x - F(u), k x' = k (vb - u); from rest u' = k vb t/m + (Fs - Fc)/(m vs) u.
    a, b = (Fs - Fc) / (m * vs), k * vb / m
    h = 1e-5
    u = b / a**2 * (np.expm1(a * h) - a * h)
    y0 = [x + vb * h - b / a**2 * (np.expm1(a * h) / a - h - a * h * h / 2), vb - u]
    s = solve_ivp(slip, (t + h, until + 1), y0, method="DOP853", rtol=1e-13, atol=1e-15, events=back, dense_output=True)
    end = s.t_events[0][0]
    for i, r in enumerate(rows):
        if t <= r < end:
            # Within the first short step nothing has moved away yet: u is below 1e-9 m/s there.
            y = s.sol(r) if r >= t + h else (x + vb * (r - t), vb)
            out[i] = (y[0], y[1], force(vb - y[1]))
    events.append(end)
    t, x = end, s.y_events[0][0][0]
    assert abs(k * x) < Fs
with open("stick_slip.csv", "w", newline="") as handle:
    writer = csv.writer(handle, lineterminator="\n")
    writer.writerow(["time", "x", "v", "F"])
    for i, r in enumerate(rows):
        writer.writerow([repr(float(r)), *(repr(float(v)) for v in out[i])])
print("events", events)
