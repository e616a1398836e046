//! Parameters of the estimators: a profile, then a configuration file, then single settings.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use northing_evaluation::attitude::parameters::parameters_of;
use northing_evaluation::attitude::{EstimatorKind, Profile, RunOptions};
use northing_evaluation::navigation::NavigationOptions;
use northing_evaluation::{EvaluationError, Origin, RunEstimator, by_name};
use northing_recording::limits::read_description;
use serde_json::{Map, Value as Json};
use toml::de::{DeArray, DeTable, DeValue};

/// Options that set parameters of estimators with profiles.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Parameters")]
pub(crate) struct SettingArgs {
    /// Parameters to start from: hand-held (real use, the default) or lab (moved gently)
    #[arg(long, value_name = "NAME")]
    profile: Option<Profile>,
    #[command(flatten)]
    parameters: ParameterArgs,
}

/// Options that set parameters: by a file, then one by one.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Parameters")]
pub(crate) struct ParameterArgs {
    /// File with parameters: TOML, one `name = value` a line, and perhaps `profile = "lab"`; or JSON, such as
    /// `--json` prints
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One parameter, e.g. bounded_velocity_psd=0.05; may be repeated; `northing estimators NAME` lists them
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// What the file says: it is read once, for it may be a pipe.
    #[arg(skip)]
    file: OnceCell<ConfigFile>,
}

impl ParameterArgs {
    fn file(&self) -> Result<Option<&ConfigFile>> {
        let Some(path) = &self.config else {
            return Ok(None);
        };
        if self.file.get().is_none() {
            // It is empty, so this cannot fail.
            let _ = self.file.set(ConfigFile::read(path)?);
        }
        Ok(self.file.get())
    }

    /// The estimator that the file names.
    ///
    /// # Errors
    /// The file cannot be read, or there is no such estimator.
    pub(crate) fn estimator<E: FromStr<Err = String>>(&self) -> Result<Option<E>> {
        let named = self.file()?.and_then(|file| file.estimator.as_ref());
        named
            .map(|(name, place)| name.parse().map_err(|e: String| anyhow!("{place}: {e}")))
            .transpose()
    }

    /// Hands over every setting, those of the file first.
    ///
    /// # Errors
    /// The file cannot be read or is no TOML and no JSON; or as `set`.
    pub(crate) fn apply(
        &self,
        mut set: impl FnMut(&str, Origin) -> Result<(), EvaluationError>,
    ) -> Result<()> {
        for (setting, place) in self.file()?.iter().flat_map(|file| &file.settings) {
            set(setting, Origin::File).with_context(|| place.clone())?;
        }
        for setting in &self.set {
            set(setting, Origin::Set).context("--set")?;
        }
        Ok(())
    }

    /// As [`Self::apply`], for an estimator without profiles: a file that names one is refused.
    pub(crate) fn apply_without_profile(
        &self,
        estimator: &impl std::fmt::Display,
        set: impl FnMut(&str, Origin) -> Result<(), EvaluationError>,
    ) -> Result<()> {
        if let (
            Some(path),
            Some(ConfigFile {
                profile: Some(_), ..
            }),
        ) = (&self.config, self.file()?)
        {
            let file = path.display();
            bail!("{file}: `profile`: `{estimator}` has no profiles; leave the line out");
        }
        self.apply(set)
    }
}

impl SettingArgs {
    /// As [`ParameterArgs::estimator`].
    pub(crate) fn estimator(&self) -> Result<Option<RunEstimator>> {
        self.parameters.estimator()
    }

    /// Options with this estimator, otherwise the profile's, and these parameters: the profile (named here, or in the file, or hand-held),
    /// changed by the file, changed by `--set`.
    ///
    /// # Errors
    /// As [`ParameterArgs::apply`]; a name is unknown or a value does not fit.
    pub(crate) fn options(&self, estimator: Option<EstimatorKind>) -> Result<RunOptions> {
        let file = self.parameters.file()?;
        let in_file = file.and_then(|file| file.profile);
        let profile = self.profile.or(in_file).unwrap_or_default();
        let mut options = RunOptions::new(estimator.unwrap_or(profile.estimator()), profile);
        if let (None, Some(file), Some(path)) = (estimator, file, &self.parameters.config) {
            file.check_effect(options.estimator, path)?;
        }
        let set = |setting: &str, origin| options.set_from(setting, origin);
        self.parameters.apply(set)?;
        Ok(options)
    }

