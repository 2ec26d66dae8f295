#!/usr/bin/env python3
"""Draws the loss against the seconds of several refits of the same garments.

usage: plot_optimisers.py OUT.png TITLE=LABEL:FOLDER[,LABEL:FOLDER…] …

Every FOLDER is one that `dress refit` wrote. One panel for each TITLE; in it a curve for each LABEL, over the time since
the search began. Dotted: guided cloth, whose losses are of other drapes. Needs matplotlib.
"""

import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def main():
    out, *titles = sys.argv[1:]
    if not titles:
        sys.exit(__doc__)
    figure, panels = plt.subplots(1, len(titles), figsize=(5.2 * len(titles), 4.6), squeeze=False)
    for panel, title in zip(panels[0], titles):
        name, runs = title.split("=", 1)
        for number, run in enumerate(runs.split(",")):
            label, folder = run.split(":", 1)
            draw(panel, label, Path(folder), f"C{number}")
        panel.set(title=name, xscale="log", yscale="log", xlabel="seconds of the search", ylabel="loss")
        panel.grid(alpha=0.3, which="both")
        panel.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out, dpi=110)


def draw(panel, label, folder, colour):
    report = json.loads((folder / "report.json").read_text())
    stages = report["stages"]
    searches = [stage["stage"] == "first guess" or "search" in stage["stage"] for stage in stages]
    before = sum(stage["seconds"] for stage in stages[: searches.index(True)])
    points = [(i["elapsed"] - before, i["loss"], i["guide"]) for i in report["iterations"]]
    # One piece for each level; only the last of the free ones is the search's.
    pieces = [[points[0]]]
    for point in points[1:]:
        if point[2] != pieces[-1][-1][2]:
            pieces.append([])
        pieces[-1].append(point)
    for piece in pieces:
        style = ":" if piece[0][2] else "-"
        panel.plot(*zip(*[p[:2] for p in piece]), style, color=colour, marker=".", markersize=4)
    panel.plot([], [], "-", color=colour, label=f"{label}: {points[-1][1]:.2f}")


if __name__ == "__main__":
    main()
