"""The whole way with a client that openapi-python-client has made: upload by form, job, wait, cloud, probe, delete.

usage: flow.py URL FOLDER
FOLDER holds scans and their poses: `head/*.ply` and `head/rough.json` of `visage demo --out`.
"""

import sys
from io import BytesIO
from pathlib import Path

import httpx

from visage_client import Client
from visage_client.api.jobs import cancel_job, create_job, get_job, upload_job
from visage_client.api.models import get_model, get_model_file, get_model_poses
from visage_client.api.queries import plot_evaluation, query, query_by_probe
from visage_client.api.scan_sets import create_scan_set, delete_scan_set, upload_scan_set
from visage_client.api.scan_sets import put_pose_file, put_poses, put_scan
from visage_client.models import (
    JobOptions,
    JobStatus,
    MethodName,
    NewJobBody,
    NewJobForm,
    NewScanSetBody,
    Poses,
    ProbeForm,
    Problem,
    QueryBody,
    ScanSetForm,
    SurfaceFile,
    Unit,
)
from visage_client.types import File


def file(path):
    return File(payload=BytesIO(path.read_bytes()), file_name=path.name)


def finished(client, job):
    """The job at its end."""
    while job.status in (JobStatus.QUEUED, JobStatus.RUNNING):
        job = get_job.sync(job.id, client=client, wait=60)
    return job


def uploaded_registered_and_asked(client, scans, poses):
    form = ScanSetForm(scans=[file(scan) for scan in scans], poses=file(poses), name="head", unit=Unit.MM)
    scan_set = upload_scan_set.sync(client=client, body=form)
    assert [scan.name for scan in scan_set.scans] == [scan.name for scan in scans], scan_set
    assert scan_set.poses.scans_without_pose == [], scan_set

    job = create_job.sync(client=client, body=NewJobBody(scan_set_id=scan_set.id, label="face"))
    job = finished(client, job)
    assert job.status == JobStatus.SUCCEEDED, job
    assert job.options.method == MethodName.JOINT, job

    model = get_model.sync(job.model_id, client=client)
    cloud = get_model_file.sync(model.id, SurfaceFile.CLOUD_PLY, client=client).payload.read()
    assert cloud.startswith(b"ply\n"), cloud[:40]
    assert [asset.bytes_ for asset in model.assets if asset.name == "cloud.ply"] == [len(cloud)], model.assets
    motions = get_model_poses.sync(model.id, client=client)
    assert sorted(motions.additional_keys) == sorted(scan.name for scan in scans)
    assert all(len(rows) == 4 and len(rows[0]) == 4 for rows in motions.additional_properties.values())

    probe = ProbeForm(probe=File(payload=BytesIO(cloud), file_name="probe.ply"), unit=Unit.MM, limit=3, explain=True)
    alike = query_by_probe.sync(client=client, body=probe)
    assert (alike.matches[0].model_id, alike.matches[0].is_match) == (model.id, True), alike
    assert alike.matches[0].explain.likeness.both_faces > 0.5, alike
    faces = query.sync(client=client, body=QueryBody(standard="face", only_matches=True))
    assert model.id in [match.model_id for match in faces.matches], faces
    assert len(faces.matches[0].landmarks["nose_tip"]) == 3, faces

    # the demo has no second class: the answer is a problem, whatever the media type of the picture
    assert isinstance(plot_evaluation.sync(client=client), Problem)

    assert delete_scan_set.sync_detailed(scan_set.id, client=client).status_code == 204
    gone = get_job.sync(job.id, client=client)
    assert isinstance(gone, Problem) and gone.code == "not_found", gone


def registered_by_one_form(client, scans, poses):
    options = JobOptions(threads=1, reference=scans[1].name)
    form = NewJobForm(scans=[file(scan) for scan in scans[:2]], poses=file(poses), options=options, label="face")
    job = upload_job.sync(client=client, body=form)
    assert (job.options.threads, job.options.reference) == (1, scans[1].name), job
    cancel_job.sync(job.id, client=client)
    finished(client, job)
    assert delete_scan_set.sync_detailed(job.scan_set_id, client=client).status_code == 204


def stored_one_by_one(client, scans, poses):
    scan_set = create_scan_set.sync(client=client, body=NewScanSetBody(name="one by one"))
    for scan in scans[:2]:
        stored = put_scan.sync(scan_set.id, scan.name, client=client, body=file(scan))
        assert (stored.name, stored.bytes_) == (scan.name, scan.stat().st_size), stored
    assert put_pose_file.sync(scan_set.id, client=client, body=file(poses)).scans_without_pose == []
    identity = [[float(row == column) for column in range(4)] for row in range(4)]
    poses = Poses.from_dict({scans[0].name: identity, scans[1].name: None})
    put = put_poses.sync(scan_set.id, client=client, body=poses)
    assert put.scans_without_pose == [scans[1].name], put
    assert delete_scan_set.sync_detailed(scan_set.id, client=client).status_code == 204


def main(url, folder):
    scans = sorted((Path(folder) / "head").glob("*.ply"))
    poses = Path(folder) / "head" / "rough.json"
    assert len(scans) > 1, f"no scans in {folder}/head"
    with Client(base_url=url, timeout=httpx.Timeout(90)) as client:
        uploaded_registered_and_asked(client, scans, poses)
        registered_by_one_form(client, scans, poses)
        stored_one_by_one(client, scans, poses)
    print("openapi-python-client: all calls answered as they should")


main(*sys.argv[1:])