    /// Changes options that are there already by each `--set`.
    ///
    /// # Errors
    /// A name is unknown, has no effect, or a value does not fit.
    pub(crate) fn change(&self, options: &mut RunOptions) -> Result<()> {
        let set = |setting: &str, origin| options.set_from(setting, origin);
        self.parameters.apply(set)?;
        self.check_effect(options.estimator)
    }

    /// Changes parameters of a navigation estimator: by the file, then by `--set`.
    ///
    /// # Errors
    /// As [`Self::options`], and a profile, which navigation estimators do not have.
    pub(crate) fn navigation_parameters(&self, options: &mut NavigationOptions) -> Result<()> {
        let kind = options.estimator;
        if self.profile.is_some() {
            bail!("`{kind}` has no profiles; leave --profile out and set what you need with --set");
        }
        let set = |setting: &str, origin| options.set_from(setting, origin);
        self.parameters.apply_without_profile(&kind, set)
    }

    /// Refuses a `--set` that this estimator has no use for. A file may be shared by several.
    pub(crate) fn check_effect(&self, estimator: EstimatorKind) -> Result<()> {
        let known = parameters_of(estimator);
        let is_known = |setting: &&String| {
            let name = setting.split('=').next().unwrap_or_default().trim();
            known.iter().any(|parameter| parameter.name == name)
        };
        let Some(setting) = self
            .parameters
            .set
            .iter()
            .find(|setting| !is_known(setting))
        else {
            return Ok(());
        };
        let has = if known.is_empty() {
            "it has no parameters".to_owned()
        } else {
            let names: Vec<&str> = known.iter().map(|p| p.name.as_str()).collect();
            format!("it has {}", names.join(", "))
        };
        bail!(
            "--set {setting} has no effect on `{estimator}`: {has}; `northing estimators` lists them all"
        )
    }
}

/// A configuration file, taken apart: settings as `name=value`, with the place for messages.
#[derive(Debug, Clone, Default)]
struct ConfigFile {
    profile: Option<Profile>,
    estimator: Option<(String, String)>,
    settings: Vec<(String, String)>,
}

impl ConfigFile {
    /// Refuses a file without any parameter of the estimator that nobody named.
    fn check_effect(&self, estimator: EstimatorKind, path: &Path) -> Result<()> {
        let known = parameters_of(estimator);
        let names = self.settings.iter().map(|(setting, _)| setting);
        let mut names = names.filter_map(|setting| setting.split('=').next());
        // What is no parameter at all is told of by its line.
        let other = |name: &str| {
            let is = |kind: &EstimatorKind| parameters_of(*kind).iter().any(|p| p.name == name);
            !known.iter().any(|p| p.name == name) && EstimatorKind::ALL.iter().any(is)
        };
        if !self.settings.is_empty() && names.all(other) {
            bail!(
                "{}: none of its parameters has an effect on `{estimator}`; name the estimator that they are for \
                 (--estimator mekf), or see `northing estimators`",
                path.display()
            );
        }
        Ok(())
    }

    fn read(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let text = read_description(path)?;
        #[cfg(feature = "ros")]
        if path
            .extension()
            .is_some_and(|end| end == "yaml" || end == "yml")
        {
            return Self::parse_yaml(&text, &file);
        }
        match text.trim_start().starts_with('{') {
            true => Self::parse_json(&text, &file),
            false => Self::parse(&text, &file),
        }
    }

    /// Takes a value under its name.
    fn take(&mut self, name: &str, value: String, place: String) -> Result<()> {
        match name {
            "profile" => self.profile = Some(value.parse().context(place)?),
            "estimator" | "tracker" => self.estimator = Some((value, place)),
            _ => self.settings.push((format!("{name}={value}"), place)),
        }
        Ok(())
    }

