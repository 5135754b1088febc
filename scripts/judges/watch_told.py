"""Those who are told by `resight watch`, as other people's programs: Prometheus' parser, an MQTT broker and subscriber, a web server.

    python scripts/judges/watch_told.py

A session of the program is fed with dots seen by a camera that is knocked. `prometheus_client` must read the metrics page, with the types
and names that its own conventions want; a subscriber (`paho-mqtt`) must get, from the broker (`mosquitto` where it is installed, else
`amqtt`), each state, then find the last one and `offline` kept; Python's web server must get the same objects. Both speak TLS with a
certificate that the session was told to believe; a web server and a broker with another one get nothing. Needs prometheus-client,
paho-mqtt, amqtt, trustme.
"""

import atexit
import getpass
import http.server
import json
import math
import os
import pathlib
import queue
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

import paho.mqtt.client
import trustme
from prometheus_client.parser import text_string_to_metric_families

ROOT = pathlib.Path(__file__).resolve().parents[2]
DEMO = ROOT / "testdata" / "demo"
PATIENCE_S = 60.0
STATES = {"learning", "steady", "checking", "drifted", "stale", "inconsistent", "tracking"}


def program():
    """The program, built from this checkout unless RESIGHT_PROGRAM names one."""
    if "RESIGHT_PROGRAM" in os.environ:
        return os.environ["RESIGHT_PROGRAM"]
    build = ["cargo", "build", "--quiet", "-p", "resight-cli", "--message-format=json"]
    made = subprocess.run(build, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    found = [json.loads(line).get("executable") for line in made.splitlines()]
    return next(path for path in reversed(found) if path)


def wait_for(what, look):
    """What `look` gives as soon as it gives something."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        if found := look():
            return found
        time.sleep(0.05)
    raise TimeoutError(f"waited in vain for {what}")


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def lines(seconds, turn_deg):
    """Three dots on a line and one beside it, 0.6 m away, seen by a camera with f = 500 px that turned to the right."""
    dots = [(0.0, 0.0), (0.10, 0.0), (0.15, 0.0), (0.0, 0.15)]
    turn = math.radians(turn_deg)
    for second in seconds:
        seen = []
        for i, (x, y) in enumerate(dots):
            x, y, z = x - 0.05, 0.8 * y - 0.05, 0.6 + 0.3 * y
            x, z = math.cos(turn) * x - math.sin(turn) * z, math.sin(turn) * x + math.cos(turn) * z
            # Any errors will do that are not twice the same.
            jitter = [0.2 * math.sin(12.9898 * second + 78.233 * i + k) for k in (0.0, 1.6)]
            u, v = 320 + 500 * x / z + jitter[0], 240 + 500 * y / z + jitter[1]
            seen.append({"id": i, "corner": 0, "u_px": u, "v_px": v, "sigma_px": 0.2})
        yield json.dumps({"t_s": float(second), "detections": seen}) + "\n"


class Session:
    """`resight watch`, fed line by line."""

    def __init__(self, resight, folder, *more):
        camera = folder / "camera.toml"
        camera.write_text(
            'model = "pinhole"\nwidth_px = 640\nheight_px = 480\nfx_px = 500.0\nfy_px = 500.0\ncx_px = 320.0\ncy_px = 240.0\n'
        )
        target = folder / "dots.toml"
        target.write_text('kind = "line_plus_one"\nline_m = [0.0, 0.10, 0.15]\noff_m = [0.0, 0.15]\n')
        command = [resight, "watch", "--camera", f"gate={camera}", "--target", f"dots={target}", "--source", "-"]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            [*command, "--json", "--stale-after-s", "600", *more], stdin=pipe, stdout=pipe, stderr=pipe, text=True, env={"NO_PROXY": "*"}
        )
        atexit.register(self.process.kill)
        self.events, self.log = [], []
        self.readers = [
            threading.Thread(target=lambda: self.events.extend(map(json.loads, self.process.stdout)), daemon=True),
            threading.Thread(target=lambda: self.log.extend(self.process.stderr), daemon=True),
        ]
        for reader in self.readers:
            reader.start()

    def feed(self, text):
        self.process.stdin.writelines(text)
        self.process.stdin.flush()

    def told(self, text):
        try:
            return wait_for(text, lambda: next((line for line in list(self.log) if text in line), None))
        except TimeoutError as reason:
            raise TimeoutError(f"{reason}; the session said: {self.log}") from None

    def end(self):
        self.process.stdin.close()
        status = self.process.wait(PATIENCE_S)
        for reader in self.readers:
            reader.join()
        assert status == 0, "".join(self.log)
        return [event for event in self.events if event["event"] == "state"]


def start_broker(folder, certificate):
    port, key, chain = free_port(), folder / "key.pem", folder / "chain.pem"
    certificate.private_key_pem.write_to_path(str(key))
    certificate.cert_chain_pems[0].write_to_path(str(chain))
    mosquitto = shutil.which("mosquitto")
    if mosquitto:
        file = folder / "mosquitto.conf"
        # Run by root it would become another user, who cannot read the key.
        file.write_text(f"user {getpass.getuser()}\nlistener {port} 127.0.0.1\nallow_anonymous true\ncertfile {chain}\nkeyfile {key}\n")
        command = [mosquitto, "-c", str(file)]
    else:
        file = folder / "amqtt.yaml"
        file.write_text(
            f"listeners:\n  default:\n    type: tcp\n    bind: 127.0.0.1:{port}\n"
            f"    ssl: true\n    certfile: {chain}\n    keyfile: {key}\n"
            "plugins:\n  amqtt.plugins.authentication.AnonymousAuthPlugin:\n    allow_anonymous: true\n"
        )
        command = [str(pathlib.Path(sys.executable).with_name("amqtt")), "-c", str(file)]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, stdout=quiet, stderr=quiet)
    wait_for("the broker", lambda: answers(port))
    return process, port, pathlib.Path(command[0]).name


def subscribe(port, topic, ca):
    """A queue of (topic, payload, whether it was kept)."""
    came, ready = queue.Queue(), threading.Event()
    client = paho.mqtt.client.Client(paho.mqtt.client.CallbackAPIVersion.VERSION2)
    client.on_message = lambda _c, _d, message: came.put((message.topic, message.payload.decode(), message.retain))
    client.on_subscribe = lambda *_: ready.set()
    client.tls_set(ca_certs=str(ca))
    client.connect("127.0.0.1", port)
    client.loop_start()
    client.subscribe(topic, qos=1)
    assert ready.wait(PATIENCE_S), "no subscription"
    return client, came


def drained(came, last):
    """All that came, up to the payload that `last` knows."""
    all_came = []
    while not (all_came and last(*all_came[-1])):
        all_came.append(came.get(timeout=PATIENCE_S))
    return all_came


class Web:
    """Python's web server behind TLS."""

    def __init__(self, certificate):
        self.bodies = []
        bodies = self.bodies

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                bodies.append((self.headers["Idempotency-Key"], json.loads(self.rfile.read(int(self.headers["Content-Length"])))))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        certificate.configure_cert(context)
        self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.url = f"https://localhost:{self.server.server_address[1]}/hook"


def read_metrics(url):
    """Families by name, as Prometheus' own parser reads them."""
    with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
        kind = answer.headers["Content-Type"]
        assert kind.startswith("text/plain") and "version=0.0.4" in kind, kind
        page = answer.read().decode()
    families = list(text_string_to_metric_families(page))
    assert len({family.name for family in families}) == len(families), "a family is there twice"
    return {family.name: family for family in families}


def judge_metrics(families):
    for family in families.values():
        assert family.name.startswith("resight_") and family.documentation and family.type != "unknown", family
        is_counted = [sample.name.endswith("_total") for sample in family.samples]
        assert all(is_counted) if family.type == "counter" else not any(is_counted), family.name
        keys = [(sample.name, tuple(sorted(sample.labels.items()))) for sample in family.samples]
        assert len(set(keys)) == len(keys), f"{family.name}: a sample is there twice"
    one_hot = {sample.labels["state"]: sample.value for sample in families["resight_state"].samples}
    assert set(one_hot) == STATES and sum(one_hot.values()) == 1.0 and one_hot["drifted"] == 1.0, one_hot
    for stage in ("waited", "detect", "solve", "decide"):
        of_stage = [s for s in families["resight_stage_seconds"].samples if s.labels["stage"] == stage]
        below = [s.value for s in of_stage if s.name.endswith("_bucket")]
        assert below == sorted(below) and below[-1] == next(s.value for s in of_stage if s.name.endswith("_count")) > 0
    return len(families), sum(len(family.samples) for family in families.values())


def judge_session(resight, folder, authority):
    certificate, ca = authority.issue_cert("localhost", "127.0.0.1"), folder / "ca.pem"
    authority.cert_pem.write_to_path(str(ca))
    broker, port, name = start_broker(folder, certificate)
    try:
        client, came = subscribe(port, "site/#", ca)
        web = Web(certificate)
        told = ["--mqtt", f"mqtts://127.0.0.1:{port}/site", "--webhook", web.url, "--ca-file", str(ca)]
        session = Session(resight, folder, "--metrics", "127.0.0.1:0", *told)
        url = session.told("metrics: http://").split("metrics: ")[1].strip()
        session.feed(lines(range(100), 0.0))
        session.feed(lines(range(100, 140), 2.0))
        frames = {"camera": "gate", "target": "dots"}
        read = lambda: read_metrics(url)
        is_done = lambda families: families["resight_frames"].samples[0].value == 140.0
        families = wait_for("140 frames", lambda: (lambda f: f if is_done(f) else None)(read()))
        assert families["resight_frames"].samples[0].labels == frames
        n_families, n_samples = judge_metrics(families)
        states = session.end()
        said = drained(came, lambda topic, payload, _: topic == "site/availability" and payload == "offline")
        assert said[0][:2] == ("site/availability", "online"), said[0]
        got = [json.loads(payload) for topic, payload, _ in said if topic == "site/gate/dots/state"]
        late, kept = subscribe(port, "site/#", ca)
        found = dict(kept.get(timeout=PATIENCE_S)[:2] for _ in range(3))  # availability, source, state
        for other in (client, late):
            other.loop_stop()
        assert found["site/availability"] == "offline" and json.loads(found["site/gate/dots/state"]) == got[-1]
        assert json.loads(found["site/gate/source"])["connected"] is True, found
    finally:
        broker.terminate()
        broker.wait()
    for name_of, bodies in (("MQTT", got), ("webhook", [body for _, body in web.bodies])):
        assert [{k: body[k] for k in state} for state, body in zip(states, bodies, strict=True)] == states, name_of
    assert [key for key, _ in web.bodies] == [body["id"] for _, body in web.bodies]
    return n_families, n_samples, len(states), name


def judge_strangers(resight, folder):
    """Certificates that nobody vouches for get nothing."""
    stranger = trustme.CA().issue_cert("localhost", "127.0.0.1")
    web = Web(stranger)
    broker, port, _ = start_broker(folder, stranger)
    try:
        told = ["--webhook", web.url, "--mqtt", f"mqtts://127.0.0.1:{port}", "--flush-s", "1"]
        session = Session(resight, folder, *told)
        session.feed(lines(range(5), 0.0))
        wait_for("two refusals", lambda: sum("UnknownIssuer" in line for line in list(session.log)) == 2)
        session.end()
    finally:
        broker.terminate()
        broker.wait()
    assert web.bodies == [] and sum("never arrived" in line for line in session.log) == 2, session.log
    assert not any("connected" in line for line in session.log), session.log


def main():
    resight = program()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        families, samples, states, broker = judge_session(resight, folder, trustme.CA())
        judge_strangers(resight, folder)
    print(f"watch_told: {families} families, {samples} samples; {states} states by {broker} and by https agree")


if __name__ == "__main__":
    main()
