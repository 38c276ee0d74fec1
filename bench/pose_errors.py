"""Compares the poses of a capture that `tessera run` has made with the true ones of a synthetic survey.

Usage: pose_errors.py RUN TRUTH [OUT.json]   (folders; TRUTH is a capture of the same photos, as `tessera synth` writes it)

Prints the errors of the shape (after the best similarity; photos without poses count as infinite in the median), and those of
the georeference in metres on the Earth, each beside its predicted standard error.
"""
import json
import math
import sys
from pathlib import Path

import numpy as np


def poses(capture):
    frames = json.loads((capture / "transforms.json").read_text())["frames"]
    return {Path(frame["file_path"]).stem: np.array(frame["transform_matrix"]) for frame in frames}


def geo_frame(capture):
    return json.loads((capture / "transforms.json").read_text())["tessera"].get("geo")


def similarity(source, target):
    """Returns scale, rotation and translation of the best similarity (Umeyama, 1991)."""
    a, b = source - source.mean(0), target - target.mean(0)
    u, sigma, v = np.linalg.svd(b.T @ a / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    rotation = u @ sign @ v
    scale = np.trace(np.diag(sigma) @ sign) / (a**2).sum(1).mean()
    return scale, rotation, target.mean(0) - scale * rotation @ source.mean(0)


def degrees(rotation):
    return math.degrees(math.acos(np.clip((np.trace(rotation) - 1) / 2, -1, 1)))


def earth_centred(latitude, longitude, altitude):
    """Returns the position of WGS 84 coordinates, and the axes east, north and up there as columns."""
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)
    p, l = math.radians(latitude), math.radians(longitude)
    n = a / math.sqrt(1 - e2 * math.sin(p) ** 2)
    up = np.array([math.cos(p) * math.cos(l), math.cos(p) * math.sin(l), math.sin(p)])
    east = np.array([-math.sin(l), math.cos(l), 0])
    position = np.array([(n + altitude) * up[0], (n + altitude) * up[1], (n * (1 - e2) + altitude) * up[2]])
    return position, np.column_stack([east, np.cross(up, east), up])


def truth_from_run(run, truth):
    """Returns the matrix from the run's world to the truth's by way of both georeferences."""
    def earth_from_world(geo):
        position, axes = earth_centred(geo["latitude"], geo["longitude"], geo["altitude"])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = axes, position
        return matrix @ np.array(geo["enu_from_world"])
    return np.linalg.inv(earth_from_world(truth)) @ earth_from_world(run)


run, truth = Path(sys.argv[1]), Path(sys.argv[2])
estimated, true = poses(run / "capture"), poses(truth)
names = sorted(estimated.keys() & true.keys())
x = np.array([estimated[name][:3, 3] for name in names])
y = np.array([true[name][:3, 3] for name in names])
scale, rotation, shift = similarity(x, y)
errors = np.linalg.norm(scale * x @ rotation.T + shift - y, axis=1)
angles = np.array([degrees((rotation @ estimated[name][:3, :3]).T @ true[name][:3, :3]) for name in names])
missing = np.full(len(true) - len(names), np.inf)
result = {
    "registered": len(names),
    "photos": len(true),
    "shape": {
        "median_metres": float(np.median(np.concatenate([errors, missing]))),
        "worst_metres": float(errors.max()),
        "median_degrees": float(np.median(np.concatenate([angles, missing]))),
        "worst_degrees": float(angles.max()),
    },
}
run_geo, true_geo = geo_frame(run / "capture"), geo_frame(truth)
if run_geo and true_geo:
    # The similarity that is left between the georeferenced poses and the truth: the identity, if GPS had no errors.
    placed = (truth_from_run(run_geo, true_geo) @ np.column_stack([x, np.ones(len(x))]).T).T[:, :3]
    left_scale, left_rotation, _ = similarity(placed, y)
    predicted = json.loads((run / "poses/georeference.json").read_text())["standard_errors"]
    result["georeference"] = {
        "scale": float(1 / left_scale - 1),
        "rotation_degrees": degrees(left_rotation),
        "middle_metres": float(np.linalg.norm(placed.mean(0) - y.mean(0))),
        "predicted": predicted,
    }
text = json.dumps(result, indent=1)
print(text)
if len(sys.argv) > 3:
    Path(sys.argv[3]).write_text(text + "\n")
