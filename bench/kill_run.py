#!/usr/bin/env python3
"""Kills `tessera run` at random moments, at least once in each stage, and starts it again.

    kill_run.py SEED MOMENTS RECORD -- PROGRAM run PHOTOS OUT ...

Stages of less than three seconds are killed when they begin, and repeated if they were too fast. RECORD.unbroken is the
run.json of a run that was not killed, which tells how long each stage takes.

Prints a line for each kill, and writes RECORD: the seconds of all attempts, and the programs that have survived a kill.
"""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time

SHORT_SECONDS = 3
ATTEMPTS = 20  # to kill a short stage
URGENCY = 15  # in steps of nice
PAUSE = 1e-4  # seconds between looks at the record, so that they take no core


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


def stage_in_progress(out):
    """The first stage that run.json calls unfinished; None if there is none."""
    try:
        text = open(os.path.join(out, "run.json")).read()
    except OSError:
        return None
    # The record is not parsed while a stage of less than a millisecond is waited for.
    if '"finished": false' not in text:
        return None
    return next((stage["name"] for stage in json.loads(text)["stages"] if not stage["finished"]), None)


def trained_steps(out):
    """The steps of the last checkpoint of the model; 0 if there is none."""
    try:
        return json.load(open(os.path.join(out, "model", "manifest.json")))["step"]
    except OSError:
        return 0


def changed(path):
    """When a file was written last; 0 if it is not there."""
    try:
        return os.path.getmtime(path)
    except OSError:
        return 0


def last_progress(out, stage):
    """When something was recorded that is not repeated: a stage that has begun, or a checkpoint of the training."""
    recorded = changed(os.path.join(out, "run.json"))
    return max(recorded, changed(os.path.join(out, "model", "manifest.json"))) if stage == "train" else recorded


def training_log(out):
    return os.path.join(out, "logs", "train.log")


def log_bytes(out):
    try:
        return os.path.getsize(training_log(out))
    except OSError:
        return 0


def first_step(out, begin):
    """The first step that the log of the training reports behind its first `begin` bytes; None if it reports none."""
    try:
        with open(training_log(out), "rb") as log:
            log.seek(begin)
            text = log.read().decode(errors="replace")
    except OSError:
        return None
    step = re.search(r"training: (?:\d+ % \()?(\d+)(?:/\d+)? steps", text)
    return int(step.group(1)) if step else None


def version(out):
    try:
        status = os.stat(os.path.join(out, "run.json"))
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def forget_request(out):
    """Lets `--from` begin anew, which otherwise goes on with what was begun in that way."""
    path = os.path.join(out, "run.json")
    run = json.load(open(path))
    run.pop("begun_from", None)
    json.dump(run, open(path, "w"))


def wait_for(stage, later, process, out, earlier):
    """Waits until a record that is newer than the `earlier` one says that the stage is in progress; returns whether it
    does, before one of the later stages, or the end."""
    while process.poll() is None:
        time.sleep(PAUSE)
        current = stage_in_progress(out) if version(out) != earlier else None
        if current == stage:
            return True
        if current in later:
            return False
    return False


def kill(process):
    """Kills it alone; returns how many programs it had started, and how many of them have survived."""
    process.send_signal(signal.SIGSTOP)  # at once: the search for its children takes longer than some stages
    below = children(process.pid)
    process.kill()
    process.wait()
    time.sleep(1)
    left = [pid for pid, start in below.items() if alive(pid, start)]
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    return len(below), len(left)


def main():
    seed, moments, record = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    command = sys.argv[5:]
    out = command[3]
    random.seed(seed)
    unbroken = {stage["name"]: stage["seconds"] for stage in json.load(open(record + ".unbroken"))["stages"]}
    names = list(unbroken)
    long = [name for name in names if unbroken[name] >= SHORT_SECONDS]
    more = random.choices(long, k=max(0, moments - len(names)))
    attempts, survivors, reached = [], 0, {name: 0 for name in names}
    resumed, pending = [], None  # trainings after a kill; the checkpoint of one that has not gone on yet

    def note_resumed():
        """Notes where the training has gone on after the last kill of it, if that has left a checkpoint."""
        nonlocal pending
        if pending is None:
            return
        step = first_step(out, pending["log_bytes"])
        if step is not None:
            resumed.append({"checkpoint_step": pending["step"], "first_step": step})
            pending = None

    # A stage may last less than a millisecond: what waits for it goes before everything else, if that is allowed.
    try:
        os.nice(-URGENCY)
        back = URGENCY
    except PermissionError:
        back = 0

    def start(more_arguments):
        return subprocess.Popen(command + more_arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                preexec_fn=lambda: os.nice(back))

    for name in names:
        kills = 1 + more.count(name)
        for _ in range(kills):
            missed = False
            for _ in range(ATTEMPTS if name not in long else 1):
                if missed:
                    forget_request(out)
                begin, earlier = time.time(), version(out)
                process = start(["--from", name] if missed else [])
                in_progress = wait_for(name, names[names.index(name) + 1 :], process, out, earlier)
                if name in long and in_progress:
                    time.sleep(random.uniform(0.05, 0.9) * unbroken[name] / kills)
                was_running, killed_at = process.poll() is None, time.time()
                programs, left = kill(process)
                survivors += left
                where = stage_in_progress(out) or "between stages"
                repeated = killed_at - max(begin, last_progress(out, where))
                note_resumed()
                if where == "train" and trained_steps(out) > 0:
                    pending = {"step": trained_steps(out), "log_bytes": log_bytes(out)}
                seconds = time.time() - begin - 1
                attempts.append({"target": name, "killed_in": where, "running": was_running, "again": missed,
                                 "seconds": seconds, "repeated_at_most": repeated})
                print(f"killed in {where} after {seconds:.1f} s, at most {repeated:.1f} s repeated, "
                      f"{programs} children, {left} survived", flush=True)
                if was_running and where in reached:
                    reached[where] += 1
                missed = where != name
                if not missed:
                    break
    begin = time.time()
    process = start([])
    process.communicate()
    note_resumed()
    attempts.append({"target": None, "seconds": time.time() - begin, "status": process.returncode})
    kills = [attempt for attempt in attempts if attempt.get("running") and not attempt["again"]]
    # What a kill destroys is at most what was done since the stage had begun or the program had started, and since the
    # last checkpoint of the training; on average, what all attempts took longer than the unbroken run.
    seconds, whole = sum(attempt["seconds"] for attempt in attempts), sum(unbroken.values())
    json.dump({"attempts": attempts, "survivors": survivors, "kills": len(kills), "reached": reached,
               "status": attempts[-1]["status"], "seconds": seconds, "unbroken_seconds": whole,
               "repeated_seconds_at_most": max(attempt["repeated_at_most"] for attempt in kills),
               "repeated_seconds_mean": (seconds - whole) / len(kills), "resumed": resumed},
              open(record, "w"), indent=1)


main()
