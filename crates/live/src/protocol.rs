//! The page's types are made from the program's: `web/lab/messages.ts` is what these tests make of
//! [`ToPage`] and [`Request`]. `NORTHING_BLESS=1 cargo test -p northing-live protocol` makes it anew.

use std::collections::BTreeMap;
use std::path::Path;

use northing_core::calibration::magnetometer::{MagnetometerCalibration, MagnetometerModel};
use northing_recording::test_data::assert_as_committed;
use serde_json::json;
use ts_rs::{Config, TS, TypeVisitor};

use crate::hand_in_api::{CardLine, ClassTable, HandedIn};
use crate::hand_ins::HandInRequest;
use crate::messages::{Change, Request};
use crate::opened::{Contents, Made, OpenedFile};
use crate::recorder::Listed;
use crate::to_page::{MagnetometerFit, ToPage};

const HEAD: &str =
    "// Made from the program's types by a test of `crates/live/src/protocol.rs`; not to be edited.
import type { Settings, SettingValue } from \"./protocol\";
";

/// Declarations by name.
struct Declarations {
    config: Config,
    texts: BTreeMap<String, String>,
}

impl TypeVisitor for Declarations {
    fn visit<T: TS + 'static + ?Sized>(&mut self) {
        // Numbers, texts and lists are not declared, and have no name.
        if T::output_path().is_none() {
            return;
        }
        let name = T::ident(&self.config);
        if self.texts.contains_key(&name) {
            return;
        }
        let text = declaration(&T::decl(&self.config));
        self.texts.insert(name, text);
        T::visit_dependencies(self);
        T::visit_generics(self);
    }
}

/// A field a line. What fields mean stands where the program declares them.
fn declaration(text: &str) -> String {
    let is_code = |line: &&str| !["/**", " *"].iter().any(|doc| line.starts_with(doc));
    let code: Vec<&str> = text.lines().filter(is_code).map(str::trim_end).collect();
    format!("export {}\n", code.join("\n  "))
}

#[test]
fn the_pages_types_are_those_of_the_program() {
    let mut declarations = Declarations {
        config: Config::new().with_large_int("number"),
        texts: BTreeMap::new(),
    };
    declarations.visit::<ToPage>();
    declarations.visit::<Request>();
    declarations.visit::<Change>();
    declarations.visit::<Listed>();
    declarations.visit::<OpenedFile>();
    declarations.visit::<Contents>();
    declarations.visit::<Made>();
    declarations.visit::<CardLine>();
    declarations.visit::<HandInRequest>();
    declarations.visit::<HandedIn>();
    declarations.visit::<ClassTable>();
    let mut text = HEAD.to_owned();
    for declaration in declarations.texts.values() {
        text.push('\n');
        text.push_str(declaration);
    }
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/lab/messages.ts");
    assert_as_committed(&page, &text, |committed, made| committed == made);
}

/// The status of a device holds the calibration as the core has it, and the page takes it for a fit.
#[test]
fn a_fit_is_named_as_the_calibration_that_it_comes_from() {
    let calibration = MagnetometerCalibration {
        model: MagnetometerModel::Ellipsoid,
        samples: 1,
        ignored_samples: 2,
        rejected_samples: 3,
        coverage: 0.4,
        hard_iron_ut: [5.0, 6.0, 7.0],
        hard_iron_std_ut: [8.0, 9.0, 10.0],
        soft_iron: [[11.0, 12.0, 13.0], [12.0, 14.0, 15.0], [13.0, 15.0, 16.0]],
        field_strength_ut: 17.0,
        radius_ut: 18.0,
        residual_std_ut: 19.0,
        uncalibrated_norm_std_ut: 20.0,
        condition_number: 21.0,
    };
    let (fit, whole) = (
        json!(MagnetometerFit::from(&calibration)),
        json!(calibration),
    );
    for (key, value) in fit.as_object().unwrap() {
        assert_eq!(value, &whole[key], "{key}");
    }
}
