# The requests that server.sh sends to a server, and their results as JSON. Python 3.11 and its standard library.
#   server_clients.py PORT PID FOLDER SECRET SECONDS
# The server serves FOLDER/scene, and FOLDER/viewer at its root. SECRET is text that no response may contain.
import itertools
import json
import multiprocessing
import pathlib
import random
import resource
import select
import socket
import sys
import time

PORT, PID, FOLDER = int(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
SECRET, SECONDS = sys.argv[4].encode(), float(sys.argv[5])
STALLED = 500
LARGE = "/scene/large.glb"


def connect(timeout=10.0):
    one = socket.create_connection(("127.0.0.1", PORT), timeout)
    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return one


def request(target, more=b"Connection: close\r\n", method=b"GET"):
    target = target if isinstance(target, bytes) else target.encode("utf-8", "surrogateescape")
    return method + b" " + target + b" HTTP/1.1\r\nHost: localhost\r\n" + more + b"\r\n"


def exchange(sent, half_close=False, timeout=10.0):
    """Returns all that the server answers until it closes the connection or sends nothing for `timeout` seconds."""
    answer = bytearray()
    with connect(timeout) as one:
        try:
            one.sendall(sent)
            if half_close:
                one.shutdown(socket.SHUT_WR)
            while chunk := one.recv(1 << 18):
                answer += chunk
        except (TimeoutError, ConnectionError):
            pass
    return bytes(answer)


def status_of(answer):
    return int(answer[9:12]) if answer.startswith(b"HTTP/1.") and answer[9:12].isdigit() else 0


def resident_mib():
    for line in open(f"/proc/{PID}/status"):
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0


def system_mib():
    """Returns the MiB that the system uses for TCP, over all processes."""
    for line in open("/proc/net/sockstat"):
        if line.startswith("TCP:"):
            return int(line.split()[-1]) * resource.getpagesize() / (1 << 20)
    return 0


def descriptors():
    return sum(1 for _ in pathlib.Path(f"/proc/{PID}/fd").iterdir())


def paths_outside():
    """Returns request targets, none of which is a file of the site."""
    dots = ["..", "%2e%2e", ".%2E", "%252e%252e", "%c0%ae%c0%ae", "%e0%80%ae%e0%80%ae", "%uff0e%uff0e", "\uff0e\uff0e",
            "..;", "...", "..%00", "..%20", "..%0d%0a", "\x01..", "%%32e%%32e"]
    slashes = ["/", "%2f", "%252f", "%c0%af", "%5c", "\\", "//", "/./", "%c1%9c", "\u2215"]
    for dot, slash, begin, depth in itertools.product(dots, slashes, ["/", "/scene/", "/scene/tiles/"], [1, 2, 3, 9]):
        for name in ["secret.txt", f"etc{slash}passwd", f"proc{slash}self{slash}environ"]:
            yield begin + (dot + slash) * depth + name
    secret = str(FOLDER / "secret.txt")
    links = ["out.txt", "up/secret.txt", "up/scene/../secret.txt", "chain.txt", "shown.txt", "environ", "passwd",
             "root/etc/passwd", "loop", "loop/a", "descriptors/0", "descriptors/1", "pipe"]
    names = ["", ".", "..", "tiles", "tiles/", "tileset.json/", "tileset.json/.", "tileset.json/../tileset.json",
             ".hidden", "%2ehidden", "tiles/.hidden", ".git/config", "tileset.json%00", "tileset.json%00.txt", "%00",
             "tileset.json%", "tileset.json%4", "tileset.json%zz", "tileset.json::$DATA", "tileset.json.",
             "tileset.json%20", "TILESE~1.JSO", "CON", "NUL", "aux.glb", "COM1", "PRN.json", "C:", "C:%5cautoexec.bat",
             "%5c%5c?%5cC:", "..%5c..%5csecret.txt",
             "?file=../secret.txt", "..?/tileset.json", "nothing?../../secret.txt", "nothing#/../secret.txt",
             ".?tileset.json", "a" * 255, "a" * 256, "a" * 7000, "a/" * 3500, "../" * 2500 + "secret.txt",
             "a/../" * 1500 + "../secret.txt", "%2e%2e%2f" * 800 + "secret.txt", "a" * 20000, "../" * 20000,
             "~root/.profile", "$HOME/secret.txt", "%0d%0aX: y"]
    for name in links + names:
        yield "/scene/" + name
    yield from ["", "*", ".", "..", "secret.txt", "scene/tileset.json", "../secret.txt", "//", "//etc/passwd",
                "///etc/passwd", "/scene", "/scene%2f", "/scene-beside/secret.txt", "/scenesecret.txt",
                "/secret.txt?/scene/tileset.json", secret, "/" + secret, "/scene/" + secret, "/scene" + secret,
                "file://" + secret, "file:" + secret, "localhost:80", "http://localhost/secret.txt",
                "http://localhost/scene/../../secret.txt", "http://localhost" + secret, "http://example.com/",
                f"http://127.0.0.1:{PORT}/scene/%2e%2e/secret.txt", "https:/secret.txt", "/proc/self/environ",
                "/proc/self/fd/0", "/dev/null", "/dev/zero", "/etc/passwd", "C:/", "C:\\", "\\", "\\\\localhost\\c$",
                "/%", "/%00"]


def traversal():
    sent = []
    for target in paths_outside():
        sent.append(request(target))
    for method in [b"HEAD", b"POST", b"PROPFIND", b"get"]:
        for target in ["/../secret.txt", "/scene/up/secret.txt", "/scene/out.txt"]:
            sent.append(request(target, method=method))
    for name in [b"X-Original-URL", b"X-Rewrite-URL", b"Destination"]:
        sent.append(request("/scene/nothing", name + b": /secret.txt\r\nConnection: close\r\n"))
    for raw in [b"GET /scene/\0../secret.txt HTTP/1.1", b"GET /scene/tileset.json\0/../../secret.txt HTTP/1.1",
                b"GET /scene/ ../secret.txt HTTP/1.1", b"GET\t/scene/../secret.txt HTTP/1.1",
                b"GET /scene/\xc0\xae\xc0\xae/secret.txt HTTP/1.1", b"GET /scene/\xff\xfe../secret.txt HTTP/1.1",
                b"GET /scene/../secret.txt", b"GET /secret.txt HTTP/0.9", b"GET ../secret.txt HTTP/1.0"]:
        sent.append(raw + b"\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    for host in [b"../..", b"localhost/../secret.txt", b"file:", b"", b"example.com"]:
        sent.append(b"GET /secret.txt HTTP/1.1\r\nHost: " + host + b"\r\nConnection: close\r\n\r\n")
    leaks, others = 0, []
    for one in sent:
        answer = exchange(one)
        leaks += SECRET in answer or b"root:" in answer
        if not 400 <= status_of(answer) < 500:
            others.append((one[:100].decode("latin1"), answer[:40].decode("latin1")))
    for other in others[:10]:
        print("not refused:", *map(repr, other), file=sys.stderr)
    return {"requests": len(sent), "leaks": leaks, "not_refused": len(others)}


def honest(ended, report):
    """Fetches on new connections until told to end; reports the longest time from connecting to the last byte."""
    tiles = sorted((FOLDER / "scene").rglob("*.glb"), key=lambda path: path.stat().st_size)
    wanted = [FOLDER / "scene/tileset.json", *tiles[-2:]]  # the largest files of the scene, and large.glb
    pairs = [(request("/" + str(path.relative_to(FOLDER))), path.read_bytes()) for path in wanted]
    longest, fetches, wrong = 0.0, 0, 0
    while not ended.is_set():
        for sent, expected in pairs:
            begin = time.monotonic()
            try:
                answer = exchange(sent)
            except OSError:
                answer = b""
            longest = max(longest, time.monotonic() - begin)
            fetches += 1
            wrong += answer.partition(b"\r\n\r\n")[2] != expected
        time.sleep(0.02)
    report.send({"fetches": fetches, "wrong": wrong, "longest_s": round(longest, 3)})


class Stalled:
    """A stalling client of one of five kinds; it reconnects if the server closes the connection."""

    def __init__(self, kind):
        self.kind, self.socket = kind, None
        self.open()

    def open(self):
        self.close()
        self.socket = socket.socket()
        if self.kind >= 3:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.settimeout(10)
        self.socket.connect(("127.0.0.1", PORT))
        self.socket.setblocking(False)
        self.left = iter(request(LARGE, b"X: " + b"y" * 4000))
        if self.kind == 1:
            self.socket.send(request(LARGE)[:12])
        elif self.kind >= 3:
            self.socket.send(request(LARGE))

    def close(self):
        if self.socket:
            self.socket.close()

    def is_held(self):
        """Returns whether the server keeps the connection open."""
        waiting = select.poll()
        waiting.register(self.socket, select.POLLRDHUP)
        return not waiting.poll(0)

    def turn(self):
        try:
            if self.kind == 2:
                self.socket.send(bytes([next(self.left)]))  # one byte of the headers
            if self.kind == 3:
                return  # never reads
            if self.socket.recv(1) == b"":  # of kind 4, one byte of the file
                self.open()
        except BlockingIOError:
            pass
        except OSError:
            self.open()


def storm():
    before, system_before = resident_mib(), system_mib()
    ended = multiprocessing.Event()
    receive, report = multiprocessing.Pipe(False)
    client = multiprocessing.Process(target=honest, args=(ended, report))
    client.start()
    clients = [Stalled(i % 5) for i in range(STALLED)]
    end, most, max_system, held = time.monotonic() + SECONDS, 0.0, 0.0, []
    while time.monotonic() < end:
        time.sleep(0.25)
        most, max_system = max(most, resident_mib()), max(max_system, system_mib())
        held.append(sum(one.is_held() for one in clients))
        for one in clients:
            one.turn()
    ended.set()
    figures = receive.recv()
    client.join()
    for one in clients:
        one.close()
    return figures | {"growth_mib": round(most - before, 1), "system_mib": round(max_system - system_before, 1),
                      "stalled": sum(held) // len(held)}


def garbage():
    """Returns requests truncated at every position, requests with changed bytes, and random bytes."""
    chance = random.Random(1)
    good = [request("/scene/tileset.json", b"Range: bytes=0-10\r\nIf-None-Match: \"a\"\r\nAccept-Encoding: gzip\r\n"),
            request("/", b"Content-Length: 5\r\nConnection: close\r\n") + b"hello",
            request("/scene/tileset.json", b"Transfer-Encoding: chunked\r\n") + b"5\r\nhello\r\n0\r\n\r\n"]
    sent = [one[:length] for one in good for length in range(len(one))]
    while len(sent) < 3500:
        one = bytearray(chance.choice(good))
        for _ in range(chance.randint(1, 8)):
            at = chance.randrange(len(one))
            one[at:at + chance.randint(0, 2)] = chance.randbytes(chance.randint(0, 3))
        sent.append(bytes(one))
    while len(sent) < 5000:
        sent.append(chance.randbytes(chance.choice([1, 10, 100, 1000, 10000])))
    bad = 0
    for one in sent:
        if chance.random() < 0.3:
            with connect() as client:
                client.sendall(one)  # and disconnects
            continue
        answer = exchange(one, half_close=True)
        bad += (answer != b"" and not 200 <= status_of(answer) < 500) or SECRET in answer
    return {"requests": len(sent), "bad": bad}


def quiet():
    """Waits until the server has closed all connections, and returns how much memory it then uses."""
    end = time.monotonic() + 30
    while descriptors() > idle and time.monotonic() < end:
        time.sleep(0.1)
    return resident_mib()


exchange(request("/scene/tileset.json", b"Accept-Encoding: gzip\r\nConnection: close\r\n"))
exchange(request(LARGE))
time.sleep(0.5)
idle, before = descriptors(), resident_mib()
figures = {"traversal": traversal(), "storm": storm()}
first = quiet()
figures |= {"second_storm": storm(), "garbage": garbage()}
figures |= {"resident_mib": round(before, 1), "first_mib": round(first, 1), "kept_mib": round(quiet() - first, 2),
            "descriptors_more": descriptors() - idle}
print(json.dumps(figures, indent=2))
