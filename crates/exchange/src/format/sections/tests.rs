#![allow(clippy::unwrap_used)]
use super::*;
use lacuna_kernel::budget::Budget;
use lacuna_kernel::measure::section::{PlaneFrame, Polygon, SectionError, sections, signed_area_mm2};
use lacuna_kernel::solid::{Solid, TriMesh};

const HOSTILE: &str = "a <b> & \"c\"]]>\n0\nEOF\r\u{0}\u{7}\u{1b}\u{fffe} d\u{e9}j\u{e0} \u{1f600} -->";

fn square(centre: [f64; 2], half: f64, turn: f64) -> Vec<DVec2> {
    [[-1.0, -turn], [1.0, -turn], [1.0, turn], [-1.0, turn]]
        .map(|corner| DVec2::from_array(centre) + half * DVec2::from_array(corner))
        .to_vec()
}

fn written(format: Format, bounds: [DVec3; 2], title: Option<&str>, all: &[Section]) -> String {
    let mut bytes = Vec::new();
    let offsets: Vec<f64> = all.iter().map(|section| section.offset_mm).collect();
    let mut file = SectionFile::start(format, &mut bytes, bounds, &offsets, &Metadata { title, ..Metadata::default() }).unwrap();
    all.iter().for_each(|section| file.push(section).unwrap());
    file.finish().unwrap();
    String::from_utf8(bytes).unwrap()
}

/// The name of a group, and the data of its paths.
type Group = (String, Vec<String>);

/// (attributes of the root, groups, title). Fails on what is not XML.
fn read_svg(text: &str) -> (BTreeMap<String, String>, Vec<Group>, String) {
    use quick_xml::events::Event;
    let mut reader = quick_xml::Reader::from_str(text);
    let (mut root, mut groups, mut title, mut open) = (BTreeMap::new(), Vec::new(), String::new(), Vec::new());
    loop {
        match reader.read_event().unwrap() {
            Event::Eof => break,
            Event::Start(start) | Event::Empty(start) if start.name().as_ref() == "path" => {
                let data = start.attributes().map(Result::unwrap).find(|one| one.key.as_ref() == "d").unwrap();
                let (_, paths): &mut Group = groups.last_mut().unwrap();
                paths.push(data.value.to_string());
            }
            Event::Start(start) => {
                let name = start.name().as_ref().to_owned();
                let attributes: BTreeMap<String, String> =
                    start.attributes().map(Result::unwrap).map(|one| (one.key.as_ref().to_owned(), one.value.to_string())).collect();
                match name.as_str() {
                    "svg" => root = attributes,
                    "g" => groups.extend(attributes.get("id").map(|id| (id.clone(), Vec::new()))),
                    _ => {}
                }
                open.push(name);
            }
            Event::End(_) => drop(open.pop().unwrap()),
            Event::Text(words) if open.last().is_some_and(|name| name == "title") => title.push_str(words.as_ref()),
            Event::GeneralRef(name) if open.last().is_some_and(|name| name == "title") => title.push_str(&format!("&{};", &*name)),
            _ => {}
        }
    }
    assert!(open.is_empty());
    (root, groups, title)
}

/// The loops of a path, v upwards.
fn loops_of_path(path: &str) -> Vec<Vec<DVec2>> {
    let point = |words: &str| {
        let (x, y) = words.split_once(' ').unwrap();
        DVec2::new(x.parse().unwrap(), -y.parse::<f64>().unwrap())
    };
    let closed = path.strip_suffix('z').unwrap().split('z');
    closed.map(|one| one.strip_prefix('M').unwrap().split('L').map(point).collect()).collect()
}

/// The pairs (code, value) of a DXF file.
fn pairs(text: &str) -> Vec<(u32, &str)> {
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len() % 2, 0);
    lines.chunks(2).map(|pair| (pair[0].parse().unwrap(), pair[1])).collect()
}

/// (layer, points with heights) of each polyline.
fn polylines(text: &str) -> Vec<(String, Vec<DVec3>)> {
    let mut found: Vec<(String, Vec<DVec3>)> = Vec::new();
    let pairs = pairs(text);
    let entities = pairs.iter().position(|pair| *pair == (2, "ENTITIES")).unwrap();
    let (mut kind, mut count, mut height) = ("", 0, 0.0);
    for &(code, value) in &pairs[entities + 1..] {
        let last = found.last_mut();
        match (code, kind) {
            (0, _) => {
                kind = value;
                if kind == "ENDSEC" {
                    break;
                }
                assert_eq!(kind, "LWPOLYLINE");
                found.push(Default::default());
            }
            (8, _) => last.unwrap().0 = value.to_owned(),
            (70, _) => assert_eq!(value, "1", "not closed"),
            (90, _) => count = value.parse().unwrap(),
            (38, _) => height = value.parse().unwrap(),
            (10, _) => last.unwrap().1.push(DVec3::new(value.parse().unwrap(), 0.0, height)),
            (20, _) => {
                let points = &mut last.unwrap().1;
                points.last_mut().unwrap().y = value.parse().unwrap();
                assert!(points.len() <= count);
            }
            _ => {}
        }
    }
    assert_eq!((pairs[entities - 1], pairs[pairs.len() - 1]), ((0, "SECTION"), (0, "EOF")));
    found
}

