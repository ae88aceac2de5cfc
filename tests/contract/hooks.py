"""What schemathesis can't know: which ids exist, what a scan file looks like, which fields exclude each other.

What is generated as valid gets ids of resources that are there, files made by code in place of random bytes, and the
rules between fields that a schema can't say (`RULES`, each with its reason). What is generated as invalid stays as it is.
The operations that answered with a success are written to the file that VISAGE_ANSWERED names, one a line. Scans are
fetched from VISAGE_SOURCE, an address of this machine that the service may fetch from: it is answered here.
"""

import base64
import copy
import hashlib
import json
import os
import uuid

import requests
import schemathesis
from schemathesis.core import NotSet
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation.meta import TestPhase

import sources
import surfaces
from resources import (
    BALL,
    LANDMARKS,
    POSES,
    SCANS,
    URL,
    canceled_job,
    deleted_model,
    ended_delivery,
    new_job,
    new_key,
    new_model,
    new_scan_set,
    new_standard,
    new_upload,
    new_webhook,
    obj,
    pose_part,
    scan_parts,
    upload_metadata,
    world,
)

# pieces of files are bytes as any
schemathesis.serializer.alias("application/offset+octet-stream", "application/octet-stream")

ANSWERED = os.environ["VISAGE_ANSWERED"]


# paths: an operation that changes or removes something gets something of its own

IDS = {
    "getScanSet": lambda: {"id": world().scan_set},
    "deleteScanSet": lambda: {"id": new_scan_set()},
    "putScan": lambda: {"id": new_scan_set()},
    "fetchScan": lambda: {"id": new_scan_set()},
    "createUpload": lambda: {"id": new_scan_set()},
    "listUploads": lambda: {"id": world().scan_set},
    "describeUploads": lambda: {"id": world().scan_set},
    "getUpload": lambda: {"id": new_upload()},
    "sendPiece": lambda: {"id": new_upload()},
    "deleteUpload": lambda: {"id": new_upload()},
    "deleteScan": lambda: {"id": new_scan_set(), "name": "north.obj"},
    "putPoses": lambda: {"id": new_scan_set()},
    "putPoseFile": lambda: {"id": new_scan_set()},
    "getExpiry": lambda: {"id": world().scan_set},
    "putExpiry": lambda: {"id": new_scan_set()},
    "getJob": lambda: {"id": world().job},
    "followJob": lambda: {"id": world().job},
    "deleteJob": lambda: {"id": canceled_job()},
    "cancelJob": lambda: {"id": new_job()},
    "retryJob": lambda: {"id": canceled_job()},
    "getModel": lambda: {"id": world().registered},
    "deleteModel": lambda: {"id": new_model()},
    "getModelPoses": lambda: {"id": world().registered},
    "getModelConf": lambda: {"id": world().registered},
    "getModelReport": lambda: {"id": world().registered},
    "getModelFile": lambda: {"id": world().registered, "file": "cloud.ply"},
    "getModelCloud": lambda: {"id": world().registered},
    "getModelMesh": lambda: {"id": world().registered},
    "getModelPosesAs": lambda: {"id": world().registered},
    "getModelScans": lambda: {"id": world().registered},
    "measureDeviation": lambda: {"id": world().positive[0]},
    "paintDeviation": lambda: {"id": world().positive[0]},
    "getBinEntry": lambda: {"id": deleted_model()},
    "restoreFromBin": lambda: {"id": deleted_model()},
    "purgeFromBin": lambda: {"id": deleted_model()},
    "getWebhook": lambda: {"id": world().webhook},
    "deleteWebhook": lambda: {"id": new_webhook()},
    "pingWebhook": lambda: {"id": world().webhook},
    "listDeliveries": lambda: {"id": world().webhook},
    "replayDeadDeliveries": lambda: {"id": world().webhook},
    "replayDelivery": ended_delivery,
    "paintSaliency": lambda: {"id": world().positive[0]},
    "revokeKey": lambda: {"id": new_key()["id"]},
    "getModelPicture": lambda: {"id": world().registered, "kind": "thumbnail"},
    "getModelPlot": lambda: {"id": world().registered, "kind": "overlap"},
    "getModelReportPage": lambda: {"id": world().registered},
    "getSetPicture": lambda: {"id": world().scan_set},
    "getScanPicture": lambda: {"id": world().scan_set, "name": "north.obj"},
    "getStandard": lambda: {"name": world().standard},
    "deleteStandard": lambda: {"name": new_standard()},
    "markExamples": lambda: {"name": world().standard},
}


# bodies: what no schema says


def job_of_something(body):
    """An evaluation takes no other field, a surface those of a model; a registration needs a scan set, a base model of that
    set, a scan of it."""
    if body.get("kind") == "evaluate":
        for field in set(body) - {"kind"}:
            del body[field]
        return
    if body.get("kind") == "surface":
        for field in set(body) - {"kind", "options", "label"}:
            del body[field]
        body["model_id"] = world().positive[0]
        options_of_scans(body)
        return
    body["scan_set_id"] = world().scan_set
    body.pop("base_model_id", None)
    body.pop("model_id", None)
    options_of_scans(body)


