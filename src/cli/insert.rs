//! `relit insert`: objects in photographs, by differential rendering and naively.

use crate::cli::numbers::{above_zero, degrees, from_one, pair, triple};
use crate::cli::options::{DenoiseOptions, DeviceOptions, Replace, SavedOptions};
use crate::cli::progress::write_with_progress;
use crate::compose::object::surface::MaterialOverride;
use crate::compose::placement::Placement;
use crate::compose::write::with_ending;
use crate::error::Result;
use crate::session::photographs::Photographs;
use clap::error::ErrorKind;
use clap::{ArgAction, ArgMatches, Args, Command, FromArgMatches};
use glam::{DVec2, DVec3, Vec3};
use std::path::PathBuf;

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
pub fn insert(arguments: &InsertArguments) -> Result<i32> {
    arguments.replace.apply();
    let renderer = arguments.device.renderer()?;
    let loaded = arguments.saved.load()?;
    let work = Photographs {
        frames: match arguments.frame {
            FrameChoice::One(frame) => vec![frame],
            FrameChoice::All => (0..loaded.capture.scene.cameras.len()).collect(),
        },
        capture: loaded.capture,
        found: loaded.found,
        edited: loaded.estimate,
        settings: loaded.saved.settings,
        placements: arguments.objects.0.clone(),
        relight: !loaded.edits.is_empty(),
        samples: arguments.spp,
        denoise: arguments.denoise.denoiser(true)?,
        finish: arguments.finish,
        renderer,
    };
    write_with_progress(&work, &|frame| match arguments.frame {
        FrameChoice::One(_) => arguments.out.clone(),
        FrameChoice::All => with_ending(&arguments.out, &format!(".{frame:03}")),
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

/// Objects and what is said of each.
#[derive(Debug, Args)]
#[command(next_help_heading = "Objects; each option is for the --object before it")]
struct ObjectOptions {
    /// OBJ or GLB file; may repeat
    #[arg(long, value_name = "FILE", required = true)]
    object: Vec<PathBuf>,
    /// Position of the centre of its base, in the capture's coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    at: Vec<DVec3>,
    /// Use the file's coordinates as the capture's
    #[arg(
        long,
        id = "as-modelled",
        value_name = "",
        num_args = 0,
        default_missing_value = "true"
    )]
    as_modelled: Vec<bool>,
    /// Factor on the file's size [default: 1]
    #[arg(long, value_name = "S", value_parser = above_zero)]
    scale: Vec<f64>,
    /// Rotation about the up axis, counter-clockwise from above [default: 0]
    #[arg(long, value_name = "DEG", value_parser = degrees, allow_hyphen_values = true)]
    rotate: Vec<f64>,
    /// Rotation about the file's x and z axes in degrees, z first, before --rotate [default: 0,0]
    #[arg(long, value_name = "X,Z", value_parser = pair, allow_hyphen_values = true)]
    tilt: Vec<DVec2>,
    /// Replaces the file's materials: diffuse:R,G,B, plastic:R,G,B,ROUGHNESS or metal:R,G,B,ROUGHNESS
    #[arg(long, value_name = "KIND:R,G,B[,ROUGHNESS]", value_parser = material)]
    material: Vec<MaterialOverride>,
}

/// The objects in the order of the command line, made of [`ObjectOptions`].
#[derive(Debug, Clone, Default)]
struct Objects(Vec<Placement>);

impl Args for Objects {
    fn augment_args(command: Command) -> Command {
        // Without its heading for what follows.
        ObjectOptions::augment_args(command).next_help_heading(None::<&'static str>)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

fn wrong(problem: String) -> clap::Error {
    clap::Error::raw(ErrorKind::ArgumentConflict, problem)
}

/// Gives each value of an option to the object that it belongs to: the last `--object` before it.
fn give<O, T>(
    matches: &ArgMatches,
    objects: &mut [O],
    name: &str,
    values: Vec<T>,
    set: impl Fn(&mut O, T),
) -> std::result::Result<(), clap::Error> {
    let places = |name: &str| matches.indices_of(name).into_iter().flatten();
    for (place, value) in places(name).zip(values) {
        let before = places("object").filter(|object| *object < place).count();
        let owner = before.checked_sub(1);
        let owner = owner.ok_or_else(|| wrong(format!("--{name} stands before any --object")))?;
        set(&mut objects[owner], value);
    }
    Ok(())
}

impl FromArgMatches for Objects {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let given = ObjectOptions::from_arg_matches(matches)?;
        let files = given.object.iter();
        let mut objects: Vec<_> = files.map(|file| Placement::new(file, None)).collect();
        let mut as_modelled = vec![false; objects.len()];
        let all = &mut objects;
        give(matches, all, "at", given.at, |o, at| o.at = Some(at))?;
        let flags = &mut as_modelled;
        give(matches, flags, "as-modelled", given.as_modelled, |o, is| {
            *o = is
        })?;
        give(matches, all, "scale", given.scale, |o, s| o.scale = s)?;
        give(matches, all, "rotate", given.rotate, |o, r| o.rotate = r)?;
        give(matches, all, "tilt", given.tilt, |o, tilt| o.tilt = tilt)?;
        let made_of = |o: &mut Placement, material| o.material = Some(material);
        give(matches, all, "material", given.material, made_of)?;
        for (placement, as_modelled) in objects.iter().zip(as_modelled) {
            if placement.at.is_some() == as_modelled {
                let file = placement.file.display();
                let problem = format!("--object {file} needs either --at x,y,z or --as-modelled");
                return Err(wrong(problem));
            }
        }
        Ok(Self(objects))
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
        let gold = Vec3::new(0.9, 0.6, 0.3);
        assert_eq!((lobe.roughness, lobe.specular), (0.25, gold));
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
        let plastic = made("plastic:0.1,0.2,0.3,0.5");
        let lobe = plastic.lobe.expect("plastic shines");
        let specular = Vec3::splat(DIELECTRIC);
        assert_eq!((lobe.roughness, lobe.specular), (0.5, specular));
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
            let refused = material(text).is_err_and(|e| e.contains("is wanted"));
            assert!(refused, "{text}");
        }
    }
}
