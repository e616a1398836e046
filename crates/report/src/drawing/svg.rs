//! A small SVG writer: numbers rounded to 2 decimals, text escaped, nothing that is not finite.
//!
//! Coordinates are fractions of a pixel (whole pixels make steps in slow curves), shapes carry CSS
//! classes instead of colours, so that one picture serves light and dark pages.

use std::fmt::Write as _;

/// Text of an SVG element under construction.
#[derive(Debug, Default)]
pub(crate) struct Svg {
    text: String,
}

/// Escapes text for HTML and XML, content and quoted attributes.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Control characters are not allowed in XML, and say nothing to a reader.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Appends a coordinate: at most 2 decimals, no trailing zeros, far-off values clamped.
fn push_number(out: &mut String, value: f64) {
    let value = if value.is_finite() { value } else { 0.0 };
    let hundredths = (value.clamp(-1e4, 1e4) * 100.0).round();
    if (hundredths % 100.0).abs() < 0.5 {
        let _ = write!(out, "{}", (hundredths / 100.0) as i64);
    } else {
        let _ = write!(out, "{}", hundredths / 100.0);
    }
}

/// A coordinate as text.
pub(crate) fn number(value: f64) -> String {
    let mut out = String::new();
    push_number(&mut out, value);
    out
}

fn push_point(out: &mut String, [x, y]: [f64; 2]) {
    push_number(out, x);
    out.push(' ');
    push_number(out, y);
}

impl Svg {
    /// A picture with room for `width` by `height` units; `label` describes it to screen readers.
    pub(crate) fn picture(width: f64, height: f64, label: &str) -> Self {
        let (w, h) = (number(width), number(height));
        let mut svg = Self::default();
        let _ = writeln!(
            svg.text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 0 {w} {h}\" \
             width=\"{w}\" height=\"{h}\" role=\"img\" aria-label=\"{}\">",
            escape(label)
        );
        svg
    }

    /// Adds text as it is: already SVG.
    pub(crate) fn raw(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// Opens a window whose own coordinates start at its upper left; what leaves it is cut off.
    pub(crate) fn open_window(&mut self, x: f64, y: f64, width: f64, height: f64) {
        let _ = writeln!(
            self.text,
            "<svg x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" overflow=\"hidden\">",
            number(x),
            number(y),
            number(width),
            number(height)
        );
    }

    /// Closes the window or the picture opened last.
    pub(crate) fn close(&mut self) {
        self.text.push_str("</svg>\n");
    }

    /// A filled rectangle with rounded corners.
    pub(crate) fn rectangle(&mut self, corner: [f64; 2], size: [f64; 2], round: f64, class: &str) {
        let _ = writeln!(
            self.text,
            "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"{}\"/>",
            number(corner[0]),
            number(corner[1]),
            number(size[0].max(0.0)),
            number(size[1].max(0.0)),
            number(round)
        );
    }

    /// Text with its baseline at `at`.
    pub(crate) fn text(&mut self, at: [f64; 2], class: &str, text: &str) {
        let _ = writeln!(
            self.text,
            "<text class=\"{class}\" x=\"{}\" y=\"{}\">{}</text>",
            number(at[0]),
            number(at[1]),
            escape(text)
        );
    }

    /// A name and its unit: the name strong, the unit quiet.
    pub(crate) fn title(&mut self, at: [f64; 2], name: &str, unit: &str) {
        let _ = writeln!(
            self.text,
            "<text class=\"name\" x=\"{}\" y=\"{}\">{}<tspan class=\"unit\" dx=\"7\">{}</tspan></text>",
            number(at[0]),
            number(at[1]),
            escape(name),
            escape(unit)
        );
    }

    /// Straight lines from point to point, each list one line of its own.
    pub(crate) fn lines(&mut self, lines: &[Vec<[f64; 2]>], class: &str) {
        let mut path = String::new();
        for line in lines {
            for (i, point) in line.iter().enumerate() {
                path.push(if i == 0 { 'M' } else { 'L' });
                push_point(&mut path, *point);
            }
            // A line of a single point shows as a dot through its round cap.
            if line.len() == 1 {
                path.push_str("h0");
            }
        }
        self.path(&path, class);
    }

    /// Closed areas, one for each outline.
    pub(crate) fn areas(&mut self, outlines: &[Vec<[f64; 2]>], class: &str) {
        let mut path = String::new();
        for outline in outlines {
            for (i, point) in outline.iter().enumerate() {
                path.push(if i == 0 { 'M' } else { 'L' });
                push_point(&mut path, *point);
            }
            path.push('Z');
        }
        self.path(&path, class);
    }

    /// Round dots; the class gives their size as stroke width.
    pub(crate) fn dots(&mut self, points: &[[f64; 2]], class: &str) {
        let mut path = String::new();
        for point in points {
            path.push('M');
            push_point(&mut path, *point);
            path.push_str("h0");
        }
        self.path(&path, class);
    }

    fn path(&mut self, path: &str, class: &str) {
        if !path.is_empty() {
            let _ = writeln!(self.text, "<path class=\"{class}\" d=\"{path}\"/>");
        }
    }

    /// The text written so far.
    pub(crate) fn finish(self) -> String {
        self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_always_finite() {
        let written = [3.0, -0.004, 1.25, 2.499_9, f64::NAN, f64::INFINITY, -1e300].map(number);
        assert_eq!(written, ["3", "0", "1.25", "2.5", "0", "0", "-10000"]);
    }

    #[test]
    fn text_is_escaped_for_content_and_attributes() {
        assert_eq!(
            escape("<a href=\"x\">'&'\u{7}"),
            "&lt;a href=&quot;x&quot;&gt;&#39;&amp;&#39; "
        );
    }
}
