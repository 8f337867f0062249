//! `relit evaluate`: the errors of an estimate against the truth.

use crate::cli::numbers::threads;
use crate::cli::options::use_threads;
use crate::error::{Error, Result};
use crate::say;
use crate::session::command::{OpenOptions, Source};
use crate::session::open::open;
use crate::session::save;
use crate::study::evaluate::{Evaluation, evaluate as compare};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct EvaluateArguments {
    /// Folder that relit solve wrote
    dir: PathBuf,
    /// Capture with truth.json and, for textures, truth/albedo_NNN.exr
    #[arg(long, value_name = "CAPTURE")]
    truth: PathBuf,
    /// Let paths in the capture lead out of its folder; only for captures that you trust
    #[arg(long)]
    allow_outside: bool,
    /// Write JSON instead of a table
    #[arg(long)]
    json: bool,
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<u16>,
}

/// Prints the errors of an estimate.
pub fn evaluate(arguments: &EvaluateArguments) -> Result<()> {
    use_threads(arguments.threads)?;
    let saved = save::load(&arguments.dir)?;
    let options = OpenOptions {
        allow_outside: arguments.allow_outside,
        ..saved.options.clone()
    };
    let capture = open(&Source::Folder(arguments.truth.clone()), &options)?;
    let estimate = saved.estimate_by_name(&capture)?;
    let (scene, photographs) = (&capture.scene, &capture.photographs);
    let (truth, read) = (&arguments.truth, &capture.capture);
    let evaluation = compare(truth, read, scene, photographs, &estimate)?;
    if arguments.json {
        let text = serde_json::to_string_pretty(&evaluation)
            .map_err(|error| Error::new("evaluate", error, ""))?;
        say::result(&say::json(&text))
    } else {
        say::result(table(&evaluation).trim_end())
    }
}

fn table(e: &Evaluation) -> String {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.4}"));
    let rows = [
        ("objects scored", Some(e.objects as f64)),
        ("albedo, mean absolute error", e.albedo_mae),
        ("albedo, median relative error", e.albedo_rel_median),
        ("albedo, 95th percentile", e.albedo_rel_p95),
        ("albedo pictures, PSNR in dB", e.albedo_psnr),
        (
            "  at best with one colour an object",
            e.albedo_psnr_constant_per_object,
        ),
        ("emitters, intersection over union", e.emission_iou),
        ("emission, mean squared log error", e.emission_log_mse),
        ("emission, median relative error", e.emission_rel_median),
        ("scale fitted to the light", Some(e.emission_scale)),
    ];
    let mut text = String::new();
    for (name, value) in rows {
        text += &format!("{name:38} {:>10}\n", number(value));
    }
    let per_object = e.per_object.iter();
    let per_object: Vec<_> = per_object.map(|(name, e)| (say::plain(name), e)).collect();
    let names = per_object.iter().map(|(n, _)| n.chars().count());
    let width = names.max().unwrap_or(0).max(6);
    text += &format!(
        "\n{:width$}  {:>8}  {:>10}  {:>12}\n",
        "object", "pixels", "albedo err", "emission err"
    );
    for (name, errors) in &per_object {
        let albedo = number(errors.albedo_rel.filter(|_| errors.scored));
        let (pixels, emission) = (errors.pixels, number(errors.emission_rel));
        text += &format!("{name:width$}  {pixels:>8}  {albedo:>10}  {emission:>12}\n");
    }
    text
}
