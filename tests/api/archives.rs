//! Uploads that are more than one file a scan: archives, files of several scans, depth images, names of all kinds.

use std::io::Write;

use crate::common::{TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use visage::formats::e57::{WrittenScan, write_scans};
use visage::geometry::{Cloud, Motion, Point3};

const ROUTE: &str = "/v1/scan-sets/upload";

fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, content) in files {
        writer.start_file(*name, zip::write::SimpleFileOptions::default()).expect("in memory");
        writer.write_all(content).expect("in memory");
    }
    writer.finish().expect("in memory").into_inner()
}

fn form(files: &[(&str, &[u8])]) -> Form {
    files.iter().fold(Form::new(), |form, (name, content)| {
        form.part("scans", Part::bytes(content.to_vec()).file_name((*name).to_owned()))
    })
}

/// Scans of some points around different places, with poses a metre apart.
fn e57(names: &[&str]) -> Vec<u8> {
    let cloud = |k: usize| {
        let points = (0..60).map(|i| Point3::new(f64::from(i) * 0.1, (f64::from(i) * 0.7).sin(), k as f64 + 1e-9));
        Cloud { colors: Some(vec![[k as u8, 2, 3]; 60]), ..Cloud::from_points(points.collect()) }
    };
    let clouds: Vec<Cloud> = (0..names.len()).map(cloud).collect();
    let poses: Vec<Motion> = (0..names.len()).map(|k| Motion::translation(k as f64, 0.0, 0.0)).collect();
    let scan = |((name, cloud), pose)| WrittenScan { name, cloud, grid: None, world_from_scan: Some(pose) };
    write_scans(&names.iter().copied().zip(&clouds).zip(&poses).map(scan).collect::<Vec<_>>())
}

fn names(set: &Value) -> Vec<String> {
    let scans = set["scans"].as_array().expect("scans");
    scans.iter().map(|scan| text(scan, "/name")).collect()
}

