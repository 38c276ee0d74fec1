#!/usr/bin/env python3
"""Kills `tessera run` at random moments, at least once in each stage, and starts it again.

    kill_run.py SEED MOMENTS RECORD -- PROGRAM run PHOTOS OUT ...

Prints a line for each kill, and writes RECORD: the seconds of all attempts, and the programs that have survived a kill.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time

SHORT = {"inspect", "pairs", "remapping", "georeferencing", "capture"}  # killed as soon as they begin


def children(pid):
    """The descendants of a process, with their starting times, which tell them from later processes of the same number."""
    parents = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                fields = open(f"/proc/{name}/stat").read().rpartition(")")[2].split()
            except OSError:
                continue
            parents[int(name)] = (int(fields[1]), fields[19])
    below, grown = {pid}, True
    while grown:
        more = {child for child, (parent, _) in parents.items() if parent in below} - below
        below |= more
        grown = bool(more)
    return {child: parents[child][1] for child in below - {pid} if child in parents}


def alive(pid, start):
    try:
        fields = open(f"/proc/{pid}/stat").read().rpartition(")")[2].split()
    except OSError:
        return False
    return fields[19] == start and fields[0] != "Z"


def stages_of(out):
    return [stage["name"] for stage in json.load(open(os.path.join(out, "run.json")))["stages"]]


def main():
    seed, moments, record = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    command = sys.argv[5:]
    out = command[3]
    random.seed(seed)
    # The seconds of each stage, from an unbroken run.
    unbroken = {stage["name"]: stage["seconds"] for stage in json.load(open(record + ".unbroken"))["stages"]}
    names = list(unbroken)
    long = [name for name in names if name not in SHORT]
    targets = sorted(names + random.choices(long, k=max(0, moments - len(names))), key=names.index)
    attempts, survivors, reached = [], 0, {name: 0 for name in names}
    while True:
        target = targets.pop(0) if targets else None
        begin = time.time()
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        if target is None:
            process.communicate()
            attempts.append({"target": None, "seconds": time.time() - begin, "status": process.returncode})
            break
        before = names[names.index(target) - 1] if names.index(target) > 0 else None
        while before is not None:
            line = process.stdout.readline()
            if not line or line.split(" ")[0] == before:
                break
        if target not in SHORT:
            time.sleep(random.uniform(0.05, 0.9) * unbroken[target])
        # What has already ended was not killed: the stage went faster than expected.
        was_running = process.poll() is None
        below = children(process.pid)
        process.kill()
        process.wait()
        time.sleep(1)
        left = [pid for pid, start in below.items() if alive(pid, start)]
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        survivors += len(left)
        try:
            unfinished = [s for s in json.load(open(os.path.join(out, "run.json")))["stages"] if not s["finished"]]
        except OSError:
            unfinished = []
        where = unfinished[0]["name"] if unfinished else "between stages"
        if where in reached:
            reached[where] += 1
        attempts.append({"target": target, "killed_in": where, "running": was_running, "seconds": time.time() - begin - 1})
        print(f"killed in {where} after {attempts[-1]['seconds']:.1f} s, {len(below)} children, {len(left)} survived",
              flush=True)
    total = sum(attempt["seconds"] for attempt in attempts)
    whole = sum(unbroken.values())
    json.dump({"attempts": attempts, "survivors": survivors, "kills": len(attempts) - 1, "reached": reached,
               "status": attempts[-1]["status"], "seconds": total, "unbroken_seconds": whole,
               "repeated_seconds_per_kill": (total - whole) / max(1, len(attempts) - 1)}, open(record, "w"), indent=1)


main()
