#!/usr/bin/env python3
"""Computes the reference vectors beside this script again, from the problems and measurements that they hold.

Needs filterpy 1.4.5 and numpy. With --check nothing is written, and the largest change is printed.
"""

import json
import sys
from pathlib import Path

import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

HERE = Path(__file__).parent
STRAIGHT = np.kron(np.eye(2), [[1.0, 1.0], [0.0, 1.0]])
POSITIONS = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def white_acceleration(density):
    return np.kron(np.eye(2), density * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]))


def kalman(problem, noise):
    f = KalmanFilter(dim_x=4, dim_z=2)
    f.x, f.P = np.array(problem["x0"], float), np.array(problem["P0"], float)
    f.F, f.H, f.Q, f.R = STRAIGHT, POSITIONS, noise, np.array(problem["R"], float)
    return f


def kf_cv2d(problem):
    f = kalman(problem, np.array(problem["Q"]))
    for step in problem["steps"]:
        f.predict()
        before = {"x_pred": f.x, "P_pred": f.P}
        f.update(np.array(step["z"]))
        yield {**before, "x": f.x, "P": f.P, "S": f.S, "log_likelihood": f.log_likelihood}


def bearing_residual(a, b):
    difference = np.asarray(a) - np.asarray(b)
    difference[1] = (difference[1] + np.pi) % (2 * np.pi) - np.pi
    return difference


def ukf_polar(problem):
    points = MerweScaledSigmaPoints(4, problem["alpha"], problem["beta"], problem["kappa"])
    f = UnscentedKalmanFilter(
        dim_x=4,
        dim_z=2,
        dt=1.0,
        fx=lambda x, dt: STRAIGHT @ x,
        hx=lambda x: np.array([np.hypot(x[0], x[2]), np.arctan2(x[2], x[0])]),
        points=points,
        residual_z=bearing_residual,
    )
    f.x, f.P = np.array(problem["x0"], float), np.array(problem["P0"], float)
    f.Q, f.R = np.array(problem["Q"]), np.array(problem["R"], float)
    for step in problem["steps"]:
        f.predict()
        f.update(np.array(step["z"]))
        yield {"x": f.x, "P": f.P}


def imm_2cv(problem):
    filters = [kalman(problem, white_acceleration(density)) for density in problem["q"]]
    imm = IMMEstimator(filters, np.array(problem["mu0"]), np.array(problem["M"]))
    for step in problem["steps"]:
        imm.predict()
        imm.update(np.array(step["z"]))
        yield {"mu": imm.mu, "x": imm.x, "P": imm.P}


def text(problem):
    head = "".join(f" {json.dumps(k)}: {json.dumps(v)},\n" for k, v in problem.items() if k != "steps")
    steps = ",\n".join("  " + json.dumps(step) for step in problem["steps"])
    return "{\n" + head + ' "steps": [\n' + steps + "\n ]\n}\n"


def main():
    for make in (kf_cv2d, ukf_polar, imm_2cv):
        path = HERE / f"{make.__name__}.json"
        problem = json.loads(path.read_text())
        largest = 0.0
        for step, computed in zip(problem["steps"], make(problem)):
            for key, value in computed.items():
                largest = max(largest, np.abs(np.asarray(value) - np.asarray(step[key])).max())
                step[key] = np.asarray(value).tolist()
        print(f"{make.__name__}: largest change {largest:.2g}")
        if "--check" not in sys.argv:
            path.write_text(text(problem))


if __name__ == "__main__":
    main()
