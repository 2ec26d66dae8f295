#!/usr/bin/env python3
"""Drapes a collection of garments and tells how each came out: a table and one picture.

    python3 tools/drape_collection.py --body BODY.obj --resolution 30 --out OUT GARMENTS...

GARMENTS are files, or folders of them. Every garment is draped by a process of its own, `dress drape
--threads 1`, one after the other, into a folder below OUT/RESOLUTION; calls for other garments or
another body may go into the same OUT. Then table.md and sheet.png, of all that lies there, are written
into OUT/RESOLUTION. What was draped already stays unless --again is given; --only WORD takes the garments
with that word in their names.

CPU-seconds are user and system of the whole process, reading and pictures included. Needs Python on a
Unix, and the program: `cargo build --release -p dress-cli`.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEAD = [
    "garment", "vertices", "CPU-s", "residual", "cloth–body", "cloth–cloth", "deepest, mm", "status",
]  # fmt: skip


def main():
    asked = arguments()
    out = asked.out / f"{asked.resolution:g}"
    for garment in garments(asked.garments, asked.only):
        folder = out / name_of(garment)
        if asked.again or not (folder / "run.json").exists():
            drape(asked, garment, folder)
            print(row(folder), flush=True)
    folders = sorted(path.parent for path in out.glob("*/run.json"))
    lines = [line(HEAD), line(["---"] * len(HEAD))] + [row(folder) for folder in folders]
    (out / "table.md").write_text("\n".join(lines) + "\n")
    drawn = [str(folder) for folder in folders if (folder / "garment.obj").exists()]
    if drawn:
        subprocess.run([asked.dress, "sheet", "--out", str(out), *drawn], check=True)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("garments", nargs="+", type=pathlib.Path, metavar="GARMENTS")
    parser.add_argument("--body", required=True)
    parser.add_argument("--out", required=True, type=pathlib.Path)
    parser.add_argument("--resolution", type=float, default=30, help="length of mesh edges [mm]")
    parser.add_argument("--dress", default=str(ROOT / "target/release/dress"), help="the program")
    parser.add_argument("--only", default="", metavar="WORD")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--limit", type=float, default=3600, help="most seconds for a garment")
    line = sys.argv[1:]
    cut = line.index("--") if "--" in line else len(line)
    asked = parser.parse_args(line[:cut])
    asked.more = line[cut + 1 :]
    return asked


def garments(paths, word):
    """All garment files, in order."""
    files = []
    for path in paths:
        files += sorted(path.iterdir()) if path.is_dir() else [path]
    return [f for f in files if f.suffix in (".json", ".obj") and word in f.name]


def name_of(garment):
    return garment.stem.removesuffix("_specification")


def drape(asked, garment, folder):
    """Runs the program; what it said and took goes into run.json."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    files = ["--garment", str(garment), "--body", asked.body, "--out", str(folder)]
    options = ["--threads", "1", "--resolution", f"{asked.resolution:g}", *asked.more]
    command = [asked.dress, "drape", *files, *options]
    before = os.times()
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=asked.limit)
        said = [text for text in ran.stderr.splitlines() if text.startswith("error: ")]
    except subprocess.TimeoutExpired:
        said = [f"error: not done after {asked.limit:g} s"]
    after = os.times()
    cpu = (after.children_user + after.children_system) - (
        before.children_user + before.children_system
    )
    run = {"cpu_seconds": cpu, "said": said}
    (folder / "run.json").write_text(json.dumps(run, indent=1) + "\n")


def row(folder):
    """The line of a garment in the table."""
    run = json.loads((folder / "run.json").read_text())
    name = folder.name.replace("_", " ")
    report = folder / "report.json"
    if not report.exists():
        why = " ".join(run["said"]).removeprefix("error: ")
        return line([name, "", f"{run['cpu_seconds']:.0f}", "", "", "", "", f"no drape: {why}"])
    found = json.loads(report.read_text())
    status = found["status"].replace("-", " ")
    # A number, or that of the fabrics.
    if found["friction"] != found["parameters"]["sim"]["contact"]["friction"]:
        status += f", with friction: {found['friction']}"
    return line([
        name,
        str(found["size"][0]),
        f"{run['cpu_seconds']:.0f}",
        f"{found['residual']:.0e}",
        str(found["through_body"]),
        str(found["through_itself"]),
        f"{1e3 * found['deepest_penetration']:.1f}",
        status,
    ])  # fmt: skip


def line(cells):
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
