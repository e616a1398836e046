//! QR codes of addresses: for the page as SVG, for the terminal as characters.

use qrcode::render::{svg, unicode};
use qrcode::{EcLevel, QrCode};

/// The code as SVG text, dark on light whatever the theme: cameras want it so.
#[must_use]
pub fn svg(text: &str) -> Option<String> {
    let code = QrCode::with_error_correction_level(text, EcLevel::M).ok()?;
    let image = code
        .render::<svg::Color<'_>>()
        .min_dimensions(240, 240)
        .dark_color(svg::Color("#000000"))
        .light_color(svg::Color("#ffffff"))
        .build();
    Some(image)
}

/// The code for a dark terminal: light characters on the terminal's own background.
#[must_use]
pub fn terminal(text: &str) -> Option<String> {
    let code = QrCode::with_error_correction_level(text, EcLevel::L).ok()?;
    let image = code
        .render::<unicode::Dense1x2>()
        .dark_color(unicode::Dense1x2::Light)
        .light_color(unicode::Dense1x2::Dark)
        .build();
    Some(image)
}

#[cfg(test)]
mod tests {
    #[test]
    fn addresses_fit_and_are_drawn() {
        let url = "https://192.168.100.200:7771/p#t=AAAAAAAAAAAAAAAAAAAAAA";
        assert!(super::svg(url).unwrap().contains("<svg"));
        let drawn = super::terminal(url).unwrap();
        assert!(drawn.lines().count() > 15 && drawn.contains('\u{2588}'));
        assert!(super::svg(&"x".repeat(5000)).is_none());
    }
}
