//! Samples and frames of a surface are where the surface is.

use visage_geometry::{Mesh, Point3, Vector3};
use visage_shape::descriptor::{OwnFrame, SampledShape};
use visage_synthetic::shapes;

#[test]
fn samples_and_frames_are_where_the_surface_is() {
    let ball = shapes::catalogue().iter().find(|shape| shape.name == "sphere").expect("it is there").mesh(1);
    let middle = ball.bounds().expect("it has vertices").center();
    let radius = ball.vertices.iter().map(|p| (p - middle).norm()).sum::<f64>() / ball.vertices.len() as f64;
    let stretched = |p: &Point3| {
        let own = (p - middle) / radius;
        Point3::new(30.0 * own.x + 500.0, 20.0 * own.y - 70.0, 10.0 * own.z)
    };
    let egg = Mesh { vertices: ball.vertices.iter().map(stretched).collect(), faces: ball.faces.clone() };
    let shape = SampledShape::of_mesh(&egg).expect("it has an area");
    let [surface, normals] = &shape.whole;
    assert!((surface.center - Point3::new(500.0, -70.0, 0.0)).norm() < 0.5, "{surface:?}");
    assert_eq!((surface.center, surface.size), (normals.center, normals.size));
    assert!(surface.axes[(0, 0)].abs() > 0.999 && surface.moments.is_sorted_by(|a, b| a >= b));
    let on_it = |p: &Point3| {
        let own = p - Vector3::new(500.0, -70.0, 0.0);
        Vector3::new(own.x / 30.0, own.y / 20.0, own.z / 10.0).norm()
    };
    assert!(shape.points.iter().all(|p| (on_it(p) - 1.0).abs() < 0.05));
    // about half of it is seen, on the side of the viewer
    assert_eq!(shape.views.len(), 20);
    let beside = |view: &OwnFrame| (view.center - surface.center).norm();
    assert!(shape.views.iter().all(|view| (3.0..25.0).contains(&beside(view)) && view.size < 1.1 * surface.size));
}
