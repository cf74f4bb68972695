//! Diagrams as DOT text, the language of Graphviz.

use super::{Bond, Diagram, Fault, Node};
use lacuna_kernel::attractor::ranges;
use std::fmt::Write as _;

/// A quoted string: quotes and backslashes escaped, so that no text ends it or means something; line ends are spaces.
fn quoted(text: &str) -> String {
    let mut result = String::with_capacity(text.len() + 2);
    result.push('"');
    for character in text.chars() {
        match character {
            '"' | '\\' => result.extend(['\\', character]),
            other if other.is_control() => result.push(' '),
            other => result.push(other),
        }
    }
    result.push('"');
    result
}

/// Several lines of a label: `\n` between them is DOT's own.
fn lines(lines: &[String]) -> String {
    let inside = |line: &String| {
        let text = quoted(line);
        text[1..text.len() - 1].to_owned()
    };
    format!("\"{}\"", lines.iter().map(inside).collect::<Vec<_>>().join("\\n"))
}

fn sentence(fault: &Fault) -> String {
    format!("{} [{}]", fault.message, fault.code)
}

fn node(index: usize, node: &Node, text: &mut String) {
    let mut label = vec![node.name.clone(), node.about()];
    label.extend(node.rooted());
    label.extend(node.faults.iter().map(|fault| fault.code.clone()));
    let _ = write!(text, "  s{index} [label={}", lines(&label));
    if !node.roots.is_empty() {
        text.push_str(", peripheries=2");
    }
    if !node.faults.is_empty() {
        let colour = if node.faults.iter().all(|fault| fault.warning) { "darkorange" } else { "red" };
        let told: Vec<String> = node.faults.iter().map(sentence).collect();
        let _ = write!(text, ", color={colour}, fontcolor={colour}, tooltip={}", lines(&told));
    }
    text.push_str("];\n");
}

/// The diagram, states of one kind side by side, volumes above and vertices below. Linear in its size.
pub(super) fn text(diagram: &Diagram) -> String {
    let mut text = String::from("digraph automaton {\n  rankdir=TB;\n  node [shape=box, style=rounded, fontname=\"sans-serif\"];\n");
    text.push_str("  edge [fontname=\"sans-serif\", fontsize=10];\n");
    if let Some(title) = &diagram.title {
        let _ = writeln!(text, "  label={}; labelloc=t;", quoted(title));
    }
    for (index, state) in diagram.nodes.iter().enumerate() {
        node(index, state, &mut text);
    }
    for kind in super::layout::KINDS {
        let row: Vec<String> =
            diagram.nodes.iter().enumerate().filter(|(_, node)| node.kind == Some(kind)).map(|(index, _)| format!("s{index};")).collect();
        if row.len() > 1 {
            let _ = writeln!(text, "  {{ rank=same; {} }}", row.join(" "));
        }
    }
    for arrow in &diagram.arrows {
        let style = match arrow.bond {
            Bond::Transition => "",
            Bond::Boundary => ", style=dashed, arrowhead=empty",
        };
        let _ = writeln!(text, "  s{} -> s{} [label={}{style}];", arrow.from, arrow.to, quoted(&ranges(&arrow.indices)));
    }
    if !diagram.notes.is_empty() {
        let notes: Vec<String> = diagram.notes.iter().map(sentence).collect();
        let colour = if diagram.notes.iter().all(|note| note.warning) { "darkorange" } else { "red" };
        let _ = writeln!(text, "  notes [shape=note, color={colour}, fontcolor={colour}, label={}];", lines(&notes));
    }
    text.push_str("}\n");
    text
}
