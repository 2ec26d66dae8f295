#!/usr/bin/env python3
"""Carries a collection of drapes to other bodies and tells how each came out: a table and a picture a body.

    python3 tools/carry_collection.py --source-body BODY.obj --out OUT DRAPES --to BODY.obj...

DRAPES is a folder that drape_collection.py wrote. Every drape is carried by a process of its own, `dress
transfer --threads 1`, into OUT/TARGET/GARMENT; what is there already stays unless --again is given. Then
OUT/table.md, a line a garment and a line a body with the largest numbers of each, and sheet.png in every
OUT/TARGET. --only WORD takes the garments with that word in their names. What follows `--` goes to the
program.

Bodies of one mesh in one pose save the fit to each: `dress transfer` writes the target so, as body.obj.
Needs Python on a Unix, and the program: `cargo build --release -p dress-cli`.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEAD = [
    "", "cloth–body", "cloth–cloth more", "turned over", "not converged", "rounds", "stretch",
    "mirror, mm", "closer by, mm", "farther by, mm",
]  # fmt: skip


def main():
    asked = arguments()
    drapes = sorted(path.parent for path in asked.drapes.glob("*/garment.obj"))
    found = []
    for body in asked.to:
        folders = []
        for drape in drapes:
            if asked.only not in drape.name:
                continue
            folder = asked.out / body.stem / drape.name
            if asked.again or not (folder / "run.json").exists():
                carry(asked, drape / "garment.obj", body, folder)
            folders.append(folder)
            found.append((body.stem, drape.name, measures(folder)))
        drawn = [str(folder) for folder in folders if (folder / "report.json").exists()]
        if drawn:
            sheet = [asked.dress, "sheet", "--out", str(asked.out / body.stem), *drawn]
            subprocess.run(sheet, check=True)
    lines = [line(HEAD), line(["---"] * len(HEAD))]
    for kind in (1, 0):
        for name in sorted({entry[kind] for entry in found}):
            lines.append(largest(name, [entry[2] for entry in found if entry[kind] == name]))
    (asked.out / "table.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drapes", type=pathlib.Path, metavar="DRAPES")
    parser.add_argument("--source-body", required=True)
    parser.add_argument("--to", required=True, nargs="+", type=pathlib.Path, metavar="BODY.obj")
    parser.add_argument("--out", required=True, type=pathlib.Path)
    parser.add_argument("--dress", default=str(ROOT / "target/release/dress"), help="the program")
    parser.add_argument("--only", default="", metavar="WORD")
    parser.add_argument("--again", action="store_true")
    line = sys.argv[1:]
    cut = line.index("--") if "--" in line else len(line)
    asked = parser.parse_args(line[:cut])
    asked.more = line[cut + 1 :]
    return asked


def carry(asked, garment, body, folder):
    """Runs the program; what it said and took goes into run.json."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    files = ["--garment", str(garment), "--source-body", asked.source_body, "--target-body", str(body)]
    command = [asked.dress, "transfer", *files, "--out", str(folder), "--threads", "1", *asked.more]
    before = os.times()
    ran = subprocess.run(command, capture_output=True, text=True)
    after = os.times()
    said = [text for text in ran.stderr.splitlines() if text.startswith("error: ")]
    spent = [getattr(after, k) - getattr(before, k) for k in ("children_user", "children_system")]
    (folder / "run.json").write_text(json.dumps({"cpu_seconds": sum(spent), "said": said}) + "\n")


def measures(folder):
    """What is told of one garment on one body; nothing where it failed."""
    report = folder / "report.json"
    if not report.exists():
        return None
    found = json.loads(report.read_text())
    before, after = found["through_itself"]
    low, high = found["stretch"]
    spacing = [1e3 * (zone["after"]["median"] - zone["before"]["median"]) for zone in found["spacing"]]
    return {
        "body": found["through_body"],
        "cloth": max(after - before, 0),
        "turned": found["turned_over"],
        "stuck": not found["converged"],
        "rounds": found["iterations"],
        "least": low["least"],
        "most": high["most"],
        "mirror": 1e3 * (found["asymmetry"][1] - found["asymmetry"][0]),
        "spacing": spacing,
    }


def largest(name, of):
    """A line with the largest numbers of these measures."""
    done = [m for m in of if m]
    if len(done) < len(of):
        name += f" ({len(of) - len(done)} of {len(of)} failed)"
    if not done:
        return line([name] + [""] * (len(HEAD) - 1))
    most = {key: max(m[key] for m in done) for key in ("body", "cloth", "turned", "rounds", "mirror")}
    return line([
        name.replace("_", " "),
        str(most["body"]),
        str(most["cloth"]),
        str(most["turned"]),
        str(sum(m["stuck"] for m in done)),
        str(most["rounds"]),
        f"{min(m['least'] for m in done):.2f}–{max(m['most'] for m in done):.2f}",
        f"{most['mirror']:.1f}",
        f"{max(-min(m['spacing']) for m in done):.0f}",
        f"{max(max(m['spacing']) for m in done):.0f}",
    ])  # fmt: skip


def line(cells):
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