    /// Names and values, or the document of a run: of that the parameters, their profile and estimator.
    fn parse_json(text: &str, file: &str) -> Result<Self> {
        let document: Map<String, Json> = serde_json::from_str(text).map_err(|error| {
            anyhow!("{file}: not JSON: {error}; expected what `northing run --json` prints")
        })?;
        let mut parsed = Self::default();
        let Some(Json::Array(used)) = document.get("parameters") else {
            for (name, value) in &document {
                parsed.take(name, by_name::text(value), format!("{file}, `{name}`"))?;
            }
            return Ok(parsed);
        };
        for name in ["profile", "estimator", "tracker"] {
            if let Some(word) = document.get(name).and_then(Json::as_str) {
                parsed.take(name, word.to_owned(), format!("{file}, `{name}`"))?;
            }
        }
        for parameter in used {
            let (Some(name), Some(value)) = (parameter["name"].as_str(), parameter.get("value"))
            else {
                bail!("{file}: `parameters` has an entry without name or value: {parameter}");
            };
            parsed.take(name, by_name::text(value), format!("{file}, `{name}`"))?;
        }
        Ok(parsed)
    }

    /// The parameters of a node as launch files of ROS 2 have them: `northing: ros__parameters: name: value`. Of several
    /// nodes those of `northing` and of all (`/**`) are taken.
    #[cfg(feature = "ros")]
    fn parse_yaml(text: &str, file: &str) -> Result<Self> {
        let nodes: Map<String, Json> = serde_yaml_ng::from_str(text).map_err(|error| {
            anyhow!("{file}: not YAML of ROS parameters: {error}; expected northing: ros__parameters: ...")
        })?;
        let mut parsed = Self::default();
        let is_one = nodes.len() == 1;
        for (node, value) in &nodes {
            let name = node.rsplit('/').next().unwrap_or_default();
            if !(is_one || matches!(name, "**" | "northing")) {
                continue;
            }
            let Some(parameters) = value.get("ros__parameters").and_then(Json::as_object) else {
                bail!(
                    "{file}: `{node}` has no ros__parameters; expected northing: ros__parameters: ..."
                );
            };
            // Stamps are always those of the messages.
            for (name, value) in parameters
                .iter()
                .filter(|(name, _)| *name != "use_sim_time")
            {
                parsed.take(name, by_name::text(value), format!("{file}, `{name}`"))?;
            }
        }
        Ok(parsed)
    }

    fn parse(text: &str, file: &str) -> Result<Self> {
        let place = |start: usize| {
            let line = text[..start].bytes().filter(|byte| *byte == b'\n').count() + 1;
            format!("{file}, line {line}")
        };
        let table = DeTable::parse(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start.min(text.len()));
            anyhow!(
                "{}: not TOML: {}; expected lines such as accelerometer_std = 0.3",
                place(start),
                error.message()
            )
        })?;
        let mut parsed = Self::default();
        let mut entries: Vec<_> = table.get_ref().iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        for (key, value) in entries {
            let name = key.get_ref();
            let place = place(key.span().start);
            let value = match value.get_ref() {
                DeValue::String(word) => word.to_string(),
                DeValue::Boolean(flag) => flag.to_string(),
                DeValue::Array(items) => numbers(items, text),
                DeValue::Integer(_) | DeValue::Float(_) => text[value.span()].replace('_', ""),
                _ => {
                    return Err(anyhow!(
                        "{place}: `{name}` is no number and no word; expected e.g. {name} = 0.3"
                    ));
                }
            };
            parsed.take(name, value, place)?;
        }
        Ok(parsed)
    }
}

