"""Compares the results of same_bytes.sh for two commits, in two folders: one line per comparison, status 1 if any differs.

Checkpoints are compared byte for byte, config.toml without its comments. Tiles are compared by the contents of buffer views and
by JSON without the names and lengths of files: names contain a digest of the bytes. Keys that were renamed
(settings: src/base/former_settings.cpp; JSON: renamedKeys) count as the same.
"""
import json
import re
import struct
import sys
from pathlib import Path

before, after = Path(sys.argv[1]), Path(sys.argv[2])
failures = 0
renamedKeys = {"surround": "background_block", "whole": "learned_background"}
renamed = dict(re.findall(r'{"(\w+)", "(\w+)"}', Path("src/base/former_settings.cpp").read_text()))


def verdict(name, same, what):
    global failures
    failures += 0 if same else 1
    print(f"{name}: {what} {'identical' if same else 'DIFFERENT'}")


def settings(path):
    """Returns the lines `key = value` with the current names of settings."""
    lines = [re.sub(r"\s+# .*", "", line) for line in path.read_text().splitlines() if not line.startswith("#")]
    return [re.sub(r"^\w+", lambda key: renamed.get(key[0], key[0]), line) for line in lines]


def same_file(a, b):
    if a.name == "config.toml":
        return settings(a) == settings(b)
    if a.suffix == ".glb":
        return glb(a) == glb(b)
    if a.suffix == ".json":
        return neutral(json.loads(a.read_text())) == neutral(json.loads(b.read_text()))
    return a.read_bytes() == b.read_bytes()


def current_name(path):
    """Returns a file's name without the digest of its bytes."""
    return re.sub(r"-[0-9a-f]{16}(?=\.\w+$)", "", str(path)).replace("surround", "background_block")


def compare(name, pattern, what):
    files = [{current_name(p.relative_to(side / name)): p for p in (side / name).glob(pattern)} for side in (before, after)]
    if not files[0] and not files[1]:
        return
    missing = files[0].keys() ^ files[1].keys()
    different = [p for p in files[0].keys() & files[1].keys() if not same_file(files[0][p], files[1][p])]
    for path in sorted(missing):
        print(f"  {name}/{path}: only {'before' if path in files[0] else 'after'}")
    for path in sorted(different):
        print(f"  {name}/{path}: differs")
    verdict(name, not missing and not different, f"{len(files[0])} {what}")


def neutral(value):
    """Returns the JSON without the names and the lengths of files."""
    if isinstance(value, dict):
        names = ("uri", "byteLength", "byteOffset", "bytes")
        return {renamedKeys.get(k, k): neutral(v) for k, v in value.items() if k not in names}
    if isinstance(value, list):
        return [neutral(v) for v in value]
    return value


def glb(path):
    """Returns the JSON and the contents of its buffer views."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    content = json.loads(data[20 : 20 + length])
    binary = data[20 + length + 8 :]
    views = content.get("bufferViews", [])
    return neutral(content), [binary[v.get("byteOffset", 0) :][: v["byteLength"]] for v in views]


def golden(scene):
    sides = []
    for side in (before, after):
        root = side / "golden/tests/golden" / scene
        tiles = {current_name(p.relative_to(root)): glb(p) for p in root.rglob("*.glb")}
        sides.append((tiles, {p.name: neutral(json.loads(p.read_text())) for p in sorted(root.glob("*.json"))}))
    (tiles, texts), (others, otherTexts) = sides
    verdict(f"golden {scene}", tiles.keys() == others.keys() and len(tiles) > 0, f"names of {len(tiles)} tiles")
    both = tiles.keys() & others.keys()
    verdict(f"golden {scene}", all(tiles[t][1] == others[t][1] for t in both), "buffer views")
    verdict(f"golden {scene}", all(tiles[t][0] == others[t][0] for t in both), "JSON of tiles")
    tileset = "tileset.json"
    verdict(f"golden {scene}", texts.get(tileset) == otherTexts.get(tileset), tileset)


models = sorted(p.name for p in before.iterdir() if p.is_dir() and p.name != "golden")
if not models:
    sys.exit("nothing was made")
for model in models:
    if model.endswith(".scene"):
        compare(model, "**/*.glb", "tiles")
        compare(model, "**/*.json", "JSON files")
        continue
    compare(model, "**/*.safetensors", "tensor files")
    compare(model, "**/config.toml", "config.toml")
    compare(model, "**/blocks.json", "blocks.json")
for scene in sorted(p.parent.name for p in (before / "golden/tests/golden").glob("*/tileset.json")):
    golden(scene)
sys.exit(1 if failures else 0)
