//! Reading a scenario: the base tables, and variants that inherit from them or from one another.
//!
//! A variant is merged into the base key by key *before* anything is interpreted, and each value
//! keeps its place in the text, so that a message about it names the line it was written in.

use std::marker::PhantomData;

use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

use super::flight_schema::FlightScenario;
use super::schema::Scenario;

/// Name of the variant that is the base tables alone.
pub const BASE: &str = "base";

/// The tables of one kind of scenario.
pub trait ScenarioTables: serde::de::DeserializeOwned {
    /// Calls it by the name of a variant.
    fn set_name(&mut self, name: &str);

    /// The first thing that is invalid, in words that begin with its key.
    ///
    /// # Errors
    /// Names the key, its value and what was expected.
    fn check(&self) -> Result<(), String>;
}

/// A scenario file that has been read; `S` is what each variant of it says.
#[derive(Debug, Clone, PartialEq)]
pub struct VariantFile<S> {
    name: String,
    text: String,
    variants: Vec<String>,
    tables: PhantomData<S>,
}

/// A file of tracking scenarios.
pub type ScenarioFile = VariantFile<Scenario>;

/// A file of flights that attitude observers are judged by.
pub type FlightScenarioFile = VariantFile<FlightScenario>;

/// Why a scenario was refused; the message names the line and the valid names where there are any.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ScenarioError {
    message: String,
}

/// One-based line of a byte.
fn line(text: &str, at: usize) -> usize {
    text.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
}

impl<S: ScenarioTables> VariantFile<S> {
    /// Reads the text of a file; `name` is what messages call it. Every variant is checked.
    ///
    /// # Errors
    /// The first thing that is wrong in any of the variants.
    pub fn parse(name: &str, text: &str) -> Result<Self, ScenarioError> {
        let mut file = Self {
            name: name.to_owned(),
            text: text.to_owned(),
            variants: Vec::new(),
            tables: PhantomData,
        };
        file.variants = file.variant_names()?;
        file.scenario(None)?;
        for variant in file.variants.clone() {
            file.scenario(Some(&variant))?;
        }
        Ok(file)
    }

    /// Names of the variants, in the order of the file.
    #[must_use]
    pub fn variants(&self) -> &[String] {
        &self.variants
    }

    /// The names under `variant`, in the order of the text.
    fn variant_names(&self) -> Result<Vec<String>, ScenarioError> {
        let document = self.document()?;
        let Some(value) = document.get("variant") else {
            return Ok(Vec::new());
        };
        let Some(table) = value.get_ref().as_table() else {
            let at = Some(value.span().start);
            return Err(self.complain(at, "variant: expected tables [variant.NAME]"));
        };
        let mut keys: Vec<_> = table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        Ok(keys.iter().map(|key| key.get_ref().to_string()).collect())
    }

    /// The base scenario, or a variant. `meta.name` of a variant is the variant's name.
    ///
    /// # Errors
    /// The variant is unknown, or something in it is wrong.
    pub fn scenario(&self, variant: Option<&str>) -> Result<S, ScenarioError> {
        let mut root = self.document()?;
        let variants = root.remove("variant");
        // The base goes by its own name, too.
        let own = name_of(&root).map(str::to_owned);
        let variant = variant.filter(|name| *name != BASE && own.as_deref() != Some(*name));
        if let Some(name) = variant {
            let variants = variants.as_ref().and_then(|v| v.get_ref().as_table());
            for ancestor in self.ancestry(variants, name)? {
                self.merge(&mut root, ancestor)?;
            }
        }
        let root = Spanned::new(0..self.text.len(), root);
        let mut scenario = S::deserialize(Deserializer::from(root)).map_err(|error| {
            let at = error.span().map(|span| span.start);
            self.complain(at, error.message())
        })?;
        if let Some(name) = variant {
            scenario.set_name(name);
        }
        scenario.check().map_err(|problem| {
            let key = problem.split(' ').next().unwrap_or_default();
            self.complain(self.find(key, variant), &problem)
        })?;
        Ok(scenario)
    }

