//! Documents of splines, schemes, products and sums: read, written, read again; and faults with their places.

use lacuna_kernel::model::{ControlNet, CurveScheme, Shape};

use crate::diagnostic::code;
use crate::document::{DocumentLimits, read_model, write_model};

fn document(shape: &str) -> String {
    format!(r#"{{"lacuna": 1, "shape": {shape}}}"#)
}

fn read(shape: &str) -> Shape {
    let text = document(shape);
    let limits = DocumentLimits::default();
    let model = read_model(text.as_bytes(), &limits).unwrap_or_else(|report| panic!("{text}: {report:?}"));
    let written = write_model(&model);
    let again = read_model(written.as_bytes(), &limits).unwrap_or_else(|report| panic!("{written}: {report:?}"));
    assert_eq!(again, model, "{written}");
    model.shape
}

#[test]
fn every_family_reads_back_as_written() {
    const LINE: &str = "[[0,0,0],[1,0,0],[1,1,0],[0,1,1],[2,2,2],[3,0,1]]";
    const NET: &str = "[[[0,0,0],[1,0,0],[2,0,0]],[[0,1,0],[1,1,3],[2,1,0]]]";
    const U: &str = r#"{"family": "bezier_curve"}"#;
    let shapes = [
        format!(r#"{{"family": "nurbs_curve", "degree": 2, "knots": [0,0,0,1,2,2.5,3,3,3], "control_points": {LINE}}}"#),
        r#"{"family": "nurbs_curve", "degree": 1, "knots": [0,0,1,1], "control_points": [[0,0,0,2],[1,0,0]]}"#.to_owned(),
        format!(r#"{{"family": "nurbs_surface", "degree": 1, "knots": [[0,0,1,1],[0,0,1,2,2]], "control_points": {NET}}}"#),
        format!(
            r#"{{"family": "nurbs_surface", "degree": [1,2], "knots": [[0,0,1,1],[0,0,0,1,1,1]], "control_points": {NET}, "weights": [[1,2,1],[1,3,1]]}}"#
        ),
        format!(
            r#"{{"family": "nurbs_volume", "degree": 1, "knots": [[0,0,1,1],[0,0,1,1],[0,0,1,2,2]], "control_points": [{NET},{NET}]}}"#
        ),
        format!(r#"{{"family": "bezier_surface", "control_points": {NET}}}"#),
        format!(r#"{{"family": "bezier_surface", "control_points": {NET}, "trim": {{}}}}"#),
        format!(
            r#"{{"family": "bezier_surface", "control_points": {NET}, "trim": {{
                "outer": [{{"family": "bezier_curve", "control_points": [[0,0],[1,0,0.5],[1,1]]}}, {{"family": "polyline", "points": [[1,1],[0,1],[0,0]]}}],
                "inner": [[{{"family": "nurbs_curve", "degree": 1, "knots": [0,0,1,2,2], "control_points": [[0.2,0.5],[0.3,0.6],[0.2,0.5]], "weights": [1,2,1]}}]]
            }}}}"#
        ),
        format!(r#"{{"family": "catmull_rom", "control_points": {LINE}, "parametrization": "centripetal", "closed": true}}"#),
        format!(r#"{{"family": "beta_spline", "control_points": {LINE}, "beta1": 2, "beta2": 5}}"#),
        format!(r#"{{"family": "four_point", "control_points": {LINE}, "w": 0.05}}"#),
        r#"{"family": "interpolation", "points": [[0,0,0],[1,1,0],[2,0,0]], "vertical_scaling": [0.5, -0.25]}"#.to_owned(),
        r#"{"family": "interpolation", "points": [[0,0,0],[1,0,0],[2,0,0]], "maps": [{"scale": 0.5}, {"scale": 0.5, "translation": [1,0,0]}]}"#.to_owned(),
        format!(r#"{{"family": "tensor", "u": {U}, "v": {{"family": "corner_cutting", "a": 0.3}}, "control_points": {NET}}}"#),
        format!(r#"{{"family": "tensor", "u": {U}, "v": {U}, "w": {U}, "control_points": [{NET},{NET}]}}"#),
        format!(
            r#"{{"family": "sum", "u": {{"family": "bezier_curve", "control_points": {LINE}}}, "v": {{"family": "four_point", "control_points": {LINE}}}}}"#
        ),
    ];
    for shape in shapes {
        read(&shape);
    }
    let Shape::TensorProduct(product) = read(&format!(r#"{{"family": "bezier_surface", "control_points": {NET}}}"#)) else {
        panic!("a surface")
    };
    assert_eq!(product.schemes, [CurveScheme::Bezier, CurveScheme::Bezier]);
    let ControlNet { size, points, .. } = product.control_points;
    assert_eq!((size, points[5].to_array()), (vec![2, 3], [2.0, 1.0, 0.0]));
}

#[test]
fn faults_name_their_place() {
    let cases = [
        (
            r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]], "trim": {"outer": [{"family": "four_point"}]}}"#,
            code::UNKNOWN_VALUE,
            "/shape/trim/outer/0/family",
        ),
        (
            r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]], "trim": {"inner": [[{"family": "polyline", "points": [[0,0],[1]]}]]}}"#,
            code::WRONG_LENGTH,
            "/shape/trim/inner/0/0/points/1",
        ),
        (
            r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]], "trim": {"outer": [{"family": "bezier_curve", "control_points": [[0,0],[1,0,-1]]}]}}"#,
            code::NOT_POSITIVE,
            "/shape/trim/outer/0/control_points/1/2",
        ),
        (
            r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]], "trim": {"outer": [{"family": "bezier_curve", "control_points": [[0,0],[1,0,1]], "weights": [1,1]}]}}"#,
            code::CONFLICTING_MEMBERS,
            "/shape/trim/outer/0/weights",
        ),
        (
            r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]], "trim": {"outer": [{"family": "bezier_curve", "control_points": [[0,0],[1,0]], "weights": [1]}]}}"#,
            code::WRONG_LENGTH,
            "/shape/trim/outer/0/weights",
        ),
        (
            r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,1,0],[1,1,0]]], "trim": {"holes": []}}"#,
            code::UNKNOWN_MEMBER,
            "/shape/trim/holes",
        ),
        (r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]],[[0,0,0]]]}"#, code::WRONG_LENGTH, "/shape/control_points/1"),
        (r#"{"family": "bezier_surface", "control_points": [[[0,0,0],[1,0,0]]], "weights": [[1]]}"#, code::WRONG_LENGTH, "/shape/weights"),
        (
            r#"{"family": "nurbs_surface", "degree": [2], "knots": [[0,0,1,1],[0,0,1,1]], "control_points": [[[0,0,0]]]}"#,
            code::WRONG_LENGTH,
            "/shape/degree",
        ),
        (
            r#"{"family": "tensor", "u": {"family": "mesh"}, "v": {"family": "bezier_curve"}, "control_points": [[[0,0,0]]]}"#,
            code::UNKNOWN_VALUE,
            "/shape/u/family",
        ),
        (r#"{"family": "interpolation", "points": [[0,0,0],[1,0,0],[2,0,0]]}"#, code::MISSING_MEMBER, "/shape"),
        (
            r#"{"family": "sum", "u": {"family": "bezier_curve"}, "v": {"family": "bezier_curve", "control_points": [[0,0,0]]}}"#,
            code::MISSING_MEMBER,
            "/shape/u",
        ),
    ];
    for (shape, expected, pointer) in cases {
        let report = read_model(document(shape).as_bytes(), &DocumentLimits::default()).expect_err("refused");
        assert!(format!("{report:?}").contains(expected) && format!("{report:?}").contains(&format!("{pointer}\"")), "{shape}: {report:?}");
    }
}
