//! Stroke lettering for dimensions, in the manner of a drawing: each character is a few lines on
//! a grid, rounded by Chaikin's corner cutting.

use glam::Vec2;

/// Height of a digit on the grid.
pub(super) const HEIGHT: f32 = 6.0;
/// Space between characters on the grid.
const GAP: f32 = 1.7;
/// Rounds of corner cutting; more cannot be seen.
const ROUNDS: usize = 3;

/// A line of a character.
enum Stroke {
    Straight(&'static [[f32; 2]]),
    Rounded(&'static [[f32; 2]]),
    /// Rounded and closed.
    Loop(&'static [[f32; 2]]),
}

use Stroke::{Loop, Rounded, Straight};

/// Width and strokes of a character on a grid with y up and the baseline at 0. Characters that
/// dimensions do not need are blank.
fn character(character: char) -> (f32, &'static [Stroke]) {
    match character {
        '0' => (4.0, &[Loop(&[[0.0, -0.2], [4.0, -0.2], [4.0, 3.0], [4.0, 6.2], [0.0, 6.2], [0.0, 3.0]])]),
        '1' => (2.4, &[Straight(&[[0.2, 4.6], [1.9, 6.0], [1.9, 0.0]])]),
        '2' => (
            4.0,
            &[Rounded(&[[0.2, 4.3], [0.2, 6.1], [3.9, 6.3], [3.9, 3.7], [1.8, 2.2], [0.1, 0.0]]), Straight(&[[0.1, 0.0], [4.0, 0.0]])],
        ),
        '3' => (
            4.0,
            &[
                Rounded(&[[0.2, 5.2], [0.9, 6.2], [3.8, 6.3], [3.8, 3.3], [1.6, 3.3]]),
                Rounded(&[[1.6, 3.3], [4.2, 3.3], [4.2, -0.2], [0.8, -0.3], [0.0, 0.9]]),
            ],
        ),
        '4' => (4.2, &[Straight(&[[3.1, 0.0], [3.1, 6.0], [0.0, 1.7], [4.2, 1.7]])]),
        '5' => (
            4.0,
            &[
                Straight(&[[3.7, 6.0], [0.7, 6.0], [0.4, 3.3]]),
                Rounded(&[[0.4, 3.3], [1.4, 4.2], [4.1, 4.2], [4.1, -0.2], [0.9, -0.3], [0.0, 0.8]]),
            ],
        ),
        '6' => {
            (4.0, &[Rounded(&[[3.4, 5.9], [1.2, 6.1], [0.0, 4.2], [0.0, 1.9]]), Loop(&[[0.0, -0.2], [4.0, -0.2], [4.0, 3.9], [0.0, 3.9]])])
        }
        '7' => (3.8, &[Straight(&[[0.0, 6.0], [3.8, 6.0], [1.3, 0.0]])]),
        '8' => (
            4.0,
            &[Loop(&[[0.3, 3.25], [3.7, 3.25], [3.7, 6.15], [0.3, 6.15]]), Loop(&[[0.0, -0.15], [4.0, -0.15], [4.0, 3.25], [0.0, 3.25]])],
        ),
        '9' => {
            (4.0, &[Rounded(&[[0.6, 0.1], [2.8, -0.1], [4.0, 1.8], [4.0, 4.1]]), Loop(&[[0.0, 2.1], [4.0, 2.1], [4.0, 6.2], [0.0, 6.2]])])
        }
        '.' => (0.3, &[Straight(&[[0.15, 0.0], [0.15, 0.12]])]),
        '-' => (3.0, &[Straight(&[[0.2, 2.6], [2.8, 2.6]])]),
        '+' => (3.2, &[Straight(&[[0.2, 2.6], [3.0, 2.6]]), Straight(&[[1.6, 1.2], [1.6, 4.0]])]),
        'e' => (3.6, &[Rounded(&[[0.1, 2.1], [3.6, 2.1], [3.7, 4.2], [0.0, 4.3], [0.0, -0.3], [2.6, -0.3], [3.5, 0.7]])]),
        'm' => (
            5.2,
            &[
                Straight(&[[0.0, 0.0], [0.0, 4.1]]),
                Rounded(&[[0.0, 2.5], [0.2, 4.1], [2.6, 4.5], [2.6, 2.4], [2.6, 0.0]]),
                Rounded(&[[2.6, 2.5], [2.8, 4.1], [5.2, 4.5], [5.2, 2.4], [5.2, 0.0]]),
            ],
        ),
        'X' => (4.0, &[Straight(&[[0.0, 0.0], [4.0, 6.0]]), Straight(&[[0.0, 6.0], [4.0, 0.0]])]),
        'Y' => (4.0, &[Straight(&[[0.0, 6.0], [2.0, 3.0], [4.0, 6.0]]), Straight(&[[2.0, 3.0], [2.0, 0.0]])]),
        'Z' => (4.0, &[Straight(&[[0.0, 6.0], [4.0, 6.0], [0.0, 0.0], [4.0, 0.0]])]),
        _ => (1.2, &[]),
    }
}

/// Width of a text on the grid.
pub(super) fn width(text: &str) -> f32 {
    let characters: f32 = text.chars().map(|letter| character(letter).0 + GAP).sum();
    (characters - GAP).max(0.0)
}

/// The lines of a text on the grid, each at least two points long.
pub(super) fn lines(text: &str) -> Vec<Vec<Vec2>> {
    let mut lines = Vec::new();
    let mut left = 0.0;
    for letter in text.chars() {
        let (width, strokes) = character(letter);
        for stroke in strokes {
            let (points, rounded, closed) = match stroke {
                Straight(points) => (points, false, false),
                Rounded(points) => (points, true, false),
                Loop(points) => (points, true, true),
            };
            let mut line: Vec<Vec2> = points.iter().map(|&[x, y]| Vec2::new(left + x, y)).collect();
            if rounded {
                for _ in 0..ROUNDS {
                    line = cut_corners(&line, closed);
                }
            }
            if closed {
                line.extend(line.first().copied());
            }
            lines.push(line);
        }
        left += width + GAP;
    }
    lines
}

/// One round of Chaikin's scheme; an open line keeps its ends.
fn cut_corners(line: &[Vec2], closed: bool) -> Vec<Vec2> {
    let (Some(&first), Some(&last)) = (line.first(), line.last()) else { return Vec::new() };
    let quarters = |a: Vec2, b: Vec2| [a.lerp(b, 0.25), a.lerp(b, 0.75)];
    let mut cut: Vec<Vec2> = line.windows(2).flat_map(|pair| quarters(pair[0], pair[1])).collect();
    if closed {
        cut.extend(quarters(last, first));
    } else {
        cut.insert(0, first);
        cut.push(last);
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_of_a_dimension_is_drawn_in_its_width() {
        for letter in "0123456789.-+emXYZ".chars() {
            let text = letter.to_string();
            let lines = lines(&text);
            assert!(!lines.is_empty(), "{letter}");
            for point in lines.iter().flatten() {
                assert!((-0.3..=width(&text) + 0.3).contains(&point.x), "{letter} {point}");
                assert!((-0.5..=HEIGHT + 0.5).contains(&point.y), "{letter} {point}");
            }
        }
    }
}
