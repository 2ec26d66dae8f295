//! Captions in a 5×7 dot face, its dots joined to strokes, so that it is smooth at every size.
//!
//! `font.txt` is the face: printable ASCII from the space on, sixteen glyphs a row, each six
//! columns wide and nine lines high (seven, and two below the baseline).

use super::canvas::Canvas;
use super::colour::Rgb;

const SHEET: &str = include_str!("font.txt");
/// Of one glyph in the sheet.
const COLUMNS: usize = 5;
const LINES: usize = 9;
/// Between glyphs, and for the space \[dots\].
const GAP: f32 = 1.7;
const SPACE: f32 = 2.2;

/// Writes `text` with its first baseline dot at `at`; `dot` is the distance of two dots \[px\]:
/// capitals are six of them high.
pub fn write(canvas: &mut Canvas, text: &str, at: [f32; 2], dot: f32, colour: Rgb) {
    let mut left = at[0];
    for glyph in text.chars().map(Glyph::of) {
        for ([x0, y0], [x1, y1]) in glyph.strokes() {
            let place = |x: usize, y: usize| {
                [
                    left + (x - glyph.first) as f32 * dot,
                    at[1] + (y as f32 - 6.0) * dot,
                ]
            };
            canvas.stroke(place(x0, y0), place(x1, y1), 0.95 * dot, colour);
        }
        left += glyph.advance() * dot;
    }
}

/// Width of `text` \[px\].
pub fn width(text: &str, dot: f32) -> f32 {
    text.chars().map(|c| Glyph::of(c).advance()).sum::<f32>() * dot
}

/// `text`, cut to at most `limit` \[px\].
pub fn fitted(text: &str, dot: f32, limit: f32) -> String {
    if width(text, dot) <= limit {
        return text.to_owned();
    }
    let mut short = text.to_owned();
    while !short.is_empty() && width(&short, dot) + width("...", dot) > limit {
        short.pop();
    }
    short + "..."
}

/// The dots of one character.
struct Glyph {
    /// `[line][column]`.
    dots: [[bool; COLUMNS]; LINES],
    /// First and last column with a dot; both 0 for the space.
    first: usize,
    last: usize,
}

impl Glyph {
    /// The glyph of `c`; characters outside the face show as question marks.
    fn of(c: char) -> Self {
        let c = match c {
            ' '..='~' => c,
            '–' | '—' | '−' => '-',
            _ => '?',
        };
        let index = c as usize - 32;
        let (row, column) = (index / 16 * LINES, index % 16 * (COLUMNS + 1));
        let mut dots = [[false; COLUMNS]; LINES];
        for (line, art) in dots.iter_mut().zip(SHEET.lines().skip(row)) {
            for (dot, mark) in line.iter_mut().zip(art.bytes().skip(column)) {
                *dot = mark == b'#';
            }
        }
        let inked = |x: &usize| dots.iter().any(|line| line[*x]);
        let first = (0..COLUMNS).find(inked).unwrap_or(0);
        let last = (0..COLUMNS).rfind(inked).unwrap_or(0);
        Self { dots, first, last }
    }

    /// Distance to the next glyph's first column \[dots\].
    fn advance(&self) -> f32 {
        if self.dots.as_flattened().iter().any(|dot| *dot) {
            (self.last - self.first) as f32 + GAP
        } else {
            SPACE + GAP
        }
    }

    /// Pairs of dots to join: orthogonal neighbours, diagonal ones that no corner dot joins, and
    /// single dots with themselves.
    fn strokes(&self) -> Vec<([usize; 2], [usize; 2])> {
        let lit = |x: usize, y: usize| x < COLUMNS && y < LINES && self.dots[y][x];
        let mut strokes = Vec::new();
        for y in 0..LINES {
            for x in (0..COLUMNS).filter(|x| lit(*x, y)) {
                strokes.push(([x, y], [x, y]));
                if lit(x + 1, y) {
                    strokes.push(([x, y], [x + 1, y]));
                }
                if lit(x, y + 1) {
                    strokes.push(([x, y], [x, y + 1]));
                }
                if lit(x + 1, y + 1) && !lit(x + 1, y) && !lit(x, y + 1) {
                    strokes.push(([x, y], [x + 1, y + 1]));
                }
                if x > 0 && lit(x - 1, y + 1) && !lit(x - 1, y) && !lit(x, y + 1) {
                    strokes.push(([x, y], [x - 1, y + 1]));
                }
            }
        }
        strokes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printable_character_has_its_own_dots() {
        let glyphs: Vec<_> = (' '..='~').map(|c| Glyph::of(c).dots).collect();
        for (i, a) in glyphs.iter().enumerate() {
            assert!(!glyphs[..i].contains(a), "{:?}", (32 + i as u8) as char);
        }
    }

    #[test]
    fn the_sheet_has_nothing_between_its_glyphs() {
        assert_eq!(SHEET.lines().count(), 6 * LINES);
        for line in SHEET.lines() {
            assert!(line.bytes().skip(COLUMNS).step_by(6).all(|c| c == b' '));
            assert!(line.bytes().all(|c| b".# ".contains(&c)));
        }
    }

    #[test]
    fn a_text_too_wide_is_cut_with_dots() {
        let long = "a very long caption indeed";
        let cut = fitted(long, 2.0, 100.0);
        assert!(cut.ends_with("...") && width(&cut, 2.0) <= 100.0);
        assert_eq!(fitted("x*", 2.0, 100.0), "x*");
    }
}
