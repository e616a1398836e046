//! Checks of pages and pictures that tests share: nesting, links, addresses, numbers.

/// The page without its scripts, each of which is data or the one that makes instruments of figures.
pub(crate) fn without_scripts(html: &str) -> String {
    let mut rest = html;
    let mut text = String::new();
    while let Some((before, script)) = rest.split_once("<script") {
        let (script, after) = script.split_once("</script>").expect("a script ends");
        let (kind, content) = script.split_once('>').expect("a tag ends");
        match kind {
            "" => assert_eq!(content, super::instrument::inline_script()),
            _ => {
                assert_eq!(kind, " type=\"application/json\" class=\"figure-data\"");
                let data: Result<serde_json::Value, _> = serde_json::from_str(content);
                assert!(data.is_ok_and(|data| data.is_object()), "{content:.80}");
            }
        }
        text.push_str(before);
        rest = after;
    }
    text + rest
}

/// Checks that tags nest, attributes are quoted, and that `id`s are unique and links find them.
pub(crate) fn assert_well_formed(html: &str) {
    let html = &without_scripts(html);
    const VOID: [&str; 2] = ["meta", "!DOCTYPE"];
    let mut open: Vec<&str> = Vec::new();
    let style_end = html.find("</style>").unwrap_or(0);
    for piece in html.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("a tag ends");
        assert!(
            !text.contains('>') || style_end > 0,
            "stray > in {text:.40}"
        );
        assert!(
            tag.matches('"').count().is_multiple_of(2),
            "quotes in <{tag:.80}>"
        );
        let name = tag
            .trim_start_matches('/')
            .split([' ', '/', '\n'])
            .next()
            .unwrap_or("");
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "closing tag");
        } else if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    let ids: Vec<&str> = attributes(html, " id=\"").collect();
    for (i, id) in ids.iter().enumerate() {
        assert!(!ids[i + 1..].contains(id), "id {id} twice");
    }
    for target in attributes(html, "href=\"#") {
        assert!(ids.contains(&target), "link to {target} leads nowhere");
    }
}

/// Values of an attribute, in order.
pub(crate) fn attributes<'a>(html: &'a str, start: &'a str) -> impl Iterator<Item = &'a str> {
    html.split(start)
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
}

/// Checks that a page fetches nothing and runs nothing but its own script.
pub(crate) fn assert_self_contained(html: &str) {
    let html = &without_scripts(html);
    for foreign in [
        "<script", "<link", "<img", "src=", "url(", "@import", "https://",
    ] {
        assert!(!html.contains(foreign), "{foreign} in the page");
    }
    // The one address is the name of the SVG namespace, which nothing fetches.
    let addresses = html.matches("http://").count();
    assert_eq!(
        addresses,
        html.matches("http://www.w3.org/2000/svg").count()
    );
}

/// Checks that no coordinate is NaN or infinite.
pub(crate) fn assert_numbers_are_finite(html: &str) {
    for data in attributes(html, " d=\"").chain(attributes(html, " x=\"")) {
        assert!(!data.contains("NaN") && !data.contains("inf"), "{data:.60}");
    }
}
