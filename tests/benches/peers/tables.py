"""Writes the tables of results.json and truth.json as Markdown.

    python tables.py RESULTS_FOLDER [PAGE.md]     between the marks of the page as well
"""
import json
import sys
from pathlib import Path

from inputs import SHAPES

MARKS = ("<!-- tables -->", "<!-- end of tables -->")


def number(value, digits=3):
    """With so many significant digits, thousands set apart."""
    if value is None:
        return "-"
    if value >= 1000:
        return f"{value:,.0f}"
    return f"{value:.{digits}g}"


def topology(row, truth):
    """Pieces, genus and cavities, and whether they are the truth."""
    if "euler" not in row:
        return "not closed" if row.get("manifold") is False else "not counted"
    pieces = row["shells"] - row["cavities"]
    counts = f"{pieces} / {row['genus']} / {row['cavities']}"
    if not row["manifold"]:
        return f"not a manifold, {counts}"
    if truth is None:
        return counts
    if [pieces, row["genus"], row["cavities"]] in (truth["betti"]["r"], truth["betti"]["r, upper"]):
        return f"{counts}, right"
    band = truth["betti"].values() if row["divisor"] == 10 else [truth["betti"][k] for k in ("r + r/40", "r, upper", "r", "r - r/40")]
    low, high = [min(b[k] for b in band) for k in range(3)], [max(b[k] for b in band) for k in range(3)]
    within = all(low[k] <= (pieces, row["genus"], row["cavities"])[k] <= high[k] for k in range(3))
    return f"{counts}, {'within the band' if within and low != high else '**wrong**'}"


def passes(row):
    """Whether the error is met."""
    return row.get("error_over_tolerance", 9) <= 1


def comparison(rows, truth, divisor):
    """One table for a tolerance."""
    lines = [
        "| shape | program | setting | CPU s | wall s | peak MB | triangles | error / e | pieces / genus / cavities | crossings |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name in SHAPES:
        for row in (r for r in rows if r["shape"] == name and r["divisor"] == divisor):
            if "cpu" not in row:
                lines.append(f"| {name} | {row['program']} | | | | | | no result: {row['failed']} | | |")
                continue
            error = number(row["error_over_tolerance"], 4) + ("" if passes(row) else ", **fails**") + (" (sampled)" if "sampled_triangles" in row else "")
            if "claimed_inner" in row and any(row.get(k, 0) > row["claimed_" + k] * (1 + 1e-9) for k in ("inner", "outer")):
                error += ", **beyond its claim**"
            if row.get("solid") is False:
                error += ", **not the solid**"
            lines.append(
                f"| {name} | {row['program']} | {row.get('setting', '')} | {number(row['cpu'])} | {number(row['wall'])} | {number(row['peak_mb'])} | "
                f"{number(row['triangles'])} | {error} | {topology(row, truth.get(name))} | {number(row.get('crossings'))} |"
            )
    return "\n".join(lines)


def right(row, truth):
    """Whether a row has the error, the solid and the topology, as far as those were measured."""
    words = topology(row, truth.get(row["shape"]))
    return passes(row) and row.get("solid", True) and not any(w in words for w in ("wrong", "not a manifold", "not closed"))


def ratios(rows, truth, divisor):
    """lacuna beside the best peers: of those with the error, and of those with error and topology."""
    lines = [
        "| shape | lacuna CPU s | cheapest peer within e | cheapest with the topology too | times lacuna | triangles: lacuna, best grid, hulls | peak MB: lacuna, that peer |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name in SHAPES:
        own = next((r for r in rows if (r["program"], r["shape"], r["divisor"]) == ("lacuna", name, divisor)), None)
        run = [r for r in rows if r["shape"] == name and r["divisor"] == divisor and r["program"] != "lacuna"]
        if own is None or not run:
            continue
        within = [r for r in run if passes(r)]
        any_peer, peer = (min(some, key=lambda r: r["cpu"], default=None) for some in (within, [r for r in within if right(r, truth)]))
        cpu = "no result" if "cpu" not in own else number(own["cpu"]) + ("" if right(own, truth) else " (not right)")
        named = [f"{p['program']}, {number(p['cpu'])} s" if p else f"none of {len(run)}" for p in (any_peer, peer)]
        triangles = [own.get("triangles"), min((r["triangles"] for r in within if r["program"] != "manifold"), default=None),
                     min((r["triangles"] for r in within if r["program"] == "manifold"), default=None)]
        lines.append(
            f"| {name} | {cpu} | {named[0]} | {named[1]} | {number(peer['cpu'] / own['cpu']) if peer and 'cpu' in own else '-'} | "
            f"{' / '.join(map(number, triangles))} | {number(own.get('peak_mb'))} / {number(peer['peak_mb']) if peer else '-'} |"
        )
    return "\n".join(lines)


def truths(truth):
    """The table of the alpha complexes."""
    labels = ["r - r/10", "r - r/40", "r", "r, upper", "r + r/40", "r + r/10"]
    lines = ["| shape | samples | c / r | " + " | ".join(labels) + " | at r |", "| --- " * (len(labels) + 4) + "|"]
    for name in (n for n in SHAPES if n in truth):
        found = truth[name]
        cells = [" / ".join(map(str, found["betti"][label])) for label in labels]
        verdict = "stable to r/10" if found["stable_r/10"] else "stable to r/40" if found["stable_r/40"] else "settled" if found["settled"] else "not settled"
        lines.append(f"| {name} | {found['samples']:,} | {found['cover_over_radius']} | " + " | ".join(cells) + f" | {verdict} |")
    return "\n".join(lines)


def main():
    """To tables.md, and between the marks of the page if one is given."""
    folder = Path(sys.argv[1])
    rows = json.loads((folder / "results.json").read_text())
    truth = json.loads((folder / "truth.json").read_text()) if (folder / "truth.json").exists() else {}
    parts = []
    for divisor in sorted({r["divisor"] for r in rows}):
        parts += [f"### e = r/{divisor}: lacuna and the best peers", ratios(rows, truth, divisor), f"### e = r/{divisor}: every run", comparison(rows, truth, divisor)]
    parts += ["### The true topology: pieces / handles / cavities of the alpha complex", truths(truth)]
    text = "\n\n".join(parts) + "\n"
    (folder / "tables.md").write_text(text)
    for page in map(Path, sys.argv[2:]):
        before, _, rest = page.read_text().partition(MARKS[0])
        page.write_text(f"{before}{MARKS[0]}\n{text}{MARKS[1]}{rest.partition(MARKS[1])[2]}")


if __name__ == "__main__":
    main()
