"""Draws results/sweep.json: CPU seconds and triangles of lacuna against area / (r e).

    python plots.py RESULTS_FOLDER
"""
import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def main():
    """One picture with two panels; tolerances as dots, sizes as circles, and a line of slope 1."""
    folder = Path(sys.argv[1])
    rows = [r for r in json.loads((folder / "sweep.json").read_text()) if "cpu" in r]
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.6))
    for panel, key, title in zip(panels, ("cpu", "triangles"), ("CPU seconds", "triangles")):
        for number, name in enumerate(dict.fromkeys(r["shape"] for r in rows)):
            series = {"r/5 .. r/50": [r for r in rows if r["shape"] == name and r["size"] == 1],
                      "size 1 .. 10 at r/10": [r for r in rows if r["shape"] == name and r["divisor"] == 10]}
            for (words, some), style in zip(series.items(), ("o-", "s--")):
                x = [r["area"] / (r["radius"] * r["tolerance"]) for r in some]
                y = [max(r[key], 0.005) for r in some]
                panel.loglog(x, y, style, color=f"C{number}", mfc="white" if style == "s--" else None, ms=5, label=f"{name}, {words}")
        low, high = (f(r["area"] / (r["radius"] * r["tolerance"]) for r in rows) for f in (min, max))
        middle = np.exp(np.mean([np.log(r[key] / (r["area"] / (r["radius"] * r["tolerance"]))) for r in rows if r[key] > 0]))
        panel.loglog([low, high], [low * middle, high * middle], "k:", lw=1, label="proportional")
        panel.set_xlabel("area / (r e)")
        panel.set_ylabel(title)
        panel.grid(alpha=0.3, which="both")
    panels[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(folder / "sweep.png", dpi=110)


if __name__ == "__main__":
    main()
