"""Prints how well pairs of photos that look straight down, and of photos that look aslant, are matched in a run.

Usage: pair_inliers.py RUN TRUTH   (folders; TRUTH is a capture of the same photos, as `tessera synth` writes it)

Of the pairs of each kind that were compared: their number, the share that one geometry explains, and the inliers of those
(first quartile, median, third quartile).
"""
import json
import sqlite3
import sys
from pathlib import Path

import numpy as np

STEEP = 0.94  # of the length of the viewing direction, that points down: 20° from the vertical
MAX_IMAGES = 2147483647  # COLMAP numbers a pair MAX_IMAGES * first + second


def main():
    run, truth = map(Path, sys.argv[1:3])
    frames = json.loads((truth / "transforms.json").read_text())["frames"]
    looks_down = {Path(frame["file_path"]).name: np.array(frame["transform_matrix"])[2, 2] > STEEP for frame in frames}
    database = sqlite3.connect(f"file:{run}/poses/database.db?mode=ro", uri=True)
    names = dict(database.execute("SELECT image_id, name FROM images"))
    kinds = {}
    for pair, inliers in database.execute("SELECT pair_id, rows FROM two_view_geometries"):
        down = sum(looks_down[names[image]] for image in divmod(pair, MAX_IMAGES))
        kinds.setdefault(("oblique and oblique", "nadir and oblique", "nadir and nadir")[down], []).append(inliers)
    for kind, counts in sorted(kinds.items()):
        linked = [count for count in counts if count > 0]
        print(f"{kind}: {len(counts)} pairs, {100 * len(linked) / len(counts):.1f} % linked, inliers",
              *(f"{value:.0f}" for value in np.percentile(linked, [25, 50, 75])))


main()