/// Sections of an octahedron with odd coordinates, and of a frame with an island.
fn examples() -> ([DVec3; 2], Vec<Section>) {
    let corners = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let vertices: Vec<DVec3> = corners.map(|corner| corner * 1.1 + DVec3::new(0.3, 1e-7, -1.0 / 3.0)).to_vec();
    let triangles = (0..4).flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]]).collect();
    let solid = Solid::new(TriMesh { vertices: vertices.clone(), triangles }, &Budget::default()).unwrap();
    let frame = PlaneFrame::new(DVec3::new(1.0, 2.0, 3.0)).unwrap();
    let mut all = Vec::new();
    sections::<SectionError>(&solid, &frame, &[-0.7, 0.1, 0.1, 5.0, -0.0], &Budget::default(), &mut |section| {
        all.push(section);
        Ok(())
    })
    .unwrap();
    let ring = Polygon { outer: square([0.5, 0.5], 0.5, 1.0), holes: vec![square([0.5, 0.5], 0.3, -1.0)] };
    let island = Polygon { outer: square([0.5, 0.5], 0.1, 1.0), holes: vec![] };
    all.push(Section { offset_mm: 1e-13 / 3.0, polygons: vec![ring, island], unmatched: vec![square([1.0, 0.0], 1e-7 / 3.0, -1.0)] });
    (frame.bounds(&vertices).unwrap(), all)
}

#[test]
fn svg_carries_every_loop_bit_for_bit() {
    let (bounds, all) = examples();
    let (root, groups, title) = read_svg(&written(Format::Svg, bounds, None, &all));
    let size = bounds[1] - bounds[0];
    assert_eq!((root["width"].clone(), root["height"].clone()), (format!("{}mm", size.x), format!("{}mm", size.y)));
    assert_eq!(root["viewBox"], format!("{} {} {} {}", bounds[0].x, -bounds[1].y, size.x, size.y));
    assert_eq!(title, "sections");
    let names: Vec<&str> = groups.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names[..5], ["z_-0.700", "z_0.100", "z_0.100_2", "z_5.000", "z_0.000"]);
    assert_eq!(names[5].strip_prefix("z_").unwrap().parse::<f64>().unwrap(), all[5].offset_mm);
    for ((_, paths), section) in groups.iter().zip(&all) {
        assert_eq!(paths.len(), section.polygons.len() + section.unmatched.len());
        let loops: Vec<Vec<DVec2>> = paths.iter().flat_map(|path| loops_of_path(path)).collect();
        assert!(loops.iter().map(Vec::as_slice).eq(section.loops()));
        assert_eq!(loops.iter().map(|points| signed_area_mm2(points)).sum::<f64>(), section.area_mm2());
    }
    assert_eq!(groups.iter().map(|(_, paths)| paths.len()).collect::<Vec<_>>(), [1, 1, 1, 0, 1, 3]);
    assert_eq!(loops_of_path(&groups[5].1[0]).len(), 2);
}

#[test]
fn dxf_carries_every_loop_bit_for_bit() {
    let (bounds, all) = examples();
    let text = written(Format::Dxf, bounds, None, &all);
    let found = polylines(&text);
    let wanted: Vec<_> = all.iter().flat_map(|section| section.loops().map(|points| (section.offset_mm, points))).collect();
    assert_eq!(found.len(), wanted.len());
    for ((_, points), (offset, wanted)) in found.iter().zip(wanted) {
        assert!(points.iter().copied().eq(wanted.iter().map(|point| point.extend(offset))));
    }
    let layers: Vec<&str> = found.iter().map(|(layer, _)| layer.as_str()).collect();
    assert_eq!(layers, ["Z_-0_700", "Z_0_100", "Z_0_100", "Z_0_000", "SECTION_5", "SECTION_5", "SECTION_5", "SECTION_5"]);
    assert!(text.is_ascii() && text.contains("$ACADVER\n1\nAC1015\n") && text.contains("$INSUNITS\n70\n4\n"));
    // Every layer is listed once, and every handle is one thing's.
    let pairs_of = |code: u32| pairs(&text).into_iter().filter(move |pair| pair.0 == code).map(|pair| pair.1);
    let listed: Vec<&str> = pairs_of(2).filter(|name| layers.contains(name) || name.starts_with("SECTION_")).collect();
    assert_eq!(listed, ["Z_-0_700", "Z_0_100", "Z_0_000", "SECTION_5"]);
    let mut handles: Vec<u64> =
        pairs_of(5).filter(|handle| *handle != "FFFFFFFF").map(|handle| u64::from_str_radix(handle, 16).unwrap()).collect();
    handles.sort_unstable();
    assert!(handles.windows(2).all(|pair| pair[0] < pair[1]), "{handles:?}");
    let high = pairs(&text).into_iter().skip_while(|pair| pair.1 != "$EXTMAX").nth(1).unwrap();
    assert_eq!((high.0, high.1.parse::<f64>().unwrap()), (10, bounds[1].x));
}