    fn document(&self) -> Result<DeTable<'_>, ScenarioError> {
        let table = DeTable::parse(&self.text).map_err(|error| {
            let at = error.span().map(|span| span.start);
            self.complain(at, error.message())
        })?;
        Ok(with_current_units(&table.into_inner()))
    }

    /// The variant and those it inherits from, the eldest first.
    fn ancestry<'a, 'i>(
        &self,
        variants: Option<&'a DeTable<'i>>,
        name: &str,
    ) -> Result<Vec<&'a DeTable<'i>>, ScenarioError> {
        let mut chain = Vec::new();
        let mut wanted = (name.to_owned(), None);
        loop {
            let (name, at) = &wanted;
            let found = variants.and_then(|v| v.get(name.as_str()));
            let Some(table) = found.and_then(|v| v.get_ref().as_table()) else {
                let known = self.variants.join(", ");
                let message = format!("no variant `{name}`; there are: {BASE}, {known}");
                return Err(self.complain(*at, &message));
            };
            chain.push(table);
            if chain.len() > self.variants.len() {
                let message = format!("variant `{name}` inherits from itself");
                return Err(self.complain(*at, &message));
            }
            let Some(parent) = table.get("inherits") else {
                chain.reverse();
                return Ok(chain);
            };
            let span = Some(parent.span().start);
            let Some(parent) = parent.get_ref().as_str() else {
                return Err(self.complain(span, "inherits: expected the name of a variant"));
            };
            wanted = (parent.to_owned(), span);
        }
    }

    /// Puts a variant's values over those of the base. Tables are merged, all else is replaced.
    fn merge<'i>(&self, base: &mut DeTable<'i>, over: &DeTable<'i>) -> Result<(), ScenarioError> {
        for (key, value) in over {
            let name: &str = key.get_ref();
            if name == "inherits" {
                continue;
            }
            match base.get_mut(name).map(Spanned::get_mut) {
                Some(DeValue::Table(below)) => {
                    let DeValue::Table(above) = value.get_ref() else {
                        let message = format!("`{name}` is a table");
                        return Err(self.complain(Some(key.span().start), &message));
                    };
                    self.merge(below, above)?;
                }
                // The value's place in the text comes with it.
                _ => {
                    base.insert(key.clone(), value.clone());
                }
            }
        }
        Ok(())
    }

    /// Where a key such as `radar.sigma_range_m` is said last: in the variant, else in the base.
    fn find(&self, key: &str, variant: Option<&str>) -> Option<usize> {
        let (table, name) = key.split_once('.')?;
        let root = self.document().ok()?;
        let variants = root.get("variant").and_then(|v| v.get_ref().as_table());
        let in_variant = variant
            .and_then(|name| self.ancestry(variants, name).ok())
            .and_then(|chain| chain.into_iter().rev().find_map(|t| place(t, table, name)));
        in_variant.or_else(|| place(&root, table, name))
    }

    fn complain(&self, at: Option<usize>, message: &str) -> ScenarioError {
        let place = at.map_or(String::new(), |at| format!(":{}", line(&self.text, at)));
        let message = format!("{}{place}: {message}", self.name);
        ScenarioError { message }
    }
}

/// Endings of keys that scenarios had once, and what they are now; the longer first.
const UNITS: [(&str, &str); 3] = [("_mps2", "_m_s2"), ("_mps", "_m_s"), ("_dps", "_deg_s")];

/// A table with the units in its keys as they are written now, so that older scenarios stay valid.
fn with_current_units<'i>(table: &DeTable<'i>) -> DeTable<'i> {
    let renamed = |key: &str| {
        let (stem, per) = key
            .strip_suffix("_sqrt_s")
            .map_or((key, ""), |stem| (stem, "_sqrt_s"));
        let unit = UNITS
            .iter()
            .find_map(|(old, new)| Some((stem.strip_suffix(old)?, new)));
        let name = unit.map(|(quantity, unit)| format!("{quantity}{unit}{per}"));
        // Said twice in one table, the old key is left to be refused.
        name.filter(|name| !table.contains_key(name.as_str()))
    };
    let entries = table.iter().map(|(key, value)| {
        let name = renamed(key.get_ref()).map_or_else(|| key.get_ref().clone(), Into::into);
        let mut value = value.clone();
        update_units(value.get_mut());
        (Spanned::new(key.span(), name), value)
    });
    entries.collect()
}

fn update_units(value: &mut DeValue<'_>) {
    match value {
        DeValue::Table(table) => *table = with_current_units(table),
        DeValue::Array(values) => values
            .iter_mut()
            .map(Spanned::get_mut)
            .for_each(update_units),
        _ => {}
    }
}

/// What the base calls itself.
fn name_of<'a>(root: &'a DeTable<'_>) -> Option<&'a str> {
    root.get("meta")?.get_ref().get("name")?.get_ref().as_str()
}

