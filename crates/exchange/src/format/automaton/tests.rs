#![allow(clippy::unwrap_used)]
use super::layout::place;
use super::route::routes;
use super::*;
use crate::document::{DocumentLimits, read_model};

fn model(shape: &str) -> Model {
    read_model(format!("{{\"lacuna\": 1, \"shape\": {shape}}}").as_bytes(), &DocumentLimits::default()).unwrap()
}

/// A curve whose second operator may be spoilt.
fn curve(entry: &str) -> Model {
    model(&format!(
        r#"{{"family": "bcifs", "states": [
            {{"name": "edge", "cell": "edge", "dimension": 2, "transitions": [
                {{"to": "edge", "operator": [[1, 0.5], [0, 0.5]]}}, {{"to": "edge", "operator": [[0.5, 0], [{entry}, 1]]}}],
             "boundaries": [{{"state": "a \"quoted\" & <vertex>", "incidence": [[1], [0]]}}, {{"state": "a \"quoted\" & <vertex>", "incidence": [[0], [1]]}}]}},
            {{"name": "a \"quoted\" & <vertex>", "cell": "vertex", "dimension": 1, "transitions": [{{"to": "a \"quoted\" & <vertex>", "operator": [[1]]}}]}}],
         "cells": [{{"state": "edge", "control_points": [[0, 0, 0], [1, 0, 0]]}}]}}"#
    ))
}

/// Every tag is closed and every text escaped: the reader of 3MF files would stop at what is not XML.
fn well_formed(svg: &str) -> usize {
    let mut reader = quick_xml::Reader::from_str(svg);
    let mut texts = 0;
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Eof => return texts,
            quick_xml::events::Event::Start(start) if start.name().as_ref() == "text" => texts += 1,
            _ => {}
        }
    }
}

#[test]
fn arrows_of_one_kind_between_two_states_are_one() {
    let diagram = Diagram::of(&curve("0.5"));
    let arrows: Vec<_> = diagram.arrows.iter().map(|arrow| (arrow.from, arrow.to, arrow.bond, arrow.indices.clone())).collect();
    let (child, boundary) = (Bond::Transition, Bond::Boundary);
    assert_eq!(arrows, [(0, 0, child, vec![0, 1]), (0, 1, boundary, vec![0, 1]), (1, 1, child, vec![0])]);
    assert_eq!((diagram.nodes[0].roots.as_slice(), diagram.nodes[1].roots.as_slice()), (&[0][..], &[][..]));
    assert!(diagram.notes.is_empty() && diagram.nodes.iter().all(|node| node.faults.is_empty()));
}

#[test]
fn what_is_wrong_is_drawn_where_it_is_wrong() {
    let diagram = Diagram::of(&curve("0.7"));
    assert_eq!(diagram.nodes[0].faults[0].code, "automaton.column-sum");
    assert!(diagram.nodes[1].faults.is_empty() && diagram.notes.is_empty());
    assert!(diagram.svg().contains("#c00000") && diagram.svg().contains("automaton.column-sum"));
    assert!(diagram.dot().contains("color=red"));
    // A cycle of several maps is nobody's fault alone, and one map is its own.
    let ifs = |scale: f64, graph: &str| {
        model(&format!(
            r#"{{"family": "ifs", "maps": [{{"scale": {scale}}}, {{"scale": [2, 0.1, 0.1], "translation": [1, 0, 0]}}, {{"scale": [0.1, 2, 0.1]}}] {graph}}}"#
        ))
    };
    let graph = r#", "graph": [[0], [2], [1]]"#;
    let diagram = Diagram::of(&ifs(1.5, graph));
    assert_eq!(diagram.nodes[1].name, "after map 0");
    assert_eq!(diagram.nodes[1].faults[0].code, "automaton.not-contractive");
    let diagram = Diagram::of(&ifs(0.5, graph));
    assert!(diagram.notes.is_empty() && diagram.nodes.iter().all(|node| node.faults.is_empty() && node.kind.is_none()));
}

#[test]
fn texts_are_escaped() {
    for entry in ["0.5", "0.7"] {
        let diagram = Diagram { title: Some("]]> \\ \" & \u{7}".into()), ..Diagram::of(&curve(entry)) };
        assert!(well_formed(&diagram.svg()) > 5);
        let dot = diagram.dot();
        assert!(dot.contains(r#""a \"quoted\" & <vertex>\nvertex, 1 point""#), "{dot}");
        assert!(dot.contains(r#"label="]]> \\ \" &  ";"#), "{dot}");
    }
}

/// A face-like tangle: n states of one kind, each with three children, loops and a boundary.
fn tangle(states: usize) -> Diagram {
    let node = |index: usize, kind| Node { name: format!("state {index}"), kind, control_points: 9, ..Node::default() };
    let mut diagram = Diagram { nodes: (0..states).map(|index| node(index, Some(CellKind::Face))).collect(), ..Diagram::default() };
    diagram.nodes.push(node(states, Some(CellKind::Edge)));
    for from in 0..states {
        let children: std::collections::BTreeSet<usize> = [from, (from * 5 + 1) % states, (from + 1) % states].into();
        diagram.arrows.extend(children.into_iter().map(|to| Arrow { from, to, bond: Bond::Transition, indices: vec![0, 1, 2, 5] }));
        diagram.arrows.push(Arrow { from, to: states, bond: Bond::Boundary, indices: (0..4).collect() });
    }
    diagram
}

#[test]
fn nodes_and_labels_stand_apart() {
    for states in [1, 2, 3, 4, 5, 6, 7, 9, 12, 16, 25, 40, 59] {
        let diagram = tangle(states);
        let boxes = place(&diagram);
        for (index, one) in boxes.iter().enumerate() {
            assert!(boxes[..index].iter().all(|other| !other.rect.grown(5.0).meets(&one.rect)), "{states} states: node {index}");
        }
        let routes = routes(&diagram, &boxes);
        assert_eq!(routes.len(), diagram.arrows.len());
        let hidden = routes.iter().filter(|route| boxes.iter().any(|one| one.rect.meets(&route.place))).count();
        assert_eq!(hidden, 0, "{states} states: labels on nodes");
        let pairs = (0..routes.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        let overlaps = pairs.filter(|&(a, b)| routes[a].place.meets(&routes[b].place)).count();
        assert_eq!(overlaps, 0, "{states} states: labels on labels");
        assert_eq!(diagram.svg(), tangle(states).svg());
    }
}

#[test]
fn what_is_too_much_is_listed() {
    let svg = tangle(60).svg();
    assert!(svg.contains("61 states and") && svg.contains("too many to draw") && svg.contains("state 17 (face, 9 points)"));
    assert!(well_formed(&svg) >= 61);
    assert!(well_formed(&tangle(4000).svg()) <= 400);
    assert_eq!(tangle(4000).dot().matches(" -> ").count(), tangle(4000).arrows.len());
}
