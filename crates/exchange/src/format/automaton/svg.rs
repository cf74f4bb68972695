//! Diagrams as pictures.

use super::layout::{Box, LINE, NAME_SIZE, Rect, TEXT_SIZE, place, shortened, width_of};
use super::route::{Route, routes, samples};
use super::{Bond, Diagram, Fault, Node};
use crate::format::threemf::escape;
use lacuna_kernel::attractor::ranges;
use lacuna_kernel::model::CellKind;
use std::fmt::Write as _;

/// More than this is listed and not drawn.
const MOST_STATES: usize = 60;
const MOST_ARROWS: usize = 400;
/// Lines of a list, and letters of a line.
const MOST_LINES: usize = 400;
const LINE_LETTERS: usize = 130;
/// White space around everything.
const MARGIN: f64 = 24.0;

const INK: &str = "#222222";
const DASHED: &str = "#2b5d9b";
const RED: &str = "#c00000";
const ORANGE: &str = "#a85f00";

fn escaped(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    escape(text, &mut result);
    result
}

/// A coordinate with one digit after the point, and never a negative zero.
fn number(value: f64) -> String {
    let tenths = (value * 10.0).round() / 10.0 + 0.0;
    format!("{tenths}")
}

/// The picture: UTF-8 text of an SVG 1.1 document without scripts or references.
pub(super) fn text(diagram: &Diagram) -> String {
    if diagram.nodes.len() > MOST_STATES || diagram.arrows.len() > MOST_ARROWS {
        return list(diagram);
    }
    let boxes = place(diagram);
    let routes = routes(diagram, &boxes);
    let mut frame = Frame::default();
    boxes.iter().for_each(|one| frame.take(&one.rect));
    for route in &routes {
        frame.take(&route.place);
        samples(&route.curve).iter().for_each(|point| frame.take(&Rect::around(*point, 4.0, 4.0)));
    }
    let title = diagram.title.as_deref().map(|title| shortened(title, 80));
    if let Some(title) = &title {
        frame.low[1] -= 2.0 * LINE;
        frame.take(&Rect { left: frame.low[0], top: frame.low[1], width: width_of(title, NAME_SIZE), height: LINE });
    }
    let mut body = String::new();
    if let Some(title) = &title {
        write_text(&mut body, [frame.low[0], frame.low[1] + LINE], title, NAME_SIZE, INK, "font-weight=\"bold\"");
    }
    routes.iter().for_each(|route| arrow(&mut body, route));
    routes.iter().for_each(|route| label(&mut body, route));
    diagram.nodes.iter().zip(&boxes).for_each(|(node, one)| draw(&mut body, node, one));
    let mut bottom = frame.high[1] + 2.0 * LINE;
    legend(&mut body, &mut frame, diagram, &mut bottom);
    notes(&mut body, &mut frame, &diagram.notes, &mut bottom);
    document(diagram, &frame, &body)
}

/// What the picture covers.
struct Frame {
    low: [f64; 2],
    high: [f64; 2],
}

impl Default for Frame {
    fn default() -> Self {
        Self { low: [0.0; 2], high: [0.0; 2] }
    }
}

impl Frame {
    fn take(&mut self, rect: &Rect) {
        self.low = [self.low[0].min(rect.left), self.low[1].min(rect.top)];
        self.high = [self.high[0].max(rect.left + rect.width), self.high[1].max(rect.top + rect.height)];
    }
}

fn document(diagram: &Diagram, frame: &Frame, body: &str) -> String {
    let (left, top) = (frame.low[0] - MARGIN, frame.low[1] - MARGIN);
    let (width, height) = (frame.high[0] - left + MARGIN, frame.high[1] - top + MARGIN);
    let [left, top, width, height] = [left.floor(), top.floor(), width.ceil(), height.ceil()].map(number);
    let title = escaped(diagram.title.as_deref().unwrap_or("automaton"));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"{left} {top} {width} {height}\" \
         font-family=\"Helvetica, Arial, sans-serif\" role=\"img\">\n<title>{title}</title>\n\
         <rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
    )
}