fn place(root: &DeTable<'_>, table: &str, name: &str) -> Option<usize> {
    let table = root.get(table)?.get_ref().as_table()?;
    table.get(name).map(|value| value.span().start)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = include_str!("../../../../scenarios/tracking/wilthil_brekke.toml");

    fn refusal(text: &str) -> String {
        ScenarioFile::parse("s.toml", text).unwrap_err().to_string()
    }

    #[test]
    fn variants_override_and_inherit() {
        let file = ScenarioFile::parse("s.toml", TEXT).unwrap();
        assert_eq!(file.variants()[0], "paper");
        let base = file.scenario(None).unwrap();
        assert_eq!(base.meta.name, "consistent");
        assert_eq!(file.scenario(Some("base")).unwrap(), base);
        assert_eq!(file.scenario(Some("consistent")).unwrap(), base);
        let paper = file.scenario(Some("paper")).unwrap();
        assert_eq!(paper.meta.name, "paper");
        assert!((paper.gps_compass.heading_std_deg - 6.0).abs() < 1e-12);
        assert!((paper.gps_compass.rate_hz - base.gps_compass.rate_hz).abs() < 1e-12);
        let halved = file.scenario(Some("paper_halved")).unwrap();
        let mut expected = paper;
        expected.meta.name = "paper_halved".to_owned();
        expected.navigation.noise_factor = 0.5;
        assert_eq!(halved, expected);
    }

    #[test]
    fn older_units_in_keys_are_read() {
        let old = TEXT
            .replace("_m_s2", "_mps2")
            .replace("_m_s", "_mps")
            .replace("_deg_s", "_dps");
        assert_ne!(old, TEXT);
        let file = |text| ScenarioFile::parse("s.toml", text);
        let (old, new) = (file(&old).unwrap(), file(TEXT).unwrap());
        for variant in [None, Some("paper_halved"), Some("mems")] {
            assert_eq!(old.scenario(variant), new.scenario(variant));
        }
        let twice = TEXT.replace("speed_m_s = 10.0", "speed_m_s = 10.0\nspeed_mps = 9.0");
        assert!(refusal(&twice).contains("speed_mps"));
        let bad = TEXT.replace("sigma_gyro_deg_s = 0.4", "sigma_gyro_dps = -0.4");
        let line = 1 + bad.lines().position(|line| line.contains("-0.4")).unwrap();
        assert!(refusal(&bad).starts_with(&format!("s.toml:{line}: imu.sigma_gyro_deg_s is -0.4")));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line_and_the_valid_names() {
        let line_of =
            |needle: &str, text: &str| 1 + text.lines().position(|l| l.contains(needle)).unwrap();
        let unknown = TEXT.replace("sigma_range_m", "sigma_range_km");
        let message = refusal(&unknown);
        let expected = format!("s.toml:{}:", line_of("sigma_range_km", &unknown));
        assert!(message.starts_with(&expected), "{message}");
        assert!(
            message.contains("sigma_range_km") && message.contains("`sigma_range_m`"),
            "{message}"
        );

        let in_variant = TEXT.replace(
            "imu.noise_reading = \"step\"",
            "imu.noise_reading = \"steps\"",
        );
        let message = refusal(&in_variant);
        let expected = format!("s.toml:{}:", line_of("\"steps\"", &in_variant));
        assert!(
            message.starts_with(&expected) && message.contains("`density`"),
            "{message}"
        );

        let unknown_parent = TEXT.replace("inherits = \"perstep\"", "inherits = \"perstap\"");
        let message = refusal(&unknown_parent);
        assert!(
            message.contains("no variant `perstap`") && message.contains("mems"),
            "{message}"
        );
        let circle = TEXT.replace(
            "[variant.perstep]",
            "[variant.perstep]\ninherits = \"perstep_halved\"",
        );
        assert!(refusal(&circle).contains("inherits from itself"));

        let file = ScenarioFile::parse("s.toml", TEXT).unwrap();
        let message = file.scenario(Some("mem")).unwrap_err().to_string();
        assert!(
            message.contains("no variant `mem`") && message.contains("mems"),
            "{message}"
        );
        assert!(refusal("[meta").starts_with("s.toml:1:"));
    }

    #[test]
    fn numbers_that_are_invalid_are_refused_where_they_are_said() {
        for (good, bad, words) in [
            (
                "sigma_range_m = 20.0",
                "sigma_range_m = 0.0",
                "radar.sigma_range_m is 0, expected a finite number above zero",
            ),
            (
                "sigma_range_m = 20.0",
                "sigma_range_m = -2.0",
                "radar.sigma_range_m is -2",
            ),
            (
                "heading_std_deg = 3.0",
                "heading_std_deg = nan",
                "gps_compass.heading_std_deg is NaN",
            ),
            (
                "rate_hz = 100.0",
                "rate_hz = 99.0",
                "a multiple of gps_compass.rate_hz",
            ),
            (
                "clutter_per_scan = 0.0",
                "clutter_per_scan = 3.0",
                "radar.clutter_per_scan is 3",
            ),
            (
                "duration_s = 300.0",
                "duration_s = 0.5",
                "whole periods of the radar",
            ),
            (
                "gyro_bias_std_deg_s = 0.02",
                "gyro_bias_std_deg_s = 0.02\ngyro_resolution_deg_s = -1.0",
                "imu.gyro_resolution_deg_s is -1, expected zero or more",
            ),
            (
                "roll_pitch_std_deg = 1.0",
                "roll_pitch_std_deg = 1.0\nlatency_s = 0.1",
                "a whole number of periods",
            ),
            (
                "monte_carlo_runs = 100",
                "monte_carlo_runs = 0",
                "at least 1",
            ),
        ] {
            let text = TEXT.replacen(good, bad, 1);
            assert_ne!(text, TEXT, "{good}");
            let message = refusal(&text);
            let wrong = bad.lines().last().unwrap();
            let at = 1 + text.lines().position(|l| l.contains(wrong)).unwrap();
            assert!(
                message.contains(words) && message.starts_with(&format!("s.toml:{at}:")),
                "{message}"
            );
        }
        let variant = TEXT.replace(
            "navigation.noise_factor = 0.5",
            "navigation.noise_factor = -0.5",
        );
        let at = 1 + variant.lines().position(|l| l.contains("-0.5")).unwrap();
        assert!(
            refusal(&variant).starts_with(&format!("s.toml:{at}:")),
            "{}",
            refusal(&variant)
        );
    }
}