#[test]
fn titles_cannot_leave_their_place() {
    let (bounds, all) = examples();
    let plain = written(Format::Svg, bounds, None, &all);
    let svg = written(Format::Svg, bounds, Some(HOSTILE), &all);
    let (_, groups, title) = read_svg(&svg);
    assert_eq!(groups, read_svg(&plain).1);
    assert!(title.starts_with("a &lt;b&gt; &amp; &quot;c&quot;]]&gt; 0 EOF ") && title.contains("d\u{e9}j\u{e0} \u{1f600}"), "{title}");
    assert!(!svg.chars().any(|letter| letter.is_control() && letter != '\n') && !svg.contains('\u{fffe}'));
    let dxf = written(Format::Dxf, bounds, Some(HOSTILE), &all);
    assert_eq!(polylines(&dxf), polylines(&written(Format::Dxf, bounds, None, &all)));
    let long = "x\u{e9}\n".repeat(1000);
    for (title, start) in [(HOSTILE, "a <b> & \"c\"]]> 0 EOF    "), (&long, "x\\U+00E9 x\\U+00E9 ")] {
        let dxf = written(Format::Dxf, bounds, Some(title), &[]);
        let (code, words) = pairs(&dxf)[0];
        assert!(code == 999 && words.starts_with(start) && words.len() <= 255 && dxf.is_ascii(), "{words:?}");
        let rest = |text: &str| {
            pairs(text).iter().skip_while(|pair| pair.0 == 999).map(|&(code, value)| (code, value.to_owned())).collect::<Vec<_>>()
        };
        assert_eq!(rest(&dxf), rest(&written(Format::Dxf, bounds, None, &[])));
    }
}

#[test]
fn what_is_no_number_is_refused() {
    let (bounds, all) = examples();
    for format in [Format::Svg, Format::Dxf] {
        let start = |bounds| SectionFile::start(format, Vec::new(), bounds, &[all[5].offset_mm], &Metadata::default());
        assert!(matches!(start([bounds[0], DVec3::NAN]), Err(FormatError::NotFinite { place: Place::File, .. })));
        let mut file = start(bounds).unwrap();
        file.push(&all[5]).unwrap();
        let before = file.text.clone();
        let mut wrong = all[5].clone();
        wrong.polygons[1].outer[1].y = f64::INFINITY;
        assert!(matches!(file.push(&wrong), Err(FormatError::NotFinite { place: Place::Vertex(25), .. })));
        let wrong = Section { offset_mm: f64::NAN, ..Section::default() };
        assert!(matches!(file.push(&wrong), Err(FormatError::NotFinite { place: Place::File, .. })));
        assert!(matches!(file.push(&Section { offset_mm: 1.0, ..Section::default() }), Err(FormatError::UnknownPlane { offset_mm: 1.0 })));
        assert_eq!(file.text, before);
    }
}

/// Memory stays flat, and a sink that fails is heard.
#[test]
fn long_loops_are_handed_on_while_they_are_written() {
    struct Narrow(usize);
    impl Write for Narrow {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            assert!(bytes.len() <= CHUNK_BYTES + 4096);
            self.0 = self.0.checked_sub(1).ok_or(std::io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let outer = (0..100_000).map(|k| DVec2::from_angle(f64::from(k) * 6.28e-5)).collect();
    let section = Section { offset_mm: 0.0, polygons: vec![Polygon { outer, holes: vec![] }], unmatched: vec![] };
    for format in [Format::Svg, Format::Dxf] {
        let run = |writes| {
            let mut file = SectionFile::start(format, Narrow(writes), [DVec3::NEG_ONE, DVec3::ONE], &[0.0], &Metadata::default())?;
            file.push(&section)?;
            file.finish()
        };
        run(1000).unwrap();
        assert!(matches!(run(3), Err(FormatError::Stream(_))));
    }
}
