//! `relit insert`: objects in photographs, by differential rendering and naively.

use crate::cli::numbers::{above_zero, degrees, from_one, pair, triple};
use crate::cli::options::{DenoiseOptions, DeviceOptions, Replace};
use crate::cli::photographs::write_with_progress;
use crate::cli::saved::{Loaded, SavedOptions};
use crate::compose::object::surface::MaterialOverride;
use crate::compose::placement::Placement;
use crate::error::Result;
use crate::session::photographs::Photographs;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use glam::{DVec2, DVec3, Vec3};
use std::ffi::OsString;
use std::path::PathBuf;

/// `relit insert`.
#[derive(Debug, Args)]
pub struct InsertArguments {
    #[command(flatten)]
    saved: SavedOptions,
    /// Photograph to insert into, counted from 0; or all of them, written as PREFIX.NNN
    #[arg(long, value_name = "N|all", value_parser = frame_choice)]
    frame: FrameChoice,
    #[command(flatten)]
    objects: Objects,
    /// Samples per pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = from_one::<u32>)]
    spp: u32,
    #[command(flatten)]
    denoise: DenoiseOptions,
    /// Whether objects get the blur and grain of 8-bit photographs
    #[arg(long, value_name = "BOOL", default_value_t = true, action = ArgAction::Set)]
    finish: bool,
    #[command(flatten)]
    device: DeviceOptions,
    /// Prefix of the files to write
    #[arg(long, value_name = "PREFIX")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

/// Inserts objects and writes the composites. Returns the exit code.
///
/// # Errors
/// The results or an object cannot be read, the frame does not exist, or a file cannot be written.
pub fn insert(arguments: &InsertArguments) -> Result<i32> {
    arguments.replace.apply();
    let renderer = arguments.device.renderer()?;
    let Loaded {
        saved,
        capture,
        found,
        edits,
        estimate,
    } = arguments.saved.load()?;
    let work = Photographs {
        frames: match arguments.frame {
            FrameChoice::One(frame) => vec![frame],
            FrameChoice::All => (0..capture.scene.cameras.len()).collect(),
        },
        capture,
        found,
        edited: estimate,
        settings: saved.settings,
        placements: arguments.objects.0.clone(),
        relight: !edits.is_empty(),
        samples: arguments.spp,
        denoise: arguments.denoise.denoiser(true)?,
        finish: arguments.finish,
    };
    write_with_progress(&work, &renderer, &|frame| match arguments.frame {
        FrameChoice::One(_) => arguments.out.clone(),
        FrameChoice::All => {
            let mut name = OsString::from(&arguments.out);
            name.push(format!(".{frame:03}"));
            PathBuf::from(name)
        }
    })
}

/// The photographs to insert into.
#[derive(Debug, Clone, Copy, PartialEq)]
enum FrameChoice {
    One(usize),
    All,
}

fn frame_choice(text: &str) -> std::result::Result<FrameChoice, String> {
    match text {
        "all" => Ok(FrameChoice::All),
        _ => text
            .parse()
            .map(FrameChoice::One)
            .map_err(|_| "a frame's number or all is wanted".to_owned()),
    }
}

/// The objects in the order of the command line.
#[derive(Debug, Clone, Default)]
struct Objects(Vec<Placement>);

/// Parses KIND:R,G,B or KIND:R,G,B,ROUGHNESS: linear base colour and GGX roughness α, all from 0 to 1.
fn material(text: &str) -> std::result::Result<MaterialOverride, String> {
    const WANTED: &str = "diffuse:R,G,B, plastic:R,G,B,ROUGHNESS or metal:R,G,B,ROUGHNESS is wanted, with numbers from 0 to 1";
    let (kind, numbers) = text.split_once(':').ok_or(WANTED)?;
    let numbers: Vec<f32> = numbers
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|v| (0.0..=1.0).contains(v)))
        .collect::<Option<_>>()
        .ok_or(WANTED)?;
    let (roughness, rgb) = match (kind, &numbers[..]) {
        ("diffuse", &[r, g, b]) => (None, [r, g, b]),
        ("plastic" | "metal", &[r, g, b, roughness]) => (Some(roughness), [r, g, b]),
        _ => return Err(WANTED.to_owned()),
    };
    Ok(MaterialOverride {
        base_color: Vec3::from_array(rgb),
        metallic: if kind == "metal" { 1.0 } else { 0.0 },
        roughness,
    })
}

