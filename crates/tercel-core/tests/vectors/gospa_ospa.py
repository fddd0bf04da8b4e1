"""Makes gospa_ospa.json: GOSPA (alpha = 2) and OSPA of random sets in the plane, computed with Stone Soup 1.9.1.

    python -m venv peer && peer/bin/pip install stonesoup==1.9.1 && peer/bin/python gospa_ospa.py

With no arguments the sets already in the file are scored again and the file is rewritten; with `--draw` new sets are drawn.
Two empty sets have no time in Stone Soup, which raises: they are left without scores, and are 0 by definition.
"""

import datetime
import json
import pathlib
import sys

import numpy as np
from stonesoup.measures import Euclidean
from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
from stonesoup.types.state import State

FILE = pathlib.Path(__file__).with_suffix(".json")
TIME = datetime.datetime(2026, 1, 1)
SIZES = [(0, 0), (0, 3), (4, 0), (3, 3), (5, 4), (2, 6), (8, 8)]


def draw(seed):
    random = np.random.default_rng(seed)
    for truth, estimates in SIZES:
        for cutoff, order in [(10.0, 1), (10.0, 2), (50.0, 2)]:
            yield {
                "truth": random.uniform(0, 60, (truth, 2)).tolist(),
                "estimates": random.uniform(0, 60, (estimates, 2)).tolist(),
                "cutoff": cutoff,
                "order": order,
            }


def states(points):
    return [State([[x], [y]], timestamp=TIME) for x, y in points]


def score(case):
    truth, estimates = states(case["truth"]), states(case["estimates"])
    scored = {key: case[key] for key in ("truth", "estimates", "cutoff", "order")}
    if not truth and not estimates:
        return scored
    settings = {"c": case["cutoff"], "p": case["order"], "measure": Euclidean((0, 1))}
    gospa, _ = GOSPAMetric(**settings).compute_gospa_metric(estimates, truth)
    ospa = OSPAMetric(**settings).compute_OSPA_distance(estimates, truth)
    scored["gospa"] = {key: abs(float(gospa.value[key])) for key in ("distance", "localisation", "missed", "false")}
    scored["ospa"] = float(ospa.value)
    return scored


if __name__ == "__main__":
    cases = draw(12345) if "--draw" in sys.argv else json.loads(FILE.read_text())["cases"]
    lines = ",\n".join(json.dumps(score(case)) for case in cases)
    FILE.write_text('{"generator": "Stone Soup 1.9.1",\n"cases": [\n' + lines + "\n]}\n")
