"""What a record of measurements says of the machine and the revision."""
import os
import pathlib
import platform
import subprocess
import time

HOME = pathlib.Path(__file__).resolve().parents[1]


def machine():
    info = pathlib.Path("/proc/cpuinfo").read_text() if pathlib.Path("/proc/cpuinfo").exists() else ""
    names = [line.split(":", 1)[1].strip() for line in info.splitlines() if line.startswith("model name")]
    git = ["git", "-C", str(HOME)]
    revision = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True).stdout.strip()
    dirty = subprocess.run([*git, "status", "--porcelain", "-uno"], capture_output=True, text=True).stdout.strip()
    return "\n".join([
        f"processor: {names[0] if names else platform.processor()}",
        f"threads: {os.cpu_count()}",
        f"memory: {os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') // 1024} kB",
        f"system: {platform.release()}",
        f"load: {' '.join(f'{x:.2f}' for x in os.getloadavg())}",
        f"revision: {revision}{' and changes' if dirty else ''}",
        f"time: {time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime())}",
    ]) + "\n"  # fmt: skip
