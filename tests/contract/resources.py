"""What is on the server while it is tried: scan sets, jobs, models and the rest, made without schemathesis."""

import base64
import json
import os
import queue
import threading
import uuid
from http.server import BaseHTTPRequestHandler, HTTPServer

import requests

import surfaces

URL = os.environ["VISAGE_URL"]

BALL = surfaces.knobbed_ball()
SCANS = {"north.obj": surfaces.knobbed_ball(rows=range(0, 32)), "south.obj": surfaces.knobbed_ball(rows=range(16, 49))}
IDENTITY = [[float(row == column) for column in range(4)] for row in range(4)]
POSES = {name: IDENTITY for name in SCANS}
LANDMARKS = dict(zip("abc", surfaces.TIPS))


def call(method, path, status, **kwargs):
    response = requests.request(method, URL + path, timeout=60, **kwargs)
    assert response.status_code == status, f"{method} {path}: {response.status_code} {response.text}"
    return response.json() if response.content else None


def obj(part, name, content):
    return (part, (name, content, "application/octet-stream"))


def scan_parts():
    return [obj("scans", name, content) for name, content in SCANS.items()]


def pose_part():
    return obj("poses", "poses.json", json.dumps(POSES).encode())


def new_scan_set():
    return call("POST", "/v1/scan-sets/upload", 201, files=[*scan_parts(), pose_part()], data={"unit": "mm"})["id"]


def new_upload():
    headers = {"Upload-Length": str(len(BALL)), "Upload-Metadata": upload_metadata("new.obj")}
    return call("POST", f"/v1/scan-sets/{world().scan_set}/uploads", 201, headers=headers)["id"]


def upload_metadata(name):
    return f"filename {base64.b64encode(name.encode()).decode()}"


def new_job(scan_set=None):
    body = {"scan_set_id": scan_set or new_scan_set()}
    return call("POST", "/v1/jobs", 202, json=body)["id"]


def ended_job(job, *statuses):
    for _ in range(10):
        view = call("GET", f"/v1/jobs/{job}", 200, params={"wait": 30})
        if view["finished_at"]:
            assert view["status"] in statuses, view
            return view
    raise AssertionError(f"job {job} does not end")


def canceled_job():
    # one that has ended meanwhile can be neither canceled nor retried: another one then
    for _ in range(10):
        job = new_job()
        if requests.post(f"{URL}/v1/jobs/{job}/cancel", timeout=60).status_code == 202:
            if ended_job(job, "canceled", "succeeded")["status"] == "canceled":
                return job
    raise AssertionError("no job could be canceled")


def new_model(label="knobs", tips=surfaces.TIPS, size=1.0):
    content = surfaces.knobbed_ball(tips, size)
    return call("POST", "/v1/models", 201, files=[obj("model", "ball.obj", content)], data={"label": label})["id"]


def new_standard():
    form = {"name": f"s{uuid.uuid4().hex}", "unit": "mm", "landmarks": json.dumps(LANDMARKS)}
    return call("POST", "/v1/standards", 201, files=[obj("model", "ball.obj", BALL)], data=form)["name"]


def new_key():
    return call("POST", "/v1/keys", 201, json={"name": "schemathesis", "scope": "admin"})


class Gone(BaseHTTPRequestHandler):
    """A receiver that wants no message any more."""

    def do_POST(self):
        self.send_response(410)
        self.end_headers()
        REFUSED.put(self.headers["webhook-id"])

    def log_message(self, *_):
        pass


_receiver = HTTPServer(("127.0.0.1", 0), Gone)
threading.Thread(target=_receiver.serve_forever, daemon=True).start()
REFUSED = queue.SimpleQueue()
GONE = f"http://127.0.0.1:{_receiver.server_port}/"
ENDED = []


def new_webhook():
    # nobody listens there: messages wait, or are dead
    body = {"name": "schemathesis", "url": "http://127.0.0.1:9/", "events": ["webhook.ping"]}
    return call("POST", "/v1/webhooks", 201, json=body)["id"]


def deleted_model():
    """What is in the recycle bin."""
    model = new_model()
    requests.delete(f"{URL}/v1/models/{model}", timeout=60)
    return model


def ended_delivery():
    """A message that a receiver has refused for good, so that it can be sent once more."""
    webhook = call("POST", "/v1/webhooks", 201, json={"name": "gone", "url": GONE, "events": ["webhook.ping"]})["id"]
    delivery = call("POST", f"/v1/webhooks/{webhook}/ping", 202)["id"]
    while REFUSED.get(timeout=60) != delivery:
        pass
    # the refusal was sent; each look takes as long as an answer, until the service has stored what it means
    while not call("GET", f"/v1/webhooks/{webhook}/deliveries?status=dead", 200)["items"]:
        pass
    # there is room for some of them only, and a message goes with its webhook
    ENDED.append(webhook)
    if len(ENDED) > 8:
        call("DELETE", f"/v1/webhooks/{ENDED.pop(0)}", 204)
    return {"id": webhook, "delivery_id": delivery}


class World:
    """What is there while schemathesis asks."""

    def __init__(self):
        self.scan_set = new_scan_set()
        self.job = new_job(self.scan_set)
        self.registered = ended_job(self.job, "succeeded")["model_id"]
        self.positive = [new_model(size=size) for size in (1.05, 0.96)]
        self.negative = [new_model("other", surfaces.STRAIGHT, size) for size in (1.0, 0.97)]
        self.standard = new_standard()
        # the server is open to everybody: the first key would close it otherwise
        self.key = new_key()
        self.webhook = new_webhook()


_world = None


def world():
    global _world
    _world = _world or World()
    return _world
