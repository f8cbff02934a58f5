"""The filter of S00's appendix 6.5 in numpy, straight from its printed program, for tests/gnss_published.rs.

usage: gnss_published.py FOLDER VARIANT EVERY STOP

FOLDER holds fixes.csv (time, latitude, longitude, height, north, east and down velocity; rad, m, m/s), imu.csv (time,
specific force, rate; m/s^2, rad/s, body axes) and initial.csv (latitude, longitude, height, three velocities, roll,
pitch, yaw, three biases). VARIANT is program, text, printed or corrected; EVERY the fixes from one update to the next;
STOP 1 or 0, the stop detector. Prints a line per inertial sample: 15 states, 15 variances.
"""

import os
import sys

VERSION = "2.4.6"

import numpy as np
from numpy import arctan2, cos, sin, sqrt
from numpy.linalg import inv, norm

folder, variant, every, stop_detector = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4] == "1"
text = variant in ("text", "printed")
printed = variant == "printed"
corrected = variant == "corrected"
fixes, imu, initial = (
    np.loadtxt(os.path.join(folder, name), delimiter=",") for name in ("fixes.csv", "imu.csv", "initial.csv")
)

oie_e = np.array([0, 0, 7292115e-11])
dt = 1 / 50
geb_g = np.array([0, 0, 9.82171])
offset = 62

if corrected:
    semi_major, flattening = 6378137.0, 1 / 298.257223563
else:
    semi_major, flattening = 6371000.0, 0.0
ecc2 = flattening * (2 - flattening)


