//! The parameters of a solve as options of the command line.

use crate::inverse::settings::{Kind, PARAMETERS, Parameter, Settings, Value};
use clap::builder::ValueParser;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};

/// Parameters given on the command line, with their values.
#[derive(Debug, Clone, Default)]
pub struct Parameters(Vec<(&'static Parameter, Value)>);

impl Parameters {
    /// `settings` with the given values set.
    pub fn over(&self, settings: &Settings) -> Settings {
        let mut settings = settings.clone();
        for (parameter, value) in &self.0 {
            // `parse` has checked the values.
            let accepted = parameter.set(&mut settings, value);
            debug_assert_eq!(accepted, Ok(()));
        }
        // `--hold-out 0` holds nothing out, whereas single pixels are held out by default.
        let explicit = |name: &str| self.0.iter().any(|(p, _)| p.name == name);
        if explicit("hold_out") && settings.hold_out == 0 && !explicit("held_out") {
            settings.held_out = 0.0;
        }
        settings
    }
}

/// Parses a value. Only the command line accepts `auto` bounces, and times with a unit s, m or h.
fn parse(parameter: &'static Parameter, text: &str) -> Result<Value, String> {
    let value = match (parameter.name, parameter.unit) {
        ("bounces", _) if text == "auto" => Value::Whole(0),
        (name, "s") => (duration(text).map(Value::Real))
            .ok_or_else(|| format!("{name} must be a time such as 90, 60s, 5m or 1h"))?,
        (_, "%") => parameter.parse(text.strip_suffix('%').unwrap_or(text))?,
        _ => parameter.parse(text)?,
    };
    parameter.set(&mut Settings::default(), &value)?;
    Ok(value)
}

/// Parses a time such as 90, 60s, 1.5m or 2h; in seconds.
pub fn duration(text: &str) -> Option<f64> {
    let split = text.find(|c: char| c.is_ascii_alphabetic() && c != 'e');
    let (number, unit) = text.split_at(split.unwrap_or(text.len()));
    let factor = match unit {
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return None,
    };
    let seconds = number.parse::<f64>().ok()? * factor;
    (seconds.is_finite() && seconds >= 0.0).then_some(seconds)
}

/// A value as it is typed.
fn text(value: Value) -> String {
    match value {
        Value::Flag(flag) => flag.to_string(),
        Value::Whole(n) => n.to_string(),
        Value::Real(x) => x.to_string(),
        Value::Choice(word) => word,
    }
}

fn option(parameter: &'static Parameter) -> Arg {
    let default = text(parameter.get(&Settings::default()));
    let help = format!("{} [default: {default}]", parameter.help);
    let value_name = match parameter.kind {
        Kind::Flag => "true|false".to_owned(),
        Kind::Choice(words) => words.join("|"),
        _ if parameter.unit == "s" => "TIME".to_owned(),
        _ if parameter.name == "bounces" => "N|auto".to_owned(),
        Kind::Whole { .. } => "N".to_owned(),
        Kind::Real { .. } => "X".to_owned(),
    };
    Arg::new(parameter.name)
        .long(parameter.name.replace('_', "-"))
        .value_name(value_name)
        .help(help)
        .help_heading("Parameters of the solve")
        .value_parser(ValueParser::new(move |text: &str| parse(parameter, text)))
}

impl Args for Parameters {
    fn augment_args(command: Command) -> Command {
        command.args(PARAMETERS.iter().map(option))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Parameters {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = |parameter: &'static Parameter| {
            let value = matches.get_one::<Value>(parameter.name)?;
            Some((parameter, value.clone()))
        };
        Ok(Self(PARAMETERS.iter().filter_map(given).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(arguments: &[&str]) -> Result<Settings, clap::Error> {
        let command = Parameters::augment_args(Command::new("relit"));
        let all = std::iter::once(&"relit").chain(arguments);
        let matches = command.try_get_matches_from(all)?;
        Ok(Parameters::from_arg_matches(&matches)?.over(&Settings::default()))
    }

    #[test]
    fn every_parameter_is_an_option_by_which_it_gets_its_value() {
        for parameter in PARAMETERS {
            let values: Vec<String> = match parameter.kind {
                Kind::Flag => [true, false].map(|flag| flag.to_string()).to_vec(),
                Kind::Whole { min, max } => [min, max].map(|n| n.to_string()).to_vec(),
                Kind::Real { min, max, .. } => [min, max].map(|x| x.to_string()).to_vec(),
                Kind::Choice(words) => words.iter().map(ToString::to_string).collect(),
            };
            let option = format!("--{}", parameter.name.replace('_', "-"));
            let mut reached = Vec::new();
            for value in &values {
                let settings = given(&[&option, value]).expect("the value is allowed");
                reached.push(text(parameter.get(&settings)));
            }
            assert_eq!(reached, values, "{option}");
        }
    }

    #[test]
    fn times_bounces_and_held_out_frames_are_read_as_people_write_them() {
        let time = |text| given(&["--time", text]).map(|s| s.time).ok();
        assert_eq!(time("60s"), Some(60.0));
        assert_eq!(time("1.5m"), Some(90.0));
        assert_eq!(time("2h"), Some(7200.0));
        assert_eq!(time("5"), Some(5.0));
        for wrong in ["", "s", "5 parsecs", "-1", "nan", "inf"] {
            assert_eq!(time(wrong), None, "{wrong}");
        }
        let bounces = |text| given(&["--bounces", text]).map(|s| s.bounces).ok();
        assert_eq!(bounces("auto"), Some(0));
        assert_eq!(bounces("3"), Some(3));
        assert_eq!(bounces("many"), None);
        let target = |text| Some(given(&["--target-error", text]).ok()?.target_error);
        assert_eq!(target("1%"), Some(1.0));
        assert_eq!(target("0.5"), Some(0.5));
        assert_eq!(target("101"), None);
        let held_out = |arguments: &[&str]| given(arguments).map(|s| s.held_out).ok();
        assert_eq!(held_out(&[]), Some(Settings::default().held_out));
        assert_eq!(held_out(&["--hold-out", "0"]), Some(0.0));
        let some = held_out(&["--hold-out", "4"]);
        assert_eq!(some, Some(Settings::default().held_out));
    }
}
