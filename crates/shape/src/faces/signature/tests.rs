use super::example::example;
use super::*;
use crate::descriptor::VIEW_BYTES;
use proptest::prelude::*;

#[test]
fn bytes_round_trip() {
    let signature = example(0.3, 10);
    let bytes = signature.to_bytes();
    assert_eq!(Signature::from_bytes(&bytes), Ok(signature));
    assert_eq!(
        bytes.len(),
        44 + 4 + 10 * 32 + 4 + 88 + 4 + 4 * (13 + MODES + 30) + 300 + 4 + ShapeDescriptor::BYTES + 4 + 2 * VIEW_BYTES
    );
}

#[test]
fn far_from_the_origin_nothing_is_lost() {
    let far = Point3::new(4.5e6, -7.1e6, 1.0e6);
    let region = Region { center: far, normal: Vector3::x(), strength: 1.0, mean_curvature: 0.1 };
    let size = Size { origin: far + Vector3::repeat(0.05), diagonal: 0.17, radius: 0.05, unit: Unit::M };
    let signature = Signature::new(&size, &[region], &Detection { candidates: Vec::new(), face: None });
    let back = signature.regions().next().expect("one region");
    assert!((back.center - far).norm() < 1e-8);
}

#[test]
fn the_fit_comes_back() {
    let signature = example(0.3, 3);
    let fit = signature.fit().expect("the example has one");
    let p = Point3::new(10.0, 20.0, 100.0);
    let expected = Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.2, 0.3)) * Point3::from(p.coords * 0.1);
    assert!((fit.pose.point(&p) - expected).norm() < 1e-4);
    assert!((fit.observed - 0.9).abs() < 1e-6 && (fit.weights[2] - 0.3).abs() < 1e-6);
    let landmarks = signature.landmarks().expect("the example has them");
    assert!((landmarks[7] - Point3::new(7.0, 2.0, 3.0)).norm() < 1e-5);
}

#[test]
fn other_versions_are_told_from_damage() {
    let mut bytes = example(0.3, 3).to_bytes();
    let later = Signature::VERSION + 1;
    bytes[4..8].copy_from_slice(&later.to_le_bytes());
    assert_eq!(Signature::from_bytes(&bytes), Err(SignatureError::Version { found: later }));
    bytes[0] = b'x';
    assert!(matches!(Signature::from_bytes(&bytes), Err(SignatureError::Damaged(_))));
}

#[test]
fn every_truncation_and_every_surplus_is_noticed() {
    let bytes = example(0.3, 3).to_bytes();
    for end in 0..bytes.len() {
        assert!(Signature::from_bytes(&bytes[..end]).is_err(), "{end}");
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
    assert!(Signature::from_bytes(&longer).is_err());
}

#[test]
fn numbers_that_are_none_are_refused() {
    let mut bytes = example(0.3, 3).to_bytes();
    bytes[48..52].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(matches!(Signature::from_bytes(&bytes), Err(SignatureError::Damaged(_))));
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), valid_head in any::<bool>()) {
        let mut bytes = bytes;
        if valid_head {
            bytes.splice(0..0, MAGIC.into_iter().chain(Signature::VERSION.to_le_bytes()));
        }
        let _ = Signature::from_bytes(&bytes);
    }
}
