#!/usr/bin/env python3
"""Error, time and peak memory of signals as a sequence grows: in windows and whole. Python's standard library only.

    bench/long.py OUT [--frames 100,500,...] [--repeat R] [--whole-up-to N] [--limit SECONDS]

Every fit and every sampling is a process of its own; its time on all processors and its peak resident memory are what the operating system counted
(wait4: ru_utime + ru_stime, ru_maxrss), and wall time stands beside them. Of R runs the median times and the greatest memory are kept. What takes more
processor time than the limit is ended, and said to have been. Writes OUT/table.csv, OUT/command.txt and OUT/machine.txt.
"""
import argparse
import csv
import json
import os
import pathlib
import resource
import shutil
import statistics
import sys
import tempfile
import time

from machine import machine

HOME = pathlib.Path(__file__).resolve().parents[1]
PROGRAM = HOME / "target/release/meshseq"


def run(arguments, limit):
    """Processor seconds, wall seconds and peak megabytes; None where the limit was reached."""
    start = time.perf_counter()
    child = os.posix_spawn(
        PROGRAM,
        [str(PROGRAM), *map(str, arguments)],
        os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
    )
    resource.prlimit(child, resource.RLIMIT_CPU, (limit, limit))
    _, status, usage = os.wait4(child, 0)
    if os.WIFSIGNALED(status):
        return None
    if status != 0:
        sys.exit(f"failed: {arguments}")
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - start, usage.ru_maxrss / 1024


def repeated(arguments, repeat, limit):
    """The median times and the greatest memory of several runs."""
    runs = []
    for _ in range(repeat):
        found = run(arguments, limit)
        if found is None:
            return None
        runs.append(found)
    processor, wall = (round(statistics.median(r[i] for r in runs), 3) for i in range(2))
    return processor, wall, round(max(r[2] for r in runs), 1)


def row(name, n, way, choice, folder, options):
    """Fits and samples once: a line of the table."""
    rep, told, out = folder / "rep.npz", folder / "told.json", folder / "out.npz"
    sequence = f"{name}:{n}"
    fit = ["signal", "fit", sequence, "--tolerance", options.tolerance, *choice, "-o", rep, "--json", told]
    line = {"sequence": name, "n": n, "way": way, "repeats": options.repeat}
    found = repeated(fit, options.repeat, options.limit)
    if found is None:
        return line | {"note": f"ended after {options.limit} s of processor time"}
    numbers = json.loads(told.read_text())
    windows = numbers.get("windows", [numbers])
    line |= dict(zip(["fit_processor_seconds", "fit_wall_seconds", "fit_peak_mb"], found))
    sampled = repeated(["signal", "sample", rep, "--rate", 2, "-o", out], options.repeat, options.limit)
    line |= {
        "rms_relative_percent": round(100 * numbers["rms_relative"], 5),
        "windows": len(windows),
        **{key: "-".join(map(str, sorted({min(w[key] for w in windows), max(w[key] for w in windows)}))) for key in "klm"},
        "stored_numbers": numbers["stored_numbers"],
        "given_numbers": 3 * n * numbers["V"],
    }
    if sampled:
        line |= dict(zip(["sample_processor_seconds", "sample_wall_seconds", "sample_peak_mb"], sampled))
    return line


COLUMNS = [
    "sequence", "n", "way", "repeats", "fit_processor_seconds", "fit_wall_seconds", "fit_peak_mb", "sample_processor_seconds",
    "sample_wall_seconds", "sample_peak_mb", "rms_relative_percent", "windows", "k", "l", "m", "stored_numbers", "given_numbers", "note",
]  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--sequence", default="@roam-small")
    parser.add_argument("--frames", default="100,500,1000,2500,5000")
    parser.add_argument("--window", type=int, default=100)
    parser.add_argument("--tolerance", default="0.01")
    parser.add_argument("--whole-up-to", type=int, default=5000)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--limit", type=int, default=600, help="processor seconds for one process")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "machine.txt").write_text(machine())
    (options.out / "command.txt").write_text(" ".join(["bench/long.py", *sys.argv[1:]]) + "\n")
    folder = pathlib.Path(tempfile.mkdtemp())
    try:
        with open(options.out / "table.csv", "w", newline="") as file:
            table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            table.writeheader()
            for n in map(int, options.frames.split(",")):
                ways = [("windows", ["--window", options.window])]
                if n <= options.whole_up_to:
                    ways.append(("whole", []))
                for way, choice in ways:
                    line = row(options.sequence, n, way, choice, folder, options)
                    table.writerow(line)
                    file.flush()
                    print(line, flush=True)
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