#[tokio::test]
async fn an_archive_is_a_set_with_its_poses_and_what_is_no_part_of_it_is_said() {
    let server = TestServer::start().await;
    let poses = files::poses(&["a.ply".to_owned(), "side/b.ply".to_owned()]);
    let (a, b) = (files::ply(9), files::ply(11));
    let archive = zip(&[
        ("set/a.ply", &a),
        ("set/side/b.ply", &b),
        ("set/rough.json", poses.as_bytes()),
        ("set/readme.md", b"two scans"),
        ("set/photo.jpg", b"\xff\xd8"),
        ("__MACOSX/set/._a.ply", b"no scan"),
        ("../out.ply", &a),
    ]);
    let (c, archive) = (files::ply(5), archive.as_slice());
    let response = server.post_form(ROUTE, form(&[("turn table.zip", archive), ("c.ply", &c)])).await;
    let set = expect_json(response, StatusCode::CREATED).await;
    assert_eq!(names(&set), ["a.ply", "c.ply", "side/b.ply"]);
    assert_eq!((&set["poses"]["file"], &set["poses"]["count"]), (&json!("rough.json"), &json!(2)));
    assert_eq!(set["poses"]["scans_without_pose"], json!(["c.ply"]));
    let passed: Vec<String> =
        set["passed_over"].as_array().expect("a list").iter().map(|file| text(file, "/file")).collect();
    let expected = ["../out.ply", "__MACOSX/set/._a.ply", "photo.jpg", "readme.md"];
    assert_eq!(passed, expected.map(|file| format!("{file} in turn table.zip")));
    assert_eq!(set["passed_over"][0]["why"], "leads out of the archive");
    assert_eq!(set["scans"][2]["checksum"], blake3::hash(&b).to_hex().to_string());
    assert_eq!(expect_json(server.get(&text(&set, "/links/self")).await, StatusCode::OK).await, set);
    assert_eq!((server.files("scan-sets"), server.files("staging")), (3, 0), "nothing else is kept");
    // the scans of folders are addressed by their paths
    let scan = format!("{}/scans/side%2Fb.ply", text(&set, "/links/self"));
    assert_eq!(server.put(&scan, files::ply(12)).await.status(), StatusCode::OK);
    assert_eq!(server.delete(&scan).await, StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn each_scan_of_an_e57_file_is_one_of_the_set_and_starts_from_its_pose() {
    let server = TestServer::start().await;
    let (room, other) = (e57(&["door", "a/b"]), files::ply(60));
    let set = expect_json(
        server.post_form(ROUTE, form(&[("room.e57", &room), ("x.ply", &other)])).await,
        StatusCode::CREATED,
    );
    let set = set.await;
    assert_eq!(names(&set), ["door.e57", "room.e57#1.e57", "x.ply"]);
    // one by one they are sent alone
    let place = format!("{}/scans", text(&set, "/links/self"));
    let problem =
        expect_problem(server.put(&format!("{place}/more.e57"), room.clone()).await, 422, "several_scans").await;
    assert!(text(&problem, "/detail").contains("holds 2 scans"), "{problem}");
    assert!(text(&problem, "/hint").contains("POST /v1/scan-sets/upload"), "{problem}");
    let alone = server.put(&format!("{place}/alone.e57"), e57(&["alone"])).await;
    assert_eq!(alone.status(), StatusCode::CREATED);
    assert_eq!(server.delete(&format!("{place}/alone.e57")).await, StatusCode::NO_CONTENT);
    assert_eq!((&set["scans"][0]["points"], &set["scans"][0]["reading"]), (&json!(60), &Value::Null));
    assert_eq!(set["poses"]["scans_without_pose"], json!(["x.ply"]));
    // they are registered as they are in the file
    let job = server.post("/v1/jobs", &json!({"scan_set_id": text(&set, "/id")})).await;
    let job = server.finished(&text(&expect_json(job, StatusCode::ACCEPTED).await, "/id")).await;
    let poses = server.get(&format!("/v1/models/{}/poses.json", text(&job, "/model_id"))).await;
    let poses = expect_json(poses, StatusCode::OK).await;
    assert_eq!((&poses["door.e57"][0][3], &poses["room.e57#1.e57"][0][3]), (&json!(0.0), &json!(1.0)));
    // poses that are sent win; a file of one scan stays what it is
    let one = e57(&["alone"]);
    let line = "1 0 0 7 0 1 0 0 0 0 1 0\n";
    let sent = form(&[("room.e57", &room), ("one.e57", &one)]).part("poses", Part::text(line.repeat(3)));
    let set = expect_json(server.post_form(ROUTE, sent).await, StatusCode::CREATED).await;
    assert_eq!(names(&set), ["door.e57", "one.e57", "room.e57#1.e57"]);
    assert_eq!((set["poses"]["file"].as_str(), &set["poses"]["scans_without_pose"]), (Some("poses"), &json!([])));
    assert_eq!(set["scans"][1]["checksum"], blake3::hash(&one).to_hex().to_string());
}

#[tokio::test]
async fn poses_that_files_tell_are_converted_with_their_scans() {
    let server = TestServer::start().await;
    let room = e57(&["door", "wall"]);
    let pose = async |units: Value| {
        let sent = form(&[("room.e57", &room)]).text("unit", "mm");
        let set = expect_json(server.post_form(ROUTE, sent).await, StatusCode::CREATED).await;
        let order = json!({"scan_set_id": text(&set, "/id"), "hints": {"units": units}});
        let job = expect_json(server.post("/v1/jobs", &order).await, StatusCode::ACCEPTED).await;
        let job = server.finished(&text(&job, "/id")).await;
        let poses = server.get(&format!("/v1/models/{}/poses.json", text(&job, "/model_id"))).await;
        expect_json(poses, StatusCode::OK).await["wall.e57"].clone()
    };
    // what is given counts: all numbers are millimetres
    assert_eq!(pose(json!({})).await[0], json!([1.0, 0.0, 0.0, 1.0]));
    // a scan in metres stands a metre away, and its matrix maps the file
    assert_eq!(pose(json!({"door.e57": "m", "wall.e57": "m"})).await[0], json!([1000.0, 0.0, 0.0, 1000.0]));
}

/// A picture of two by two pixels: red, green, blue, white.
fn texture() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(png::ColorType::Rgb);
    let data = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    encoder.write_header().expect("a header").write_image_data(&data).expect("data");
    bytes
}

#[tokio::test]
async fn an_obj_file_has_the_colours_of_its_materials_and_pictures() {
    let server = TestServer::start().await;
    let grid = |columns: usize| {
        let corners = (0..6 * columns).map(|k| (k % columns, k / columns));
        let vertices: String = corners
            .map(|(x, y)| {
                let z = (x as f64).sin() + (y as f64).cos();
                format!("v {x} {y} {z}\nvt {} {}\n", 0.1 + 0.8 * f64::from(x > 3), 0.9 - 0.8 * f64::from(y > 2))
            })
            .collect();
        let faces: String = (0..5 * (columns - 1))
            .map(|k| 1 + k % (columns - 1) + k / (columns - 1) * columns)
            .map(|a| format!("f {a}/{a} {b}/{b} {c}/{c}\n", b = a + 1, c = a + columns))
            .collect();
        format!("mtllib skin.mtl\n{vertices}usemtl skin\n{faces}")
    };
    let (a, b) = (grid(8), grid(9));
    let packed = visage::formats::packed::pack(b.as_bytes());
    let (materials, picture) = (b"newmtl skin\nKd 1 1 1\nmap_Kd maps/skin.png\n".as_slice(), texture());
    let archive = zip(&[
        ("set/b/maps/skin.png", &picture),
        ("set/b/maps/other.png", &picture),
        ("set/photo.jpg", b"\xff\xd8"),
        ("set/b/b.obj.gz", &packed),
        ("set/a.obj", a.as_bytes()),
        ("set/b/skin.mtl", materials),
    ]);
    let set = expect_json(server.post_form(ROUTE, form(&[("set.zip", &archive)])).await, StatusCode::CREATED).await;
    assert_eq!(names(&set), ["a.obj", "b/b.obj.gz"]);
    let passed: Vec<String> =
        set["passed_over"].as_array().expect("a list").iter().map(|file| text(file, "/file")).collect();
    assert_eq!(passed, ["b/maps/other.png in set.zip", "photo.jpg in set.zip"]);
    // what is above the folder of a file is not its own
    let notes = &set["scans"][0]["reading"]["notes"];
    assert!(text(notes, "/0").starts_with("colours: the materials \"skin.mtl\" are not there"), "{notes}");
    assert_eq!((&set["scans"][1]["reading"]["colors"], &set["scans"][1]["points"]), (&json!(1), &json!(54)));
    let checksum = text(&set, "/scans/1/checksum");
    let files = std::fs::read_dir(server.folder.path().join("scan-sets").join(text(&set, "/id"))).expect("a folder");
    let stored = files.map(|file| std::fs::read(file.expect("an entry").path()).expect("a file"));
    let stored = stored.into_iter().find(|file| blake3::hash(file).to_hex().as_str() == checksum).expect("it is kept");
    let limits = visage::formats::ReadLimits::default();
    let read = visage::formats::read_surface("b.obj.gz", &stored, &limits).expect("what is stored is sound");
    let colors = read.cloud.colors.expect("those of the picture");
    assert_eq!((colors[0], colors[8], colors[53], read.faces.len()), ([255, 0, 0], [0, 255, 0], [0; 3], 40));
    assert_eq!(read.cloud.points[9], Point3::new(0.0, 1.0, 1f64.cos()));
}

/// A depth image of 8 x 6 pixels at a metre.
fn depth_png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = (0..48).flat_map(|_| 1000u16.to_be_bytes()).collect();
    encoder.write_header().expect("a header").write_image_data(&data).expect("data");
    bytes
}