impl Args for Objects {
    fn augment_args(command: Command) -> Command {
        let option = |name: &'static str, value: &'static str, help: &'static str| {
            Arg::new(name)
                .long(name)
                .value_name(value)
                .help(help)
                .action(ArgAction::Append)
                .help_heading("Objects; each option is for the --object before it")
        };
        command
            .arg(
                option("object", "FILE", "OBJ or GLB file; may repeat")
                    .required(true)
                    .value_parser(clap::value_parser!(PathBuf)),
            )
            .arg(
                option(
                    "at",
                    "X,Y,Z",
                    "Position of the centre of its base, in the capture's coordinates",
                )
                .allow_hyphen_values(true)
                .value_parser(triple),
            )
            .arg(
                option(
                    "as-modelled",
                    "",
                    "Use the file's coordinates as the capture's",
                )
                .num_args(0)
                .default_missing_value("true")
                .value_parser(clap::value_parser!(bool)),
            )
            .arg(
                option("scale", "S", "Factor on the file's size [default: 1]")
                    .value_parser(above_zero),
            )
            .arg(
                option(
                    "rotate",
                    "DEG",
                    "Rotation about the up axis, counter-clockwise from above [default: 0]",
                )
                .allow_hyphen_values(true)
                .value_parser(degrees),
            )
            .arg(
                option(
                    "tilt",
                    "X,Z",
                    "Rotation about the file's x and z axes in degrees, z first, before --rotate [default: 0,0]",
                )
                .allow_hyphen_values(true)
                .value_parser(pair),
            )
            .arg(
                option(
                    "material",
                    "KIND:R,G,B[,ROUGHNESS]",
                    "Replaces the file's materials: diffuse:R,G,B, plastic:R,G,B,ROUGHNESS or metal:R,G,B,ROUGHNESS",
                )
                .value_parser(material),
            )
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// The values of an option with their indices on the command line.
fn indexed_values<T: Clone + Send + Sync + 'static>(
    matches: &ArgMatches,
    name: &str,
) -> Vec<(usize, T)> {
    let values = matches.get_many::<T>(name).into_iter().flatten().cloned();
    let indices = matches.indices_of(name).into_iter().flatten();
    indices.zip(values).collect()
}

impl FromArgMatches for Objects {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let files = indexed_values::<PathBuf>(matches, "object");
        let wrong =
            |problem: String| clap::Error::raw(clap::error::ErrorKind::ArgumentConflict, problem);
        // Index of the object that an option belongs to: the last --object before it.
        let owner = |index: usize, name: &str| {
            let before = files.iter().filter(|(at, _)| *at < index).count();
            before
                .checked_sub(1)
                .ok_or_else(|| wrong(format!("--{name} stands before any --object")))
        };
        let mut objects = Self(
            files
                .iter()
                .map(|(_, file)| Placement::new(file, None))
                .collect(),
        );
        let mut as_modelled = vec![false; files.len()];
        for (index, at) in indexed_values::<DVec3>(matches, "at") {
            objects.0[owner(index, "at")?].at = Some(at);
        }
        for (index, flag) in indexed_values::<bool>(matches, "as-modelled") {
            as_modelled[owner(index, "as-modelled")?] = flag;
        }
        for (index, scale) in indexed_values::<f64>(matches, "scale") {
            objects.0[owner(index, "scale")?].scale = scale;
        }
        for (index, rotate) in indexed_values::<f64>(matches, "rotate") {
            objects.0[owner(index, "rotate")?].rotate = rotate;
        }
        for (index, tilt) in indexed_values::<DVec2>(matches, "tilt") {
            objects.0[owner(index, "tilt")?].tilt = tilt;
        }
        for (index, material) in indexed_values::<MaterialOverride>(matches, "material") {
            objects.0[owner(index, "material")?].material = Some(material);
        }
        for (placement, as_modelled) in objects.0.iter().zip(as_modelled) {
            if placement.at.is_some() == as_modelled {
                return Err(wrong(format!(
                    "--object {} needs either --at x,y,z or --as-modelled",
                    placement.file.display()
                )));
            }
        }
        Ok(objects)
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::material::DIELECTRIC;