def options_of_scans(body):
    """The scan that keeps its pose is one of those sent; scales are found by one method alone."""
    if isinstance(body.get("hints"), dict):
        # scans that are there, places on them, and one of two fields
        ball = {"sphere": {"center": [0.0, 0.0, 0.0], "radius": 1.0}}
        units = {"south.obj": "mm"}
        body["hints"] = {"overlaps": [list(SCANS)], "regions": [{"scan": "south.obj", "leave": ball}], "units": units}
    options = body.get("options")
    if not isinstance(options, dict):
        return
    if options.get("reference") is not None:
        options["reference"] = "south.obj"
    if options.get("scale") == "per_view":
        options["method"] = "joint"


def options_of_form(body):
    """As above, and scales need poses to begin from."""
    if "poses" not in body and isinstance(body.get("options"), dict):
        body["options"].pop("scale", None)
    options_of_scans(body)


def one_question(body):
    """One of standard, model and triangle; methods are for the built-in face, likeness and place for models; a cursor is given out by an
    answer."""
    asked = [field for field in ("triangle", "model_id", "standard") if body.get(field) is not None]
    for field in asked[1:]:
        del body[field]
    body.pop("cursor", None)
    if body.get("triangle") is not None:
        body["triangle"] = {"sides": [31.0, 52.5, 52.5], "unit": "mm"}
    elif body.get("model_id") is not None:
        body["model_id"] = world().positive[0]
    else:
        body["standard"] = "face"
    if body.get("standard") is None:
        body.pop("method", None)
    if body.get("model_id") is None:
        body.pop("likeness", None)
        body.pop("place", None)


def one_verdict(body):
    """A method is for a standard, which has to be there, likeness and place for models; a cursor is given out."""
    body.pop("cursor", None)
    if "standard" in body or "method" in body:
        body["standard"] = "face"
        body.pop("likeness", None)
        body.pop("place", None)


def examples(body):
    """Marked models are there, and each is marked once."""
    if body.get("positive"):
        body["positive"] = world().positive
    if body.get("negative"):
        body["negative"] = world().negative


def landmarks(body):
    """Landmarks lie on the surface, the lists are JSON, and a name is taken once."""
    body["name"] = f"s{uuid.uuid4().hex}"
    body["landmarks"] = LANDMARKS
    for field, value in (("triangle", list("abc")), ("positive", world().positive), ("negative", world().negative)):
        if field in body:
            body[field] = json.dumps(value)


def poses(body):
    """Matrices are rigid motions, and at least one scan has a pose."""
    body.clear()
    body.update(POSES)


def labelled(query):
    """There are labels of two kinds, and what is asked for is there; other methods are for the face."""
    query.pop("label_prefix", None)
    if "standard" in query or "method" in query:
        query["standard"] = "face"
    query["label"] = "knobs"


def known_page(query):
    """A cursor is given out, an id names something."""
    query.pop("cursor", None)
    if "scan_set_id" in query:
        query["scan_set_id"] = world().scan_set
    if "key_id" in query:
        query["key_id"] = world().key["id"]


def reference(query):
    """The other model is there."""
    query["reference"] = world().positive[1]


def time_to_come(body):
    """What expires does so at a time to come."""
    if body.get("expires_at") is not None:
        body["expires_at"] = "2100-01-01T00:00:00Z"


def other_model(query):
    """The model that is compared with is there."""
    if "other" in query:
        query["other"] = world().positive[1]


def source_here(body):
    """Scans are fetched from here."""
    body["url"] = sources.address("north.obj")


def webhook_here(body):
    """Messages may be sent to this machine."""
    body["url"] = "http://127.0.0.1:9/"


RULES = {
    "createWebhook": webhook_here,
    "fetchScan": source_here,
    "createKey": time_to_come,
    "putExpiry": time_to_come,
    "createJob": job_of_something,
    "uploadJob": options_of_form,
    "query": one_question,
    "queryByProbe": one_verdict,
    "markExamples": examples,
    "createStandard": landmarks,
    "putPoses": poses,
}
QUERY_RULES = {
    "evaluateGallery": labelled,
    "plotEvaluation": labelled,
    "measureDeviation": reference,
    "paintDeviation": reference,
    "getModelPicture": other_model,
    "listJobs": known_page,
    "listModels": known_page,
    "listKeys": known_page,
    "listWebhooks": known_page,
    "listDeliveries": known_page,
    "listAudit": known_page,
    "listBin": known_page,
    "listDuplicates": known_page,
    "listScanSets": known_page,
}
FILES = {
    "uploadScanSet": lambda body: scan_parts() + ([pose_part()] if "poses" in body else []),
    "uploadJob": lambda body: scan_parts() + ([pose_part()] if "poses" in body else []),
    "createModel": lambda body: [obj("model", "ball.obj", BALL)],
    "createStandard": lambda body: [obj("model", "ball.obj", BALL)],
    "queryByProbe": lambda body: [obj("probe", "ball.obj", BALL)],
}
CONTENT = {
    "putScan": lambda case: surfaces.content(case.path_parameters["name"]),
    "putPoseFile": lambda case: json.dumps(POSES).encode(),
}
FILE_PARTS = {"scans", "poses", "model", "probe"}