def Rx(a):
    s, c = (-sin(a) if printed else sin(a)), cos(a)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def Ry(a):
    s, c = (-sin(a) if printed else sin(a)), cos(a)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def Rz(a):
    s, c = (-sin(a) if printed else sin(a)), cos(a)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def crossm(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def expm(m):
    """Its power series; the argument is small."""
    total, term = np.eye(3), np.eye(3)
    for n in range(1, 20):
        term = term @ m / n
        total = total + term
    return total


def geod2ECEF(lat, lon, h):
    n = semi_major / sqrt(1 - ecc2 * sin(lat) ** 2)
    return np.array([(n + h) * cos(lat) * cos(lon), (n + h) * cos(lat) * sin(lon), (n * (1 - ecc2) + h) * sin(lat)])


def ECEF2geod(r):
    """By fixed-point iteration on the latitude."""
    p = sqrt(r[0] ** 2 + r[1] ** 2)
    lat = arctan2(r[2], p * (1 - ecc2))
    for _ in range(20):
        n = semi_major / sqrt(1 - ecc2 * sin(lat) ** 2)
        lat = arctan2(r[2] + ecc2 * n * sin(lat), p)
    return lat, arctan2(r[1], r[0])


def geographic(lat, lon):
    return np.array(
        [
            [-sin(lat) * cos(lon), -sin(lat) * sin(lon), cos(lat)],
            [-sin(lon), cos(lon), 0],
            [-cos(lat) * cos(lon), -cos(lat) * sin(lon), -sin(lat)],
        ]
    )


# Design matrices: rows by the states they take, counted from 1 as in the source.
def design(columns):
    return np.array([[1.0 if c == n else 0.0 for n in range(1, 16)] for c in columns])


H1 = design([1, 2, 3, 4, 5, 6, 4, 5, 6, 7, 8, 9, 10, 11, 12])
H2 = design([4, 5, 6, 7, 8, 10, 11, 12])
phi = np.eye(15)
for i in range(3):
    phi[i, i + 3] = dt
    if not (printed and i == 2):
        phi[i + 6, i + 9] = dt
        phi[i + 6, i + 12] = -dt

rates = [0.0134**2, 0.0234**2, 0.0053**2] if text else [1.8e-4, 5.5e-4, 2.9e-5]
pitch_r, yaw_r = (100.0**2, 100.0**2) if text else (1e5, 1e10)
r1 = np.array([36.0] * 3 + [0.43**2] * 3 + [1.0] * 3 + [1e4, pitch_r, yaw_r] + rates)
r2 = np.array([1.0] * 3 + [1e4, pitch_r] + rates)

q1, q2, q5 = (2.2**2 if text else 5.0), 4.0, 1e-6
q3 = [1.0, 1.0, 3.16**2 if text else 10.0]
Q = np.zeros((15, 15))
for i in range(3):
    Q[i, i] = q1 * dt + q2 * dt**3 / 3
    Q[i, i + 3] = Q[i + 3, i] = q2 * dt**2 / 2
    Q[i + 3, i + 3] = q2 * dt
    Q[i + 6, i + 6] = q3[i] * dt + rates[i] * dt**3 / 3 + (q5 if corrected else -q5) * dt**3 / 3
    Q[i + 6, i + 9] = Q[i + 9, i + 6] = rates[i] * dt**2 / 2
    Q[i + 6, i + 12] = Q[i + 12, i + 6] = -q5 * dt**2 / 2
    Q[i + 9, i + 9] = rates[i] * dt
    Q[i + 12, i + 12] = q5 * dt

posTime, memsTime = fixes[:, 0], imu[:, 0]
fis_b, ois_b = imu[:, 1:4], imu[:, 4:7]

memsNum = 0
while memsTime[memsNum] < posTime[0]:
    memsNum += 1

Ce_g = geographic(initial[0], initial[1])
Xr = np.concatenate([geod2ECEF(*initial[:3]), Ce_g.T @ initial[3:6], initial[6:9], ois_b[memsNum], initial[9:12]])
P = np.diag([3, 3, 3, 0.36, 0.36, 0.36, 1, 1, 1, 1e-4, 1e-4, 1e-4, 1e-1, 1e-1, 1e-1])

out = []
for posNum in range(1, len(fixes)):
    posUpdated = False
    fix = fixes[posNum - 1]
    while memsNum < len(imu) and memsTime[memsNum] < posTime[posNum]:
        m = memsNum - offset
        roll, pitch, yaw = Xr[6:9]
        Cb_g = Rz(yaw) @ Ry(pitch) @ (Rx(roll) if text or corrected else Rx(0))
        Cb_e = Ce_g.T @ Cb_g
        veb_e = Xr[3:6].copy()
        oeb_b = ois_b[m] - Xr[12:15] - (Cb_e if printed else Cb_e.T) @ oie_e
        if corrected:
            Cb_e_hat = Cb_e @ expm(crossm(oeb_b) * dt)
        else:
            Cb_e_hat = Cb_e + Cb_e @ crossm(oeb_b) * dt
        Oie_e = crossm(oie_e)
        if text:
            aeb_e = Cb_e @ fis_b[m] - 2 * Oie_e @ veb_e + Ce_g.T @ geb_g
        else:
            tilt = Rx(-roll) @ Ry(-pitch) if corrected else Rz(0) @ Ry(-pitch) @ Rx(-roll)
            aeb_e = Cb_e_hat @ (fis_b[m] + tilt @ geb_g) - 2 * Oie_e @ veb_e
        if corrected:
            forward = Cb_e_hat[:, 0]
            veb_e = (Cb_e[:, 0] @ veb_e + forward @ aeb_e * dt) * forward
        else:
            veb_e = Cb_e_hat @ np.array([norm(veb_e), 0, 0]) + aeb_e * dt
        ax, ay, az = fis_b[m]
        acc_roll = arctan2(-ay, -az)
        acc_pitch = arctan2(ax, sqrt(ay**2 + az**2))
        available = posNum % every == 1 and not posUpdated and posNum != 1
        speed = norm(fix[4:7])
        if available and (text or speed > 3):
            posUpdated = True
            gps_yaw = arctan2(fix[5], fix[4]) % (2 * np.pi)
            if corrected:
                while gps_yaw - yaw > np.pi:
                    gps_yaw -= 2 * np.pi
                while gps_yaw - yaw < -np.pi:
                    gps_yaw += 2 * np.pi
            z = np.concatenate(
                [geod2ECEF(*fix[1:4]), Ce_g.T @ fix[4:7], veb_e, [acc_roll, acc_pitch, gps_yaw], ois_b[m]]
            )
            H, r = H1, r1
            keep = list(range(15))
            if printed:
                keep = keep[:13]
            if speed <= 3:
                keep.remove(11)
            if corrected:
                keep = [i for i in keep if i not in (6, 7, 8)]
            z, H, r = z[keep], H[keep], r[keep]
        else:
            z = np.concatenate([veb_e, [acc_roll, acc_pitch], ois_b[m]])
            H, r = H2, r2
            if corrected:
                z, H, r = z[3:], H[3:], r[3:]
        R = np.diag(r)
        f = fis_b[m - 50 : m + 1]
        variance = np.var(f[:, 0], ddof=1) + np.var(f[:, 1], ddof=1)
        if stop_detector and variance < 0.048:
            Xr[3:6] = 0
            f = f.mean(axis=0)
            Xr[6] = arctan2(-f[1], -f[2])
            Xr[7] = arctan2(f[0], sqrt(f[1] ** 2 + f[2] ** 2))
        else:
            Xr = phi @ Xr
            P = phi @ P @ phi.T + Q
            if corrected:
                Xr[3:6] = veb_e
            K = P @ H.T @ inv(H @ P @ H.T + R)
            Xr = Xr + K @ (z - H @ Xr)
            P = (np.eye(15) - K @ H) @ P
            Ce_g = geographic(*ECEF2geod(Xr[:3]))
        out.append(np.concatenate([Xr, np.diag(P)]))
        memsNum += 1

for row in out:
    print(",".join(repr(float(value)) for value in row))