fn write_text(body: &mut String, [x, y]: [f64; 2], text: &str, size: f64, colour: &str, more: &str) {
    let (x, y) = (number(x), number(y));
    let _ = writeln!(body, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"{colour}\" {more}>{}</text>", escaped(text));
}

fn stroke(bond: Bond) -> (&'static str, &'static str) {
    match bond {
        Bond::Transition => (INK, ""),
        Bond::Boundary => (DASHED, " stroke-dasharray=\"5 4\""),
    }
}

/// A curve with its head: a triangle of its own, because programs disagree on the direction of SVG's markers.
fn arrow(body: &mut String, route: &Route) {
    let (colour, dashes) = stroke(route.bond);
    let text = |point: &[f64; 2]| format!("{} {}", number(point[0]), number(point[1]));
    let points: Vec<String> = route.curve.iter().map(text).collect();
    let letter = if points.len() == 4 { "C" } else { "Q" };
    let _ = writeln!(
        body,
        "<path d=\"M{} {letter}{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.3\"{dashes}/>",
        points[0],
        points[1..].join(" ")
    );
    let (tip, before) = (route.curve[points.len() - 1], route.curve[points.len() - 2]);
    let along = [tip[0] - before[0], tip[1] - before[1]];
    let length = along[0].hypot(along[1]).max(1e-9);
    let [x, y] = along.map(|part| part / length);
    let corner = |side: f64| text(&[tip[0] - 9.0 * x - side * y, tip[1] - 9.0 * y + side * x]);
    let _ = writeln!(body, "<path d=\"M{} L{} L{} z\" fill=\"{colour}\"/>", text(&tip), corner(3.5), corner(-3.5));
}

/// A label on white, so that it can be read where it stands on a line.
fn label(body: &mut String, route: &Route) {
    let Rect { left, top, width, height } = route.place;
    let [x, y, w, h] = [left, top + 1.0, width, height - 2.0].map(number);
    let _ = writeln!(body, "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"#ffffff\" fill-opacity=\"0.9\"/>");
    let place = [left + 0.5 * width, top + 0.5 * height + 0.36 * TEXT_SIZE];
    write_text(body, place, &route.label, TEXT_SIZE, stroke(route.bond).0, "text-anchor=\"middle\"");
}

fn colours(node: &Node) -> (&'static str, &'static str) {
    match node.kind {
        _ if node.faults.iter().any(|fault| !fault.warning) => (RED, "#fdecec"),
        _ if !node.faults.is_empty() => (ORANGE, "#fff5e3"),
        Some(CellKind::Volume) => (INK, "#f3ead9"),
        Some(CellKind::Face) => (INK, "#e8f1e3"),
        Some(CellKind::Edge) => (INK, "#e4edf8"),
        Some(CellKind::Vertex) => (INK, "#f5e7f0"),
        None => (INK, "#f1f1f1"),
    }
}

fn draw(body: &mut String, node: &Node, one: &Box) {
    let (colour, fill) = colours(node);
    let mut frame = |rect: Rect, fill: &str, round: f64| {
        let [x, y, w, h] = [rect.left, rect.top, rect.width, rect.height].map(number);
        let _ = writeln!(
            body,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" rx=\"{round}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.4\"/>"
        );
    };
    frame(one.rect, fill, 9.0);
    if !node.roots.is_empty() {
        frame(one.rect.grown(-3.0), "none", 7.0);
    }
    body.push_str("<g>");
    let told: Vec<String> = node.faults.iter().map(|fault| format!("{} [{}]", fault.message, fault.code)).collect();
    let tip = if told.is_empty() { node.name.clone() } else { format!("{}: {}", node.name, told.join("; ")) };
    let _ = writeln!(body, "<title>{}</title>", escaped(&tip));
    let written = 2 + usize::from(!node.roots.is_empty());
    for (index, line) in one.lines.iter().enumerate() {
        let (size, more) =
            if index == 0 { (NAME_SIZE, "text-anchor=\"middle\" font-weight=\"bold\"") } else { (TEXT_SIZE, "text-anchor=\"middle\"") };
        let ink = if index >= written { colour } else { INK };
        write_text(body, [one.rect.centre()[0], one.rect.top + 7.0 + LINE * index as f64 + 12.0], line, size, ink, more);
    }
    body.push_str("</g>\n");
}

/// What the arrows and frames mean, as far as they occur.
fn legend(body: &mut String, frame: &mut Frame, diagram: &Diagram, bottom: &mut f64) {
    let mut left = frame.low[0];
    for (bond, words) in [(Bond::Transition, "child, by transition"), (Bond::Boundary, "boundary, by index")] {
        if diagram.arrows.iter().any(|arrow| arrow.bond == bond) {
            let curve = vec![[left, *bottom], [left + 17.0, *bottom], [left + 34.0, *bottom]];
            arrow(body, &Route { curve, label: String::new(), place: Rect::around([left, *bottom], 0.0, 0.0), bond });
            write_text(body, [left + 40.0, *bottom + 4.0], words, TEXT_SIZE, stroke(bond).0, "");
            left += 40.0 + width_of(words, TEXT_SIZE) + 18.0;
        }
    }
    write_text(body, [left, *bottom + 4.0], "double frame: root cells", TEXT_SIZE, INK, "");
    left += width_of("double frame: root cells", TEXT_SIZE);
    frame.take(&Rect { left: frame.low[0], top: *bottom, width: left - frame.low[0], height: 8.0 });
    *bottom += 1.5 * LINE;
}

/// Words of a message in lines of some letters.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        if !lines[last].is_empty() && lines[last].chars().count() + word.chars().count() >= LINE_LETTERS {
            lines.push(String::new());
        }
        let line = lines.last_mut().expect("there is a line");
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(&shortened(word, LINE_LETTERS));
    }
    lines
}

