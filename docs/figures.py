#!/usr/bin/env python3
"""Writes the figures of studies into the pages of this book.

    docs/figures.py RESULTS

RESULTS/atc-test/study.json is what `tercel study atc-test -o RESULTS/atc-test` wrote; the sweeps over the fast flights
(`--set hshm`) are in RESULTS/atc-noise-hshm and RESULTS/atc-missing-hshm. Studies that are not there are left as they are.
"""

import json
import pathlib
import re
import sys

PAGES = pathlib.Path(__file__).parent / "src"


def cell(figure, digits, deviation=False):
    if not figure or figure["mean"] is None:
        return "–"
    text = f"{figure['mean']:.{digits}f}"
    return f"{text} ± {figure['std']:.{digits}f}" if deviation else text


def single(study):
    lines = ["| method | rmse_all | rmse_pos, m | rmse_vel, m/s | accuracy, % | nees |", "|---|---|---|---|---|---|"]
    for row in study["rows"]:
        metrics = row["metrics"]
        errors = " | ".join(cell(metrics.get(name), 1, True) for name in ("rmse_all", "rmse_pos", "rmse_vel"))
        nees = metrics.get("nees")
        digits = 0 if nees and nees["mean"] is not None and nees["mean"] >= 100 else 2
        lines.append(f"| `{row['method']}` | {errors} | {cell(metrics.get('accuracy'), 1)} | {cell(nees, digits)} |")
    return lines


def sweep(study):
    values, rows = [], {}
    for row in study["rows"]:
        (value,) = row["at"].values()
        if value not in values:
            values.append(value)
        rows.setdefault(row["method"], {})[value] = cell(row["metrics"].get("rmse_all"), 1)
    lines = ["| method | " + " | ".join(f"{value:g}" for value in values) + " |", "|---" * (len(values) + 1) + "|"]
    for method, cells in rows.items():
        if any(cell != "–" for cell in cells.values()):
            lines.append(f"| `{method}` | " + " | ".join(cells.get(value, "–") for value in values) + " |")
    return lines


def main(results):
    for folder in sorted(pathlib.Path(results).iterdir()):
        file = folder / "study.json"
        if not file.exists():
            continue
        study = json.loads(file.read_text())
        name, chosen = study["study"], study.get("options", {}).get("set")
        page = PAGES / f"{name}.md"
        command = f"tercel study {name}" + (f" --set {chosen}" if chosen and chosen != "test" else "")
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