#[tokio::test]
async fn depth_images_with_intrinsics_become_scans() {
    let server = TestServer::start().await;
    let png = depth_png();
    let camera = b"{\"width\": 8, \"height\": 6, \"fx\": 8, \"fy\": 8, \"cx\": 3.5, \"cy\": 2.5}".as_slice();
    let poses = b"0.5 0 0 0 0 0 0 1\n1.5 1 0 0 0 0 0 1\n".as_slice();
    let layout = [("r/depth/9.png", png.as_slice()), ("r/depth/10.png", &png), ("r/camera_intrinsic.json", camera)];
    let archive = zip(&[&layout[..], &[("r/trajectory.txt", poses), ("r/notes.md", b"x")]].concat());
    let set = server.post_form(ROUTE, form(&[("r.zip", &archive)])).await;
    let set = expect_json(set, StatusCode::CREATED).await;
    assert_eq!(names(&set), ["depth/9.e57", "depth/10.e57"]);
    assert_eq!((&set["scans"][0]["points"], &set["poses"]["count"]), (&json!(48), &json!(2)));
    assert_eq!(set["passed_over"][0]["file"], "notes.md in r.zip");
    let without = zip(&[("depth/9.png", &png), ("depth.txt", b"9.0 depth/9.png\n")]);
    let refused = server.post_form(ROUTE, form(&[("r.zip", &without)])).await;
    let problem = expect_problem(refused, 422, "unreadable_scan").await;
    assert!(text(&problem, "/detail").starts_with("depth/9.png in r.zip: "), "{problem}");
    assert!(text(&problem, "/hint").contains("camera_intrinsic.json"), "{problem}");
}

