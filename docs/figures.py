#!/usr/bin/env python3
"""Writes the figures of studies into the pages of this book.

    docs/figures.py RESULTS

Each RESULTS/ANYTHING/study.json is what `tercel study NAME .. -o RESULTS/ANYTHING` wrote. The page of a study has a place for each
of its commands. Studies that are not there are left as they are.
"""

import json
import pathlib
import re
import sys

PAGES = pathlib.Path(__file__).parent / "src"


# The metrics of each page's table, by one that tells the kind of study: name, heading, digits, and whether the deviation
# over runs is shown.
FAMILIES = {
    "rmse_all": [
        ("rmse_all", "rmse_all", 1, True),
        ("rmse_pos", "rmse_pos, m", 1, True),
        ("rmse_vel", "rmse_vel, m/s", 1, True),
        ("accuracy", "accuracy, %", 1, False),
        ("nees", "nees", 2, False),
    ],
    "gwd": [
        ("rmse_pos", "rmse_pos, m", 3, False),
        ("rmse_vel", "rmse_vel, m/s", 3, False),
        ("iou", "iou", 3, False),
        ("gwd", "gwd, m²", 3, False),
        ("gwd_shape", "of which shape", 3, False),
        ("nees_pos", "nees_pos", 2, False),
        ("lost", "lost", 2, False),
    ],
    "gospa": [
        ("gospa", "gospa, m", 1, True),
        ("gospa_localisation", "localisation", 1, False),
        ("gospa_missed", "missed", 1, False),
        ("gospa_false", "false", 1, False),
        ("gospa_settled", "settled", 1, False),
        ("trajectory_gospa", "trajectory", 1, False),
        ("switches", "switches", 2, False),
        ("cardinality_error", "cardinality", 2, False),
        ("iou", "iou", 3, False),
    ],
}

# What a study does when it is told nothing; such options are not part of the command above its table.
DEFAULTS = {"set": ("test", "backward", "course"), "generator": ("reject",), "sizes": ("fixed",)}


def cell(figure, digits, deviation=False):
    if not figure or figure["mean"] is None:
        return "–"
    if abs(figure["mean"]) >= 100:
        digits = min(digits, 1)
    text = f"{figure['mean']:.{digits}f}"
    return f"{text} ± {figure['std']:.{digits}f}" if deviation else text


def single(study):
    known = {name for row in study["rows"] for name, figure in row["metrics"].items() if figure}
    family = next(family for metric, family in FAMILIES.items() if metric in known)
    columns = [column for column in family if column[0] in known]
    lines = ["| method | " + " | ".join(heading for _, heading, _, _ in columns) + " |"]
    lines.append("|---" * (len(columns) + 1) + "|")
    for row in study["rows"]:
        figures = [cell(row["metrics"].get(name), digits, shown) for name, _, digits, shown in columns]
        lines.append(f"| `{row['method']}` | " + " | ".join(figures) + " |")
    return lines


def command_of(study):
    command = f"tercel study {study['study']}"
    for option, chosen in sorted(study.get("options", {}).items()):
        if option in ("set", "generator", "sizes") and chosen and chosen not in DEFAULTS[option]:
            command += f" --{option} {chosen}"
    # Filters with particles are slow, and have a table of fewer runs of their own.
    methods = [row["method"] for row in study["rows"]]
    if all(method.startswith("smc-") for method in methods):
        command += f" --runs {study['runs']} --methods {','.join(methods)}"
    return command


# The metrics that are shown over what a sweep changes, by one that tells the kind of study: heading and digits.
SWEPT = {
    "rmse_all": [("rmse_all", "rmse_all", 1)],
    "gwd": [("rmse_pos", "rmse_pos, m", 3), ("iou", "iou", 3), ("gwd", "gwd, m²", 3)],
}


def swept(study, metric, heading, digits):
    values, rows = [], {}
    for row in study["rows"]:
        (value,) = row["at"].values()
        if value not in values:
            values.append(value)
        rows.setdefault(row["method"], {})[value] = cell(row["metrics"].get(metric), digits)
    lines = [f"| {heading} | " + " | ".join(f"{value:g}" for value in values) + " |", "|---" * (len(values) + 1) + "|"]
    for method, cells in rows.items():
        if any(cell != "–" for cell in cells.values()):
            lines.append(f"| `{method}` | " + " | ".join(cells.get(value, "–") for value in values) + " |")
    return lines


def sweep(study):
    known = {name for row in study["rows"] for name, figure in row["metrics"].items() if figure}
    metrics = next(metrics for metric, metrics in SWEPT.items() if metric in known)
    if len(metrics) == 1:
        return swept(study, metrics[0][0], "method", metrics[0][2])
    return "\n\n".join("\n".join(swept(study, *metric)) for metric in metrics).split("\n")


def main(results):
    for folder in sorted(pathlib.Path(results).iterdir()):
        file = folder / "study.json"
        if not file.exists():
            continue
        study = json.loads(file.read_text())
        page, command = PAGES / f"{study['study']}.md", command_of(study)
        lines = sweep(study) if any("at" in row for row in study["rows"]) else single(study)
        place = re.compile(rf"(<!-- figures of `{re.escape(command)}`: begin -->\n).*?(<!-- end -->)", re.DOTALL)
        text, count = place.subn(lambda found: found[1] + "\n".join(lines) + "\n" + found[2], page.read_text())
        if count == 0:
            sys.exit(f"{page} has no place for the figures of `{command}`")
        page.write_text(text)
        print(f"{page}: {command}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