    fn parse(line: &str) -> std::result::Result<Vec<Placement>, String> {
        let command = Objects::augment_args(Command::new("insert"));
        let words = std::iter::once("insert").chain(line.split_whitespace());
        let parsed = command.try_get_matches_from(words);
        let objects = parsed.and_then(|matches| Objects::from_arg_matches(&matches));
        objects.map(|objects| objects.0).map_err(|e| e.to_string())
    }

    #[test]
    fn each_option_belongs_to_the_object_before_it() {
        let line = "--object a.obj --at -1,0,2 --rotate -90 --tilt -30,15 \
                    --object b.glb --scale 0.01 --as-modelled --material metal:0.9,0.6,0.3,0.25";
        let parsed = parse(line).expect("valid");
        assert_eq!(parsed.len(), 2);
        assert!(parsed[0].material.is_none());
        let made = parsed[1].material.expect("a material");
        let made = made.surface().material(None);
        let lobe = made.lobe.expect("a metal shines");
        assert_eq!(
            (lobe.roughness, lobe.specular),
            (0.25, Vec3::new(0.9, 0.6, 0.3))
        );
        assert_eq!(parsed[0].at, Some(DVec3::new(-1.0, 0.0, 2.0)));
        assert_eq!((parsed[0].scale, parsed[0].rotate), (1.0, -90.0));
        assert_eq!(parsed[0].tilt, DVec2::new(-30.0, 15.0));
        assert_eq!(parsed[1].at, None);
        assert_eq!((parsed[1].scale, parsed[1].rotate), (0.01, 0.0));
        assert_eq!(parsed[1].tilt, DVec2::ZERO);
    }

    #[test]
    fn an_object_without_a_place_and_an_option_without_an_object_are_refused() {
        assert!(parse("--object a.obj").is_err_and(|e| e.contains("a.obj needs either")));
        let both = parse("--object a.obj --as-modelled --at 0,0,0");
        assert!(both.is_err_and(|e| e.contains("needs either")));
        let early = parse("--scale 2 --object a.obj --as-modelled");
        assert!(early.is_err_and(|e| e.contains("before any")));
    }

    #[test]
    fn materials_are_what_they_are_called_and_others_are_refused() {
        let made = |text| material(text).expect("valid").surface().material(None);
        assert!(made("diffuse:0.1,0.2,0.3").lobe.is_none());
        let lobe = made("plastic:0.1,0.2,0.3,0.5")
            .lobe
            .expect("plastic shines");
        assert_eq!(
            (lobe.roughness, lobe.specular),
            (0.5, Vec3::splat(DIELECTRIC))
        );
        for text in [
            "",
            "diffuse",
            "0.1,0.2,0.3",
            "diffuse:0.1,0.2",
            "diffuse:0.1,0.2,0.3,0.4",
            "metal:0.1,0.2,0.3",
            "metal:0.1,0.2,0.3,1.5",
            "plastic:0.1,-0.2,0.3,0.5",
            "plastic:0.1,NaN,0.3,0.5",
            "glass:0.1,0.2,0.3,0.5",
        ] {
            assert!(
                material(text).is_err_and(|e| e.contains("is wanted")),
                "{text}"
            );
        }
    }
}