# addresses of what was made and not used
LEFT_OVER = {"createStandard": [], "createModel": [], "createWebhook": []}


def operation_id(case):
    return case.operation.definition.raw["operationId"]


def text_of(value):
    # a whole number is written as one: how a form writes 20.0 is for nobody to say
    value = int(value) if isinstance(value, float) and value.is_integer() else value
    return value if isinstance(value, str) else json.dumps(value)


@schemathesis.hook
def before_call(context, case, kwargs):
    meta = case.meta
    if meta is None:
        return
    operation = operation_id(case)

    def is_valid(location):
        return not meta.is_negative_at(location)

    if operation in IDS and is_valid(ParameterLocation.PATH):
        # calls that follow from each other keep their own ids
        if meta.phase.name != TestPhase.STATEFUL:
            case.path_parameters.update(IDS[operation]())
        elif operation in ("putScan", "fetchScan", "deleteScan"):
            # there the name of a scan set is taken for that of a scan
            case.path_parameters["name"] = "north.obj"
    # a key that is made up is refused everywhere, and signing in is for a real one
    case.headers.pop("Authorization", None)
    case.cookies.pop("visage_session", None)
    if operation == "signIn":
        case.headers["Authorization"] = f"Bearer {world().key['token']}"
    if operation == "putScan" and is_valid(ParameterLocation.PATH):
        # what is sent has to be of the format that its name says
        case.path_parameters["name"] = surfaces.made(case.path_parameters["name"])
    if operation == "fetchScan" and is_valid(ParameterLocation.PATH):
        case.path_parameters["name"] = "north.obj"
    if operation in QUERY_RULES and is_valid(ParameterLocation.QUERY):
        QUERY_RULES[operation](case.query)
    if is_valid(ParameterLocation.HEADER) and "Idempotency-Key" in case.headers:
        # a key stands for one content
        case.headers["Idempotency-Key"] = str(uuid.uuid4())
    if is_valid(ParameterLocation.HEADER):
        # tags are given out: one that no answer had matches nothing
        case.headers.pop("If-Match", None)
        if "If-None-Match" in case.headers:
            case.headers["If-None-Match"] = '"unknown"'
    if operation == "createUpload" and is_valid(ParameterLocation.HEADER):
        # a size that is allowed, and a name that is there and tells a format
        case.headers["Upload-Length"] = str(len(BALL))
        case.headers["Upload-Metadata"] = upload_metadata("new.obj")
    if operation == "sendPiece":
        if is_valid(ParameterLocation.HEADER):
            # pieces begin where the last one has ended, and have their own checksum
            case.headers["Upload-Offset"] = "0"
            case.headers.pop("Upload-Checksum", None)
        # the piece itself is of no media type that is known there
        kwargs["data"] = BALL[:100]
        return
    if not is_valid(ParameterLocation.BODY) or isinstance(case.body, NotSet):
        return
    if operation in FILES and isinstance(case.body, dict):
        # bytes in a body that was changed would count as a violation: what is sent stands beside it
        body = copy.deepcopy(case.body)
        RULES.get(operation, lambda body: None)(body)
        texts = [(name, (None, text_of(value))) for name, value in body.items() if name not in FILE_PARTS]
        kwargs["files"] = FILES[operation](body) + texts
    elif operation in RULES and isinstance(case.body, dict):
        RULES[operation](case.body)
    if operation in CONTENT and is_valid(ParameterLocation.PATH):
        kwargs["data"] = CONTENT[operation](case)
        if is_valid(ParameterLocation.HEADER) and "Content-Digest" in case.headers:
            digest = base64.b64encode(hashlib.sha256(kwargs["data"]).digest()).decode()
            case.headers["Content-Digest"] = f"sha-256=:{digest}:"


@schemathesis.hook
def after_call(context, case, response):
    if not 200 <= response.status_code < 300:
        return
    operation = operation_id(case)
    with open(ANSWERED, "a", encoding="utf-8") as answered:
        print(operation, file=answered)
    # what piles up would only cost: jobs wait in a queue that has an end, standards are counted
    if operation in ("createJob", "uploadJob", "retryJob"):
        requests.post(f"{URL}/v1/jobs/{response.json()['id']}/cancel", timeout=60)
    if operation in LEFT_OVER:
        made = LEFT_OVER[operation]
        made.append(response.json()["href"])
        # the last ones stay: calls that follow from each other go on with them
        if len(made) > 8:
            requests.delete(URL + made.pop(0), timeout=60)
