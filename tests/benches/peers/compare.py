"""Runs lacuna and its peers on the same shapes, judges every result, and writes one row for each to results.json.

    python compare.py --work FOLDER --lacuna ADAPTER [--shapes a,b] [--divisors 10,40] [--programs p,q] [--limit 90]

ADAPTER is the built example `peer` of lacuna-kernel. A peer does not know the tolerance e: for each the coarsest setting of its
ladder is sought whose *measured* error is at most e. Only that run is charged, the search is not. lacuna is told e and runs once.
A run that needs more than --limit CPU seconds or 12 GB is ended.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
from pathlib import Path

from inputs import MAIN, SHAPES, shape
from judge import HERE, compiled, judge, read_mesh

MEMORY = 12 << 30
# Cells in parts of the tolerance; sides of a great circle for the hulls.
SPACINGS = (16, 11, 8, 5.6, 4, 2.8, 2, 1.4, 1, 0.7, 0.5, 0.35)
SIDES = (8, 12, 16, 20, 24, 32)
PROGRAMS = ("lacuna", "manifold", "openvdb", "meshlib", "libigl")


def command(program, made, folder, lacuna, tolerance, setting, out):
    """The words of one run."""
    drawing = folder / f"{made.name}.obj"
    if not drawing.exists():
        made.write(drawing)
    if program == "lacuna":
        # In millimetres a hundred times as large; the adapter scales back.
        return [lacuna, drawing, repr(made.radius), repr(tolerance), out, str(setting), "100"]
    parameter = repr(setting) if program == "manifold" else repr(setting * tolerance)
    if program == "openvdb":
        return [folder / "openvdb_offset", drawing, repr(made.radius), parameter, out]
    return [sys.executable, HERE / "programs.py", program, made.name, repr(made.radius), parameter, out]


def run(words, out, limit):
    """The measurements that a run prints, or why there are none."""
    out.unlink(missing_ok=True)

    def bound():
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 2))

    try:
        done = subprocess.run(list(map(str, words)), capture_output=True, text=True, preexec_fn=bound, timeout=6 * limit)
    except subprocess.TimeoutExpired:
        return {"failed": f"over {6 * limit:.0f} s"}
    if done.returncode in (-24, -9):
        return {"failed": f"over {limit:.0f} CPU s"}
    if done.returncode != 0 or not out.exists():
        said = [line for line in (done.stderr or done.stdout).strip().splitlines() if line.strip()]
        return {"failed": (said[-1] if said else f"ended with {done.returncode}")[:200]}
    measured = json.loads(done.stdout.strip().splitlines()[-1])
    if isinstance(measured["cpu"], list):
        measured["cpu"], measured["wall"] = statistics.median(measured["cpu"]), statistics.median(measured["wall"])
        measured["peak_mb"] = measured.pop("rss_mb")
    return measured


def attempt(program, made, divisor, setting, options, functions):
    """One run and its verdict."""
    tolerance = made.radius / divisor
    out = options.work / f"{program}.bin"
    words = command(program, made, options.work, options.lacuna, tolerance, setting, out)
    measured = run(words, out, options.limit)
    if "failed" in measured:
        return measured
    return measured | judge(functions, made, made.radius, tolerance, *read_mesh(out))


def compare(program, made, divisor, options, functions, first):
    """The row of one program, shape and tolerance."""
    row = {"program": program, "shape": made.name, "divisor": divisor}
    if program == "lacuna":
        best = attempt(program, made, divisor, 1, options, functions)
        if best.get("cpu", 99) < 2:  # the clock ticks in hundredths of a second
            best = attempt(program, made, divisor, 5, options, functions)
        return row | best
    tried, best = [], {"failed": "nothing to try"}
    for setting in SIDES if program == "manifold" else SPACINGS:
        if program != "manifold" and setting > first.get((program, made.name), SPACINGS[0]):
            continue
        found = attempt(program, made, divisor, setting, options, functions)
        tried.append([setting, found.get("failed") or round(found["error_over_tolerance"], 3), round(found.get("cpu", 0), 3)])
        if "failed" in found:
            best = best if "cpu" in best else found
            break
        best = found | {"setting": setting}
        if found["error_over_tolerance"] <= 1:
            first[program, made.name] = setting
            break
        growth = 1.6 if program == "manifold" else 2.8
        if found["cpu"] * growth > options.limit:
            tried.append(["next", f"would need over {options.limit:.0f} CPU s", 0])
            break
    return row | best | {"tried": tried}


def main():
    """Rows are replaced one by one, so that a run can be stopped and gone on with."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--work", type=Path, required=True)
    words.add_argument("--lacuna", type=Path, required=True)
    words.add_argument("--results", type=Path, default=HERE / "results" / "results.json")
    words.add_argument("--shapes", default=",".join(MAIN), help="`all` for every shape")
    words.add_argument("--divisors", default="10,40")
    words.add_argument("--programs", default=",".join(PROGRAMS))
    words.add_argument("--limit", type=float, default=90)
    options = words.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    options.results.parent.mkdir(parents=True, exist_ok=True)
    rows = json.loads(options.results.read_text()) if options.results.exists() else []
    functions, first = compiled(options.work), {}
    names = SHAPES if options.shapes == "all" else options.shapes.split(",")
    for divisor in map(int, options.divisors.split(",")):
        for name in names:
            made = shape(name)
            for program in options.programs.split(","):
                row = compare(program, made, divisor, options, functions, first) | {"load": round(os.getloadavg()[0], 1)}
                rows = [r for r in rows if (r["program"], r["shape"], r["divisor"]) != (program, name, divisor)] + [row]
                options.results.write_text("[\n" + ",\n".join(map(json.dumps, rows)) + "\n]\n")
                print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
