//! Where the nodes of a diagram stand: a row for each kind of cell, volumes above and vertices below; many states of
//! one kind stand on a circle, where no straight arrow meets a third.

use super::{Bond, Diagram, Node};
use lacuna_kernel::attractor::ranges;
use lacuna_kernel::model::CellKind;

/// Kinds of cells from above to below.
pub(super) const KINDS: [CellKind; 4] = [CellKind::Volume, CellKind::Face, CellKind::Edge, CellKind::Vertex];

/// Size of a node's name, and of everything else that is written.
pub(super) const NAME_SIZE: f64 = 14.0;
pub(super) const TEXT_SIZE: f64 = 11.0;
/// Distance of lines of text.
pub(super) const LINE: f64 = 16.0;

/// A rectangle of the picture; y grows downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn around(centre: [f64; 2], width: f64, height: f64) -> Self {
        Self { left: centre[0] - 0.5 * width, top: centre[1] - 0.5 * height, width, height }
    }

    pub(super) fn centre(&self) -> [f64; 2] {
        [self.left + 0.5 * self.width, self.top + 0.5 * self.height]
    }

    pub(super) fn grown(&self, by: f64) -> Self {
        Self { left: self.left - by, top: self.top - by, width: self.width + 2.0 * by, height: self.height + 2.0 * by }
    }

    pub(super) fn holds(&self, [x, y]: [f64; 2]) -> bool {
        x >= self.left && x <= self.left + self.width && y >= self.top && y <= self.top + self.height
    }

    pub(super) fn meets(&self, other: &Self) -> bool {
        self.left < other.left + other.width
            && other.left < self.left + self.width
            && self.top < other.top + other.height
            && other.top < self.top + self.height
    }
}

/// The side of a node on which its loops are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Above,
    Below,
    Left,
    Right,
}

/// A node with its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Box {
    pub(super) rect: Rect,
    /// What is written in it, the name first.
    pub(super) lines: Vec<String>,
    /// Where a loop of its transitions goes; one of boundaries, which is a fault, goes to the other side.
    pub(super) side: Side,
}

/// Letters of a name that are shown.
const NAME_LETTERS: usize = 30;
/// States of one kind that stand in a row.
const ROW: usize = 5;
/// Space between nodes of a row, and between groups.
const ACROSS: f64 = 90.0;
const DOWN: f64 = 110.0;

/// Width of a text, estimated: letters of a font without serifs are at most about this wide.
pub(super) fn width_of(text: &str, size: f64) -> f64 {
    // From here on letters are as wide as they are high: Chinese, Japanese, Korean, pictures.
    const WIDE: char = '\u{2e80}';
    text.chars().map(|letter| if letter >= WIDE { 1.05 * size } else { 0.6 * size }).sum()
}

/// A text of some letters at most.
pub(super) fn shortened(text: &str, letters: usize) -> String {
    match text.char_indices().nth(letters) {
        Some((end, _)) => format!("{}\u{2026}", &text[..end]),
        None => text.to_owned(),
    }
}

fn lines(node: &Node) -> Vec<String> {
    let mut lines = vec![shortened(&node.name, NAME_LETTERS), node.about()];
    lines.extend(node.rooted());
    let mut codes: Vec<&str> = node.faults.iter().map(|fault| fault.code.as_str()).collect();
    codes.dedup();
    lines.extend(codes.iter().take(3).map(|code| (*code).to_owned()));
    if codes.len() > 3 {
        lines.push(format!("and {} more", codes.len() - 3));
    }
    lines
}

/// Places all nodes, in the order of the diagram.
pub(super) fn place(diagram: &Diagram) -> Vec<Box> {
    let mut boxes: Vec<Box> = diagram
        .nodes
        .iter()
        .map(|node| {
            let lines = lines(node);
            let others = lines[1..].iter().map(|line| width_of(line, TEXT_SIZE)).fold(0.0, f64::max);
            let width = others.max(1.08 * width_of(&lines[0], NAME_SIZE)) + 24.0;
            let rect = Rect { left: 0.0, top: 0.0, width: width.max(72.0), height: LINE * lines.len() as f64 + 14.0 };
            Box { rect, lines, side: Side::Above }
        })
        .collect();
    let mut top = 0.0;
    for kind in KINDS.into_iter().map(Some).chain([None]) {
        let members: Vec<usize> = (0..boxes.len()).filter(|&index| diagram.nodes[index].kind == kind).collect();
        if !members.is_empty() {
            top += if members.len() <= ROW { row(&members, &mut boxes, top) } else { ring(diagram, &members, &mut boxes, top) } + DOWN;
        }
    }
    boxes
}

/// Places a row around x = 0; its height.
fn row(members: &[usize], boxes: &mut [Box], top: f64) -> f64 {
    let height = members.iter().map(|&index| boxes[index].rect.height).fold(0.0, f64::max);
    let total: f64 = members.iter().map(|&index| boxes[index].rect.width + ACROSS).sum::<f64>() - ACROSS;
    let mut left = -0.5 * total;
    for &index in members {
        let rect = &mut boxes[index].rect;
        (rect.left, rect.top) = (left, top + 0.5 * (height - rect.height));
        left += rect.width + ACROSS;
    }
    height
}

/// Places nodes on an ellipse around x = 0, the first one above; its height.
fn ring(diagram: &Diagram, members: &[usize], boxes: &mut [Box], top: f64) -> f64 {
    let widest = members.iter().map(|&index| boxes[index].rect.width).fold(0.0, f64::max);
    let highest = members.iter().map(|&index| boxes[index].rect.height).fold(0.0, f64::max);
    let loops = diagram.arrows.iter().any(|arrow| arrow.from == arrow.to && arrow.bond == Bond::Transition);
    // Room for the longest label on the arrow between two neighbours, and for loops.
    let longest = diagram.arrows.iter().map(|arrow| width_of(&ranges(&arrow.indices), TEXT_SIZE)).fold(0.0, f64::max);
    let space = 40.0 + longest.min(90.0) + if loops { 14.0 } else { 0.0 };
    let turn = std::f64::consts::TAU / members.len() as f64;
    // Neighbours on the flat parts differ by their width, on the steep ones by their height.
    let chord = 2.0 * (0.5 * turn).sin();
    let (across, down) = (((widest + space) / chord).max(widest), ((highest + space + 24.0) / chord).max(1.2 * highest + 40.0));
    let middle = top + down + 0.5 * highest;
    for (position, &index) in members.iter().enumerate() {
        let (sine, cosine) = (turn * position as f64).sin_cos();
        let rect = boxes[index].rect;
        boxes[index].rect = Rect::around([across * sine, middle - down * cosine], rect.width, rect.height);
        boxes[index].side = match (sine, cosine) {
            _ if cosine > 0.7 => Side::Above,
            _ if cosine < -0.7 => Side::Below,
            _ if sine > 0.0 => Side::Right,
            _ => Side::Left,
        };
    }
    2.0 * down + highest
}
