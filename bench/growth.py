#!/usr/bin/env python3
"""What Criterion's benchmarks measured, as a record: times, and how they grow. Python's standard library only.

    bench/growth.py OUT [--bench shape,signal] [--filter REGEX] [--read-only]

Runs `cargo bench` for these benchmarks (the filter is Criterion's) and reads what it left in target/criterion. Writes OUT/table.csv: a line for each benchmark and
size with the median of a call and its median absolute deviation, and the exponent of growth since the size before it (1: linear in it). Beside it
OUT/command.txt and OUT/machine.txt.
"""
import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys

from machine import machine

HOME = pathlib.Path(__file__).resolve().parents[1]
MEASURED = HOME / "target/criterion"


def found(since):
    """(group, what, size, median, deviation) of every benchmark measured since."""
    for path in MEASURED.glob("**/new/benchmark.json"):
        estimates = path.with_name("estimates.json")
        if estimates.stat().st_mtime < since:
            continue
        about, told = json.loads(path.read_text()), json.loads(estimates.read_text())
        median, deviation = (told[name]["point_estimate"] * 1e-9 for name in ("median", "median_abs_dev"))
        yield about["group_id"], about["function_id"] or "", int(about["value_str"]), median, deviation


def lines(rows):
    before = None
    for group, what, size, median, deviation in sorted(rows):
        grows = before and before[:2] == (group, what)
        exponent = math.log(median / before[3]) / math.log(size / before[2]) if grows else None
        before = group, what, size, median
        yield group, what, size, f"{median:.4e}", f"{deviation:.1e}", "" if exponent is None else f"{exponent:.2f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--bench", default="shape,signal")
    parser.add_argument("--filter", default="")
    parser.add_argument("--read-only", action="store_true", help="run nothing: write what was measured last")
    options = parser.parse_args()
    about, since = machine(), 0.0
    if not options.read_only:
        start = pathlib.Path(HOME / "target/criterion")
        start.mkdir(parents=True, exist_ok=True)
        stamp = start / "growth.stamp"
        stamp.write_text("")
        since = stamp.stat().st_mtime
        for bench in options.bench.split(","):
            chosen = [options.filter] if options.filter else []
            command = ["cargo", "bench", "--locked", "--bench", bench, "--", "--warm-up-time", "1", *chosen]
            if subprocess.run(command, cwd=HOME).returncode != 0:
                sys.exit(f"failed: {' '.join(command)}")
    options.out.mkdir(parents=True, exist_ok=True)
    with open(options.out / "table.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow("group,benchmark,size,median_seconds,mad_seconds,exponent".split(","))
        table.writerows(lines(found(since)))
    (options.out / "command.txt").write_text(" ".join(["bench/growth.py", *sys.argv[1:]]) + "\n")
    (options.out / "machine.txt").write_text(about)


if __name__ == "__main__":
    main()