fn notes(body: &mut String, frame: &mut Frame, notes: &[Fault], bottom: &mut f64) {
    let lines = notes.iter().flat_map(|note| {
        let colour = if note.warning { ORANGE } else { RED };
        wrapped(&format!("{} [{}]", note.message, note.code)).into_iter().map(move |line| (line, colour))
    });
    for (line, colour) in lines.take(MOST_LINES) {
        *bottom += LINE;
        write_text(body, [frame.low[0], *bottom], &line, TEXT_SIZE, colour, "");
        frame.take(&Rect { left: frame.low[0], top: *bottom, width: width_of(&line, TEXT_SIZE), height: 4.0 });
    }
}

/// States and arrows as lines of text.
fn list(diagram: &Diagram) -> String {
    let (states, arrows) = (diagram.nodes.len(), diagram.arrows.len());
    let mut lines = vec![(
        format!(
            "{states} states and {arrows} arrows are too many to draw (at most {MOST_STATES} and {MOST_ARROWS}); the DOT text has them all"
        ),
        INK,
    )];
    let mut leaving: Vec<Vec<String>> = vec![Vec::new(); states];
    for arrow in &diagram.arrows {
        let word = if arrow.bond == Bond::Transition { "children" } else { "boundaries" };
        leaving[arrow.from].push(format!("{word} {} to {}", ranges(&arrow.indices), shortened(&diagram.nodes[arrow.to].name, 24)));
    }
    for (node, leaving) in diagram.nodes.iter().zip(leaving) {
        let root = node.rooted().map_or(String::new(), |rooted| format!(", {rooted}"));
        let name = shortened(&node.name, 40);
        let colour = colours(node).0;
        lines.push((shortened(&format!("{name} ({}{root}): {}", node.about(), leaving.join("; ")), LINE_LETTERS), colour));
        lines.extend(node.faults.iter().map(|fault| (shortened(&format!("    {} [{}]", fault.message, fault.code), LINE_LETTERS), colour)));
        if lines.len() > MOST_LINES {
            break;
        }
    }
    let mut body = String::new();
    let mut frame = Frame::default();
    let mut bottom = 0.0;
    for (line, colour) in lines.iter().take(MOST_LINES) {
        bottom += LINE;
        write_text(&mut body, [0.0, bottom], line, TEXT_SIZE, colour, "xml:space=\"preserve\"");
        frame.take(&Rect { left: 0.0, top: bottom, width: width_of(line, TEXT_SIZE), height: 4.0 });
    }
    notes(&mut body, &mut frame, &diagram.notes, &mut bottom);
    document(diagram, &frame, &body)
}