/// The files of an archive, and how it is refused: status, code, a part of the detail.
type Refused<'a> = (&'a [(&'a str, &'a [u8])], u16, &'a str, &'a str);

#[tokio::test]
async fn archives_keep_the_limits_and_are_refused_whole() {
    let server = TestServer::start_with(|config| {
        config.limits.scans_per_set = 3;
        config.limits.file_bytes = 5_000;
        config.limits.upload_bytes = 12_000;
        config.limits.points_per_scan = 100;
    })
    .await;
    let (scan, large, many) = (files::ply(9), vec![b' '; 5_001], files::ply(101));
    let padded = [&files::ply(9)[..], &[b'\n'; 4_000]].concat();
    let cases: [Refused; 7] = [
        (
            &[("a.ply", &scan), ("b.ply", &scan), ("c.ply", &scan), ("d.ply", &scan)],
            422,
            "too_many_scans",
            "4 scans came",
        ),
        (&[("a.ply", &scan), ("b.ply", &large)], 413, "too_large", "a file of the archive has 5001 bytes"),
        (&[("a.ply", &padded), ("b.ply", &padded), ("c.ply", &padded)], 413, "too_large", "unpacked, the archive has"),
        (&[("s/a.ply", &many), ("s/b.ply", &scan)], 422, "too_many_points", "a.ply in s.zip: "),
        (&[("a.ply", &scan), ("A.PLY", &scan)], 422, "unreadable_scan", "two files in the archive are named"),
        (&[("a.ply", b"no scan"), ("b.ply", &scan)], 422, "unreadable_scan", "a.ply in s.zip: "),
        (&[("a.md", b"x")], 422, "unreadable_scan", "none of its 1 files is a scan"),
    ];
    for (entries, status, code, detail) in cases {
        let refused = server.post_form(ROUTE, form(&[("s.zip", &zip(entries))])).await;
        let problem = expect_problem(refused, status, code).await;
        assert!(text(&problem, "/detail").contains(detail), "{problem}");
    }
    // what several archives unpack to is counted together
    let two = zip(&[("a.ply", &padded), ("b.ply", &scan)]);
    let other = zip(&[("c.ply", &padded)]);
    let sum = server.post_form(ROUTE, form(&[("s.zip", &two), ("t.zip", &other)])).await;
    assert_eq!(expect_json(sum, StatusCode::CREATED).await["scans"].as_array().map(Vec::len), Some(3));
    let more = zip(&[("c.ply", &padded), ("d.md", &[b'x'; 4_000])]);
    let sum = server.post_form(ROUTE, form(&[("s.zip", &two), ("t.zip", &more)])).await;
    expect_problem(sum, 413, "too_large").await;
    expect_problem(server.post_form(ROUTE, form(&[("s.zip", b"PK no zip")])).await, 422, "unreadable_scan").await;
    let set = server.post("/v1/scan-sets", &json!({})).await;
    let set = text(&expect_json(set, StatusCode::CREATED).await, "/links/self");
    let put = server.put(&format!("{set}/scans/s.zip"), zip(&[("a.ply", &scan)])).await;
    expect_problem(put, 422, "unsupported_format").await;
    assert_eq!((server.files("staging"), server.files("scan-sets")), (0, 3));
}