/// The items of an array as `--set` takes them: `1,2,3`.
fn numbers(items: &DeArray<'_>, text: &str) -> String {
    let items = items.iter().map(|item| text[item.span()].replace('_', ""));
    items.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::attitude::{AttitudeConfig, MagnetometerUse};

    fn settings(file: &str, args: SettingArgs) -> Result<RunOptions> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("lab.toml");
        std::fs::write(&path, file)?;
        let mut args = args;
        args.parameters.config = Some(path);
        args.options(Some(EstimatorKind::Mekf))
    }

    fn set(setting: &str) -> SettingArgs {
        let mut args = SettingArgs::default();
        args.parameters.set.push(setting.to_owned());
        args
    }

    fn message(file: &str) -> String {
        let error = settings(file, SettingArgs::default()).unwrap_err();
        format!("{error:#}")
    }

    #[test]
    fn without_anything_it_is_the_hand_held_profile() {
        let settings = SettingArgs::default().options(None).unwrap();
        assert_eq!(settings.estimator, EstimatorKind::BoundedVelocity);
        assert_eq!(settings.config.attitude, AttitudeConfig::hand_held());
        assert!(settings.origins.is_empty());
    }

    #[test]
    fn single_settings_win_over_the_file_and_the_file_over_the_profile() {
        let file = "profile = 'lab'\naccelerometer_std = 0.2\nmagnetometer_use = \"heading\"\n";
        let settings = settings(file, set("accelerometer_std=0.3")).unwrap();
        assert_eq!(settings.profile, Profile::Lab);
        let expected = AttitudeConfig {
            accelerometer_std: 0.3,
            magnetometer_use: MagnetometerUse::Heading,
            ..AttitudeConfig::lab()
        };
        assert_eq!(settings.config.attitude, expected);
        let origins: Vec<_> = settings.origins.into_iter().collect();
        let expected = [
            ("accelerometer_std".to_owned(), Origin::Set),
            ("magnetometer_use".to_owned(), Origin::File),
        ];
        assert_eq!(origins, expected);
    }

    #[test]
    fn a_setting_without_effect_is_refused_and_a_shared_file_is_not() {
        let refused = set("accelerometer_std=0.3").check_effect(EstimatorKind::Integration);
        let message = refused.unwrap_err().to_string();
        assert!(
            message.starts_with(
                "--set accelerometer_std=0.3 has no effect on `integration`: it has no parameters"
            ),
            "{message}"
        );
        let fits = set("accelerometer_std=0.3").check_effect(EstimatorKind::Mekf3);
        assert!(fits.is_ok());
        let mut file = SettingArgs::default();
        file.parameters.config = Some(PathBuf::from("shared.toml"));
        assert!(file.check_effect(EstimatorKind::Integration).is_ok());
    }

    #[test]
    fn errors_name_file_and_line_and_what_was_expected() {
        let unknown = message("accelerometer_std = 1\n\nacc_std = 1\n");
        assert!(
            unknown.contains("lab.toml, line 3: unknown parameter `acc_std`"),
            "{unknown}"
        );
        let mistyped = message("acelerometer_std = 1\n");
        assert!(
            mistyped.contains("did you mean `accelerometer_std`?"),
            "{mistyped}"
        );
        let broken = message("accelerometer_std = 1\nmagnetometer_std_ut 2\n");
        assert!(broken.contains("lab.toml, line 2: not TOML"), "{broken}");
        assert!(message("[a]\nb = 1").contains("`a` is no number"));
        assert!(message("gate_timeout_s = [1, 2]").contains("expected a number from 0 to 1e9"));
        assert!(message("profile = 'car'").contains("line 1: unknown profile `car`"));
        assert!(message("gate_timeout_s = -1").contains("from 0 to 1e9"));
    }

    #[cfg(feature = "ros")]
    #[test]
    fn parameters_of_a_node_are_read_as_launch_files_have_them() {
        let yaml = "talker:\n  ros__parameters:\n    rate: 3\n/robot_1/northing:\n  ros__parameters:\n    \
                    use_sim_time: true\n    estimator: mekf\n    accelerometer_std: 0.4\n";
        let parsed = ConfigFile::parse_yaml(yaml, "p.yaml").unwrap();
        let names: Vec<&str> = parsed
            .settings
            .iter()
            .map(|(one, _)| one.as_str())
            .collect();
        assert_eq!(names, ["accelerometer_std=0.4"]);
        assert_eq!(parsed.estimator.unwrap().0, "mekf");
        let bad = |text: &str| {
            ConfigFile::parse_yaml(text, "p.yaml")
                .unwrap_err()
                .to_string()
        };
        assert!(bad("northing:\n  rate: 3\n").contains("has no ros__parameters"));
        assert!(bad("- 3\n").starts_with("p.yaml: not YAML"));
    }
}