#[tokio::test]
async fn a_job_of_one_archive_is_repeated_by_its_key_alone() {
    let server = TestServer::start().await;
    let (a, b) = (files::ply(9), files::ply(11));
    let archive = zip(&[("a.ply", &a), ("b.ply", &b)]);
    let send = || {
        let request = server.client.post(server.url("/v1/jobs/upload")).header("idempotency-key", "one");
        request.multipart(form(&[("s.zip", &archive)])).send()
    };
    let first = expect_json(send().await.expect("an answer"), StatusCode::ACCEPTED).await;
    let again = expect_json(send().await.expect("an answer"), StatusCode::ACCEPTED).await;
    assert_eq!(first["id"], again["id"]);
    assert_eq!(server.files("scan-sets"), 2);
}

#[tokio::test]
async fn names_come_in_many_ways_and_those_that_are_one_on_some_disk_are_refused() {
    let server = TestServer::start().await;
    let scan = String::from_utf8(files::ply(9)).expect("text");
    let head = |name: &str| format!("--b\r\ncontent-disposition: form-data; name=\"scans\"; {name}\r\n\r\n{scan}\r\n");
    let parts = [
        "filename=\"b_ste.ply\"; filename*=UTF-8''b%C3%BCste.ply",
        "filename=\"=?UTF-8?B?w6kucGx5?=\"",
        "filename=\"a/scan.ply\"",
        "filename=\"b/scan.ply\"",
    ];
    let body: String = parts.iter().map(|name| head(name)).chain(["--b--\r\n".to_owned()]).collect();
    let request = server.client.post(server.url(ROUTE)).header("content-type", "multipart/form-data; boundary=b");
    let set = expect_json(request.body(body).send().await.expect("an answer"), StatusCode::CREATED).await;
    let mut found = names(&set);
    found.sort();
    assert_eq!(found, ["a/scan.ply", "b/scan.ply", "b\u{fc}ste.ply", "\u{e9}.ply"]);
    let content = scan.as_bytes();
    for (first, second) in [("b\u{fc}ste.ply", "bu\u{308}ste.ply"), ("A.ply", "a.PLY"), ("x/a.ply", "X/a.ply")] {
        let refused = server.post_form(ROUTE, form(&[(first, content), (second, content)])).await;
        assert_eq!(expect_problem(refused, 422, "duplicate_scan").await["scan"], second);
    }
    // also when only one of them was packed
    let archive = zip(&[("A.ply", content)]);
    let refused = server.post_form(ROUTE, form(&[("s.zip", &archive), ("a.ply", content)])).await;
    expect_problem(refused, 422, "duplicate_scan").await;
    let put = server.put(&format!("{}/scans/B%C3%9CSTE.ply", text(&set, "/links/self")), scan.clone()).await;
    expect_problem(put, 422, "duplicate_scan").await;
}

#[tokio::test]
async fn tiles_of_land_start_where_they_are() {
    let server = TestServer::start().await;
    let tile = visage::formats::las::write_cloud(&Cloud::from_points(
        (0..60).map(|i| Point3::new(500_000.0 + f64::from(i), 4_500_000.0, f64::from(i % 7))).collect(),
    ));
    let set = server.post_form(ROUTE, form(&[("a.las", &tile), ("b.las", &tile), ("c.ply", &files::ply(60))])).await;
    let set = expect_json(set, StatusCode::CREATED).await;
    assert_eq!((&set["poses"]["count"], &set["poses"]["scans_without_pose"]), (&json!(2), &json!(["c.ply"])));
}

#[tokio::test]
async fn a_file_of_too_many_scans_is_refused() {
    let server = TestServer::start_with(|config| config.limits.scans_per_set = 3).await;
    let four = e57(&["a", "b", "c", "d"]);
    let refused = server.post_form(ROUTE, form(&[("room.e57", &four)])).await;
    assert!(text(&expect_problem(refused, 422, "too_many_scans").await, "/detail").starts_with("4 scans came"));
    assert_eq!(server.files("staging"), 0);
}
